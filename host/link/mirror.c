#include "mirror.h"

#include <stdlib.h>
#include <string.h>

#include "crc.h"
#include "loop.h"
#include "mirror_tick.h"
#include "state_hash.h"
#include "wire.h"

enum {
    LOST_TICKS_MOST = 127, /* of SYNC's 256: further is behind */
    LATEST_US = 350, /* a tick's torque frame is not later than so much into the next, or it is that of the next */
    RESYNC = 4,
    SOONEST_US =
        450,       /* a tick without a sample waits longer for one (LOOP_SAMPLE_WAIT_US from the beginning of SYNC) */
    TWICE_US = 700 /* two ticks' torque frames are further apart */
};

int mirror_open(struct mirror *mirror, const struct bank_view *bank, uint8_t node_id, struct failure *why)
{
    *mirror = (struct mirror){.bank = bank, .row_bytes = row_cache_memory(bank)};
    mirror->before = malloc(sizeof *mirror);
    if (mirror->row_bytes) {
        mirror->rows = malloc(mirror->row_bytes);
        mirror->saved_rows = malloc(mirror->row_bytes);
        mirror->before_rows = malloc(mirror->row_bytes);
    }
    if (!mirror->before || (mirror->row_bytes && (!mirror->rows || !mirror->saved_rows || !mirror->before_rows))) {
        mirror_close(mirror);
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for a controller and its rows (%zu bytes)",
                           sizeof *mirror + 3 * mirror->row_bytes);
    }
    int status = node_start(&mirror->node, bank, node_id, mirror->rows, mirror->row_bytes);
    if (status) {
        mirror_close(mirror);
        return failure_set(why, (enum status)status, NULL, NULL, "the controller does not start on this bank");
    }
    mirror->count = tick_instruments(&mirror->node.controller);
    return STATUS_OK;
}

void mirror_close(struct mirror *mirror)
{
    free(mirror->rows);
    free(mirror->saved_rows);
    free(mirror->before_rows);
    free(mirror->before);
    mirror->rows = mirror->saved_rows = mirror->before_rows = NULL;
    mirror->before = NULL;
}

void mirror_finish(struct mirror *mirror)
{
    if (mirror->open)
        mirror_end(mirror);
}

/* The controller was started again. Its first SYNC, and the sample that answers it, passed the heartbeat on the bus. */
static void start(struct mirror *mirror)
{
    const uint8_t node_id = mirror->node.node_id;
    if (mirror->ticks == 0)
        return; /* so was the mirror */
    node_start(&mirror->node, mirror->bank, node_id, mirror->rows, mirror->row_bytes);
    memset(mirror->heard, 0, sizeof mirror->heard);
    mirror->joined = false;
    mirror->starts++;
    mirror_begin(mirror);
}

/* The counter must have gone on by as many ticks as the time says; else it was damaged, and is of no use. */
static unsigned lost_ticks(const struct mirror *mirror, uint8_t counter, uint64_t time_us)
{
    const unsigned ahead = (counter - (mirror->node.controller.tick_count + 1)) & 0xFF;
    if (!mirror->any_sync || ahead == 0 || ahead > LOST_TICKS_MOST)
        return 0;
    const uint64_t elapsed = (time_us - mirror->sync_us + LOOP_TICK_US / 2) / LOOP_TICK_US;
    return elapsed > ahead ? ahead : 0;
}

/* After faults of many kinds at once the mirror may have made a tick too many or too few. When SYNC says the same for RESYNC
 * times in a row, it is believed: the mirror joins anew. */
static void resynchronise(struct mirror *mirror, uint8_t counter)
{
    const int8_t off = (int8_t)(counter - (mirror->node.controller.tick_count + 1 + mirror->open));
    mirror->same_off = off == mirror->sync_off ? mirror->same_off + 1 : 0;
    mirror->sync_off = off;
    if (off == 0 || mirror->same_off < RESYNC)
        return;
    mirror->joined = true;
    mirror->node.controller.tick_count += (uint32_t)off;
}

static void receive_sync(struct mirror *mirror, const struct can_frame_t *frame, uint64_t time_us)
{
    struct wire_sync m;
    if (!wire_sync_unpack(&m, frame->data, frame->length))
        return;
    resynchronise(mirror, m.counter);
    const uint32_t number = mirror->node.controller.tick_count + 1 + mirror->open; /* of the tick that should begin */
    if (!mirror->any_sync && m.counter != (uint8_t)number && !mirror->open) {
        mirror->joined = true;
        mirror->node.controller.tick_count = m.counter - 1u;
    } else if (((m.counter - number) & 0xFF) >= 0x80) {
        if (mirror->ignored++ > 0)
            mirror->sync_us = time_us; /* one after the other: it is the mirror that is ahead */
        return;                        /* heard twice, or late */
    }
    mirror->ignored = 0;
    mirror->doubtful = mirror->open && mirror_heard(mirror) > 0;
    if (mirror->doubtful)
        mirror_keep(mirror);
    mirror_finish(mirror);
    for (unsigned lost = lost_ticks(mirror, m.counter, time_us); lost > 0; lost--) {
        mirror_begin(mirror);
        mirror_end(mirror);
        mirror->lost_ticks++;
    }
    mirror->any_sync = true;
    mirror->sync_us = time_us;
    mirror->old_pending = mirror->pending_count;
    mirror_begin(mirror);
}

