#include "mirror.h"

#include <stdlib.h>
#include <string.h>

#include "crc.h"
#include "loop.h"
#include "state_hash.h"
#include "wire.h"

enum {
    LOST_TICKS_MOST = 127, /* of SYNC's 256: further is behind */
    LATEST_US = 350, /* a tick's torque frame is not later than so much into the next, or it is that of the next */
    SOONEST_US =
        450,       /* a tick without a sample waits longer for one (LOOP_SAMPLE_WAIT_US from the beginning of SYNC) */
    TWICE_US = 700 /* two ticks' torque frames are further apart */
};

int mirror_open(struct mirror *mirror, const struct bank_view *bank, uint32_t instrument, uint8_t node_id,
                struct failure *why)
{
    *mirror = (struct mirror){.bank = bank, .instrument = instrument, .row_bytes = row_cache_memory(bank)};
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

static void save(struct mirror *mirror)
{
    mirror->saved = mirror->node;
    if (mirror->row_bytes)
        memcpy(mirror->saved_rows, mirror->rows, mirror->row_bytes);
}

static void restore(struct mirror *mirror)
{
    mirror->node = mirror->saved;
    if (mirror->row_bytes)
        memcpy(mirror->rows, mirror->saved_rows, mirror->row_bytes);
}

/* The same for the whole mirror. */
static void keep(struct mirror *mirror)
{
    memcpy(mirror->before, mirror, sizeof *mirror);
    if (mirror->row_bytes)
        memcpy(mirror->before_rows, mirror->rows, mirror->row_bytes);
}

static void turn_back(struct mirror *mirror)
{
    memcpy(mirror, mirror->before, sizeof *mirror);
    if (mirror->row_bytes)
        memcpy(mirror->rows, mirror->before_rows, mirror->row_bytes);
}

static void begin(struct mirror *mirror)
{
    struct can_frame_t frame;
    node_begin_tick(&mirror->node);
    while (node_transmit(&mirror->node, &frame))
        ;
    mirror->open = true;
}

/* Compute the tick with the first `taken` of the frames that wait. */
static void compute(struct mirror *mirror, size_t taken)
{
    struct can_frame_t frame;
    for (size_t i = 0; i < taken; i++)
        node_receive(&mirror->node, &mirror->pending[i]);
    node_finish_tick(&mirror->node);
    while (node_transmit(&mirror->node, &frame))
        if (frame.id == WIRE_TORQUES_ID + (uint32_t)mirror->node.node_id)
            mirror->torques = frame;
}

static bool same(const struct can_frame_t *a, const struct can_frame_t *b)
{
    return a && b && a->length == b->length && memcmp(a->data, b->data, a->length) == 0;
}

/* Does the torque frame answer the only frame that waits, which is a sample? Then there is nothing to choose. */
static bool plain(const struct mirror *mirror, const struct can_frame_t *torques)
{
    struct wire_encoders sample;
    struct wire_torques answer;
    return mirror->pending_count == 1 && mirror->pending[0].id != WIRE_NMT_ID &&
           wire_encoders_unpack(&sample, mirror->pending[0].data, mirror->pending[0].length) &&
           wire_torques_unpack(&answer, torques->data, torques->length) && answer.sequence == sample.sequence;
}

/* End the tick; `torques`: the controller's, NULL when it was not heard. */
static bool end(struct mirror *mirror, const struct can_frame_t *torques)
{
    size_t taken = mirror->pending_count;
    while (!torques && mirror->any_sync && taken > 0 &&
           mirror->pending_us[taken - 1] > mirror->sync_us + LOOP_SAMPLE_WAIT_US)
        taken--;
    const bool choice = torques && taken > 0 && !plain(mirror, torques);
    if (choice)
        save(mirror);
    compute(mirror, taken);
    bool agrees = same(&mirror->torques, torques);
    while (choice && !agrees && taken > 0) {
        restore(mirror);
        compute(mirror, --taken);
        agrees = same(&mirror->torques, torques);
    }
    if (choice && !agrees) { /* none agrees: as if all had been in time */
        restore(mirror);
        taken = mirror->pending_count;
        compute(mirror, taken);
    }
    mirror->late += torques ? mirror->pending_count - taken : 0;
    mirror->pending_count -= taken;
    memmove(mirror->pending_us, mirror->pending_us + taken, mirror->pending_count * sizeof mirror->pending_us[0]);
    memmove(mirror->pending, mirror->pending + taken, mirror->pending_count * sizeof mirror->pending[0]);
    mirror->past[mirror->ticks % MIRROR_PAST] = mirror->torques;
    mirror->missing[mirror->ticks % MIRROR_PAST] = !torques;
    mirror->unanswered += !torques;
    mirror->ticks++;
    mirror->open = false;
    return agrees;
}

void mirror_finish(struct mirror *mirror)
{
    if (!mirror->open)
        return;
    end(mirror, NULL);
}

/* The controller was started again. Its first SYNC, and the sample that answers it, passed the heartbeat on the bus. */
static void start(struct mirror *mirror)
{
    const uint8_t node_id = mirror->node.node_id;
    if (mirror->ticks == 0)
        return; /* so was the mirror */
    node_start(&mirror->node, mirror->bank, node_id, mirror->rows, mirror->row_bytes);
    mirror->joined = false;
    mirror->starts++;
    begin(mirror);
}

/* The counter must have gone on by as many ticks as the time says; else it was damaged, and is of no use. */
static unsigned lost_ticks(const struct mirror *mirror, uint8_t counter, uint64_t time_us)
{
    const unsigned ahead = (counter - (mirror->node.controller.tick_count + 1)) & 0xFF;
    if (!mirror->any_sync || ahead == 0 || ahead > LOST_TICKS_MOST)
        return 0;
    const uint64_t elapsed = (time_us - mirror->sync_us + LOOP_TICK_US / 2) / LOOP_TICK_US;
    return elapsed >= ahead ? ahead : 0;
}

static void receive_sync(struct mirror *mirror, const struct can_frame_t *frame, uint64_t time_us)
{
    struct wire_sync m;
    if (!wire_sync_unpack(&m, frame->data, frame->length))
        return;
    const uint32_t number = mirror->node.controller.tick_count + 1 + mirror->open; /* of the tick that should begin */
    if (!mirror->any_sync && m.counter != (uint8_t)number && !mirror->open) {
        mirror->joined = true;
        mirror->node.controller.tick_count = m.counter - 1u;
    } else if (((m.counter - number) & 0xFF) >= 0x80) {
        return; /* heard twice, or late */
    }
    mirror_finish(mirror);
    for (unsigned lost = lost_ticks(mirror, m.counter, time_us); lost > 0; lost--) {
        begin(mirror);
        end(mirror, NULL);
        mirror->lost_ticks++;
    }
    mirror->any_sync = true;
    mirror->sync_us = time_us;
    begin(mirror);
}

/* Samples that wait; *answered: the sequence is one of theirs. */
static size_t samples_waiting(const struct mirror *mirror, uint8_t sequence, bool *answered)
{
    struct wire_encoders sample;
    size_t count = 0;
    *answered = false;
    for (size_t i = 0; i < mirror->pending_count; i++) {
        if (mirror->pending[i].id == WIRE_NMT_ID ||
            !wire_encoders_unpack(&sample, mirror->pending[i].data, mirror->pending[i].length))
            continue;
        *answered |= sample.sequence == sequence;
        count++;
    }
    return count;
}

/* Has the tick that is open been open for longer than one lasts? */
static bool overdue(const struct mirror *mirror, uint64_t time_us)
{
    return mirror->open && mirror->any_sync && time_us - mirror->sync_us > LOOP_TICK_US + LATEST_US;
}

/* No SYNC came when the next tick began: it was lost, and so was the torque frame of the tick that is open. */
static void pass_tick(struct mirror *mirror)
{
    mirror_finish(mirror);
    mirror->sync_us += LOOP_TICK_US;
}

/* Is this a torque frame of a tick that has passed without one? It is when it answers none of the samples that wait although
 * there are some, or comes sooner after SYNC than a tick without a sample computes. */
static bool passed(struct mirror *mirror, const struct can_frame_t *frame, uint8_t sequence, uint64_t time_us)
{
    bool answered;
    const size_t samples = samples_waiting(mirror, sequence, &answered);
    if (answered || (mirror->open && samples == 0 && time_us - mirror->sync_us >= SOONEST_US))
        return false;
    for (uint64_t back = 1; back <= MIRROR_PAST && back <= mirror->ticks; back++) {
        const uint64_t place = (mirror->ticks - back) % MIRROR_PAST;
        if (mirror->missing[place] && same(&mirror->past[place], frame)) {
            mirror->missing[place] = false;
            return true;
        }
    }
    return false;
}

static enum mirror_verdict receive_torques(struct mirror *mirror, const struct can_frame_t *frame, uint64_t time_us)
{
    struct wire_torques m;
    if (!wire_torques_unpack(&m, frame->data, frame->length) ||
        m.crc != crc8_frame(frame->id, frame->data, WIRE_TORQUES_LENGTH - 1)) {
        mirror->damaged++;
        return MIRROR_DAMAGED;
    }
    if (passed(mirror, frame, m.sequence, time_us)) {
        mirror->unanswered--;
        mirror->late++;
        mirror->agreed++;
        return MIRROR_AGREES;
    }
    if (!mirror->open) {
        if (same(frame, &mirror->torques) && time_us - mirror->torques_us < TWICE_US)
            return MIRROR_NOTHING; /* heard twice */
        begin(mirror);
    }
    mirror->torques_us = time_us;
    bool agrees;
    if (overdue(mirror, time_us)) {
        /* of this tick, by a machine that stamps late? or of the next, whose SYNC was lost? */
        keep(mirror);
        agrees = end(mirror, frame);
        if (!agrees) {
            turn_back(mirror);
            pass_tick(mirror);
            begin(mirror);
            agrees = end(mirror, frame);
        }
    } else {
        agrees = end(mirror, frame);
    }
    mirror->agreed += agrees;
    mirror->differed += !agrees;
    return agrees ? MIRROR_AGREES : MIRROR_DIFFERS;
}

static void pend(struct mirror *mirror, const struct can_frame_t *frame, uint64_t time_us)
{
    if (mirror->pending_count == MIRROR_PENDING) { /* more than a controller's tick can have: the oldest go in */
        node_receive(&mirror->node, &mirror->pending[0]);
        memmove(mirror->pending, mirror->pending + 1, --mirror->pending_count * sizeof mirror->pending[0]);
        memmove(mirror->pending_us, mirror->pending_us + 1, mirror->pending_count * sizeof mirror->pending_us[0]);
    }
    mirror->pending_us[mirror->pending_count] = time_us;
    mirror->pending[mirror->pending_count++] = *frame;
}

/* Whoever joins goes into RUN with the controller that is there already. */
static void follow(struct mirror *mirror, unsigned state)
{
    struct can_frame_t frame = {.id = WIRE_NMT_ID, .length = WIRE_NMT_LENGTH};
    if (!mirror->joined || state != SAFETY_RUN || mirror->node.controller.instrument[0].safety.state != SAFETY_READY)
        return;
    wire_nmt_pack(frame.data, &(struct wire_nmt){.command = 1, .node = mirror->node.node_id});
    pend(mirror, &frame, mirror->sync_us);
}

static enum mirror_verdict receive_health(struct mirror *mirror, const struct can_frame_t *frame)
{
    struct wire_health m;
    const struct controller *c = &mirror->node.controller;
    if (!wire_health_unpack(&m, frame->data, frame->length))
        return MIRROR_NOTHING;
    follow(mirror, m.state);
    if (m.page == 4 && mirror->joined && !mirror->open)
        mirror->node.controller.tick_count = m.tick;
    if (m.page != TELEMETRY_HEALTH_PAGES - 1)
        return MIRROR_NOTHING;
    if (mirror->open && m.hash_tick == (uint16_t)(c->tick_count + 1))
        mirror_finish(mirror); /* telemetry follows the torque frame: that was not heard */
    if (m.hash_tick != (uint16_t)c->tick_count)
        return MIRROR_NOTHING;
    const bool agrees = m.state_hash == state_hash(c);
    mirror->hashes_agreed += agrees;
    mirror->hashes_differed += !agrees;
    return agrees ? MIRROR_AGREES : MIRROR_DIFFERS;
}

enum mirror_verdict mirror_receive(struct mirror *mirror, const struct can_frame_t *frame, uint64_t time_us)
{
    const uint32_t node = mirror->node.node_id;
    if (frame->flags & (CAN_FLAG_EXTENDED | CAN_FLAG_RTR | CAN_FLAG_ERROR))
        return MIRROR_NOTHING;
    bool answered;
    if (frame->id == WIRE_ENCODERS_ID + node && overdue(mirror, time_us) && samples_waiting(mirror, 0, &answered) > 0)
        pass_tick(mirror); /* a second sample */
    if (frame->id == WIRE_SYNC_ID)
        receive_sync(mirror, frame, time_us);
    else if (frame->id == WIRE_TORQUES_ID + node)
        return receive_torques(mirror, frame, time_us);
    else if (frame->id == WIRE_HEALTH_ID + node)
        return receive_health(mirror, frame);
    else if (frame->id == WIRE_HEARTBEAT_ID + node && frame->length == WIRE_HEARTBEAT_LENGTH && frame->data[0] == 0)
        start(mirror);
    else if (frame->id == WIRE_ENCODERS_ID + node || frame->id == WIRE_NMT_ID)
        pend(mirror, frame, time_us);
    return MIRROR_NOTHING;
}