/* Samples of an instrument that wait; *answered: the sequence is one of theirs. */
static size_t samples_waiting(const struct mirror *mirror, uint32_t t, uint8_t sequence, bool *answered)
{
    struct wire_encoders sample;
    size_t count = 0;
    *answered = false;
    for (size_t i = 0; i < mirror->pending_count; i++) {
        if (mirror_sample_of(mirror, &mirror->pending[i], &sample) != t)
            continue;
        *answered |= sample.sequence == sequence;
        count++;
    }
    return count;
}

/* Since SYNC; where it was lost, since it should have come, which may be in a little while. */
static uint64_t since_sync_us(const struct mirror *mirror, uint64_t time_us)
{
    return time_us > mirror->sync_us ? time_us - mirror->sync_us : 0;
}

/* Has the tick that is open been open for longer than one lasts? */
static bool overdue(const struct mirror *mirror, uint64_t time_us)
{
    return mirror->open && mirror->any_sync && since_sync_us(mirror, time_us) > LOOP_TICK_US + LATEST_US;
}

/* No SYNC came when the next tick began: it was lost, and so were torque frames of the tick that is open. */
static void pass_tick(struct mirror *mirror)
{
    mirror_finish(mirror);
    mirror->sync_us += LOOP_TICK_US;
}

/* Is this a torque frame of a tick that has passed without it? It is when it answers none of the samples that wait although
 * there are some, or comes sooner after SYNC than a tick without a sample computes. */
static bool passed(struct mirror *mirror, uint32_t t, const struct can_frame_t *frame, uint8_t sequence,
                   uint64_t time_us)
{
    bool answered;
    const size_t samples = samples_waiting(mirror, t, sequence, &answered);
    if (answered || (mirror->open && samples == 0 && since_sync_us(mirror, time_us) >= SOONEST_US))
        return false;
    for (uint64_t back = 1; back <= MIRROR_PAST && back <= mirror->ticks; back++) {
        const uint64_t place = (mirror->ticks - back) % MIRROR_PAST;
        if (mirror->missing[place][t] && mirror_same(&mirror->past[place][t], frame)) {
            mirror->missing[place][t] = false;
            return true;
        }
    }
    return false;
}

/* Is this a torque of the tick behind the one of which another's was heard? It is when it answers a sample that came since. */
static bool answers_later(const struct mirror *mirror, uint32_t t, uint8_t sequence)
{
    struct wire_encoders sample;
    bool later = false;
    if (mirror_heard(mirror) == 0)
        return false;
    for (size_t i = 0; i < mirror->pending_count; i++)
        if (mirror_sample_of(mirror, &mirror->pending[i], &sample) == t && sample.sequence == sequence) {
            if (i < mirror->before_torques)
                return false;
            later = true;
        }
    return later;
}

/* All torque frames of the tick were heard. */
static void conclude(struct mirror *mirror, uint64_t time_us)
{
    if (!overdue(mirror, time_us)) {
        mirror_end(mirror);
        return;
    }
    /* of this tick, by a machine that stamps late? or of the next, whose SYNC was lost? */
    mirror_keep(mirror);
    if (mirror_end(mirror))
        return;
    mirror_turn_back(mirror);
    memset(mirror->heard, 0, sizeof mirror->heard);
    pass_tick(mirror);
    mirror_begin(mirror);
    memcpy(mirror->heard, mirror->before->heard, sizeof mirror->heard);
    mirror->before_torques = mirror->pending_count;
    mirror_end(mirror);
}

/* A torque frame of the tick that SYNC ended with only the other's: end it again with both, which may choose other samples. */
static void end_again(struct mirror *mirror, uint32_t t, const struct can_frame_t *frame)
{
    struct can_frame_t since[MIRROR_PENDING];
    uint64_t since_us[MIRROR_PENDING];
    const size_t count = mirror->pending_count - mirror->old_pending;
    const uint64_t sync_us = mirror->sync_us;
    memcpy(since, mirror->pending + mirror->old_pending, count * sizeof *since);
    memcpy(since_us, mirror->pending_us + mirror->old_pending, count * sizeof *since_us);
    mirror_turn_back(mirror);
    mirror->heard[t] = true;
    mirror->heard_torques[t] = *frame;
    mirror_end(mirror);
    mirror->doubtful = false;
    mirror->sync_us = sync_us;
    mirror_begin(mirror);
    for (size_t i = 0; i < count; i++)
        mirror_pend(mirror, &since[i], since_us[i]);
}

static void receive_torques(struct mirror *mirror, uint32_t t, const struct can_frame_t *frame, uint64_t time_us)
{
    struct wire_torques m;
    if (!wire_torques_unpack(&m, frame->data, frame->length) ||
        m.crc != crc8_frame(frame->id, frame->data, WIRE_TORQUES_LENGTH - 1)) {
        mirror->damaged++;
        return;
    }
    if (passed(mirror, t, frame, m.sequence, time_us)) {
        mirror->unanswered--;
        mirror->late++;
        mirror->agreed++;
        return;
    }
    if (mirror->doubtful && mirror->open && mirror_heard(mirror) == 0 && !mirror->before->heard[t] &&
        since_sync_us(mirror, time_us) < SOONEST_US && mirror->pending_count >= mirror->old_pending) {
        end_again(mirror, t, frame);
        return;
    }
    const struct can_frame_t *last = mirror->heard[t] ? &mirror->heard_torques[t] : &mirror->torques[t];
    if ((!mirror->open || mirror->heard[t]) && mirror_same(frame, last) && time_us - mirror->torques_us[t] < TWICE_US)
        return; /* heard twice */
    if (mirror->heard[t] || answers_later(mirror, t, m.sequence))
        pass_tick(mirror); /* SYNC was lost, and the other's torque */
    if (!mirror->open)
        mirror_begin(mirror);
    mirror->torques_us[t] = time_us;
    if (mirror_heard(mirror) == 0)
        mirror->before_torques = mirror->pending_count; /* later frames are of the next tick */
    mirror->heard[t] = true;
    mirror->heard_torques[t] = *frame;
    if (mirror_heard(mirror) == mirror->count)
        conclude(mirror, time_us);
}

/* Whoever joins goes into RUN with the controller that is there already. */
static void follow(struct mirror *mirror, uint32_t t, unsigned state)
{
    struct can_frame_t frame = {.id = WIRE_NMT_ID, .length = WIRE_NMT_LENGTH};
    if (!mirror->joined || state != SAFETY_RUN || mirror->node.controller.instrument[t].safety.state != SAFETY_READY)
        return;
    wire_nmt_pack(frame.data, &(struct wire_nmt){.command = 1, .node = (uint8_t)(mirror->node.node_id + t)});
    mirror_pend(mirror, &frame, mirror->sync_us);
}

static void receive_health(struct mirror *mirror, uint32_t t, const struct can_frame_t *frame)
{
    struct wire_health m;
    const struct controller *c = &mirror->node.controller;
    if (!wire_health_unpack(&m, frame->data, frame->length))
        return;
    follow(mirror, t, m.state);
    if (m.page == 4 && mirror->joined && !mirror->open)
        mirror->node.controller.tick_count = m.tick;
    if (m.page != TELEMETRY_HEALTH_PAGES - 1)
        return;
    if (mirror->open && m.hash_tick == (uint16_t)(c->tick_count + 1))
        mirror_finish(mirror); /* telemetry follows the torque frames: one was not heard */
    if (m.hash_tick != (uint16_t)c->tick_count)
        return;
    const bool good = m.state_hash == state_hash(c);
    mirror->hashes_agreed += good;
    mirror->hashes_differed += !good;
    if (!good)
        mirror->recorded = mirror->computed = mirror->torques[t];
}

/* A frame of instrument t, with the number of its first instrument's. */
static void receive_own(struct mirror *mirror, uint32_t t, const struct can_frame_t *frame, uint64_t time_us)
{
    bool answered;
    switch (frame->id - t - mirror->node.node_id) {
    case WIRE_ENCODERS_ID:
        if (overdue(mirror, time_us) && samples_waiting(mirror, t, 0, &answered) > 0)
            pass_tick(mirror); /* a second sample */
        mirror_pend(mirror, frame, time_us);
        break;
    case WIRE_TORQUES_ID:
        receive_torques(mirror, t, frame, time_us);
        break;
    case WIRE_HEALTH_ID:
        receive_health(mirror, t, frame);
        break;
    case WIRE_HEARTBEAT_ID:
        if (t == 0 && frame->length == WIRE_HEARTBEAT_LENGTH && frame->data[0] == 0)
            start(mirror);
        break;
    default:
        break;
    }
}

enum mirror_verdict mirror_receive(struct mirror *mirror, const struct can_frame_t *frame, uint64_t time_us)
{
    const uint64_t damaged = mirror->damaged, good = mirror->agreed + mirror->hashes_agreed,
                   bad = mirror->differed + mirror->hashes_differed;
    const uint32_t t = (frame->id & 0x7F) - mirror->node.node_id;
    if (frame->flags & (CAN_FLAG_EXTENDED | CAN_FLAG_RTR | CAN_FLAG_ERROR))
        return MIRROR_NOTHING;
    if (frame->id == WIRE_SYNC_ID)
        receive_sync(mirror, frame, time_us);
    else if (frame->id == WIRE_NMT_ID)
        mirror_pend(mirror, frame, time_us);
    else if (t < mirror->count)
        receive_own(mirror, t, frame, time_us);
    return mirror->damaged > damaged                          ? MIRROR_DAMAGED
           : mirror->differed + mirror->hashes_differed > bad ? MIRROR_DIFFERS
           : mirror->agreed + mirror->hashes_agreed > good    ? MIRROR_AGREES
                                                              : MIRROR_NOTHING;
}
