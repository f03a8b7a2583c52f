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
        for (uint32_t t = 0; t < mirror->count; t++)
            if (frame.id == WIRE_TORQUES_ID + mirror->node.node_id + t)
                mirror->torques[t] = frame;
}

static bool same(const struct can_frame_t *a, const struct can_frame_t *b)
{
    return a->length == b->length && memcmp(a->data, b->data, a->length) == 0;
}

static uint32_t heard_count(const struct mirror *mirror)
{
    uint32_t count = 0;
    for (uint32_t t = 0; t < mirror->count; t++)
        count += mirror->heard[t];
    return count;
}

/* Are the torques those that were heard? */
static bool agrees(const struct mirror *mirror)
{
    bool all = true;
    for (uint32_t t = 0; t < mirror->count; t++)
        all = all && (!mirror->heard[t] || same(&mirror->torques[t], &mirror->heard_torques[t]));
    return all;
}

/* Which instrument's sample is this? `count` when it is none. */
static uint32_t sample_of(const struct mirror *mirror, const struct can_frame_t *frame, struct wire_encoders *sample)
{
    const uint32_t t = frame->id - WIRE_ENCODERS_ID - mirror->node.node_id;
    return t < mirror->count && wire_encoders_unpack(sample, frame->data, frame->length) ? t : mirror->count;
}

/* Do the torque frames answer all that waits, one sample each? Then there is nothing to choose. */
static bool plain(const struct mirror *mirror, size_t waiting)
{
    bool answered[BANK_MAX_INSTRUMENTS] = {false};
    struct wire_encoders sample;
    struct wire_torques answer;
    bool all = waiting == mirror->count;
    for (size_t i = 0; i < waiting && all; i++) {
        const uint32_t t = sample_of(mirror, &mirror->pending[i], &sample);
        all = t < mirror->count && !answered[t] && mirror->heard[t] &&
              wire_torques_unpack(&answer, mirror->heard_torques[t].data, mirror->heard_torques[t].length) &&
              answer.sequence == sample.sequence;
        if (all)
            answered[t] = true;
    }
    return all;
}

/* What was heard of this tick, counted. */
static void judge(struct mirror *mirror)
{
    const uint64_t place = mirror->ticks % MIRROR_PAST;
    for (uint32_t t = 0; t < mirror->count; t++) {
        mirror->past[place][t] = mirror->torques[t];
        mirror->missing[place][t] = !mirror->heard[t];
        mirror->unanswered += !mirror->heard[t];
        if (!mirror->heard[t])
            continue;
        const bool good = same(&mirror->torques[t], &mirror->heard_torques[t]);
        mirror->agreed += good;
        mirror->differed += !good;
        if (!good) {
            mirror->recorded = mirror->heard_torques[t];
            mirror->computed = mirror->torques[t];
        }
        mirror->heard[t] = false;
    }
}

/* End the tick, with the torque frames that were heard. */
static bool end(struct mirror *mirror)
{
    const bool any = heard_count(mirror) > 0;
    const size_t waiting = any ? mirror->before_torques : mirror->pending_count;
    size_t taken = waiting;
    while (!any && mirror->any_sync && taken > 0 &&
           mirror->pending_us[taken - 1] > mirror->sync_us + LOOP_SAMPLE_WAIT_US)
        taken--;
    const bool choice = any && taken > 0 && !plain(mirror, waiting);
    if (choice)
        save(mirror);
    compute(mirror, taken);
    bool good = agrees(mirror);
    while (choice && !good && taken > 0) {
        restore(mirror);
        compute(mirror, --taken);
        good = agrees(mirror);
    }
    if (choice && !good) { /* none agrees: as if all had been in time */
        restore(mirror);
        taken = waiting;
        compute(mirror, taken);
    }
    mirror->late += any ? waiting - taken : 0;
    mirror->pending_count -= taken;
    memmove(mirror->pending_us, mirror->pending_us + taken, mirror->pending_count * sizeof mirror->pending_us[0]);
    memmove(mirror->pending, mirror->pending + taken, mirror->pending_count * sizeof mirror->pending[0]);
    judge(mirror);
    mirror->ticks++;
    mirror->open = false;
    return good;
}

void mirror_finish(struct mirror *mirror)
{
    if (mirror->open)
        end(mirror);
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
        end(mirror);
        mirror->lost_ticks++;
    }
    mirror->any_sync = true;
    mirror->sync_us = time_us;
    begin(mirror);
}

/* Samples of an instrument that wait; *answered: the sequence is one of theirs. */
static size_t samples_waiting(const struct mirror *mirror, uint32_t t, uint8_t sequence, bool *answered)
{
    struct wire_encoders sample;
    size_t count = 0;
    *answered = false;
    for (size_t i = 0; i < mirror->pending_count; i++) {
        if (sample_of(mirror, &mirror->pending[i], &sample) != t)
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
    if (answered || (mirror->open && samples == 0 && time_us - mirror->sync_us >= SOONEST_US))
        return false;
    for (uint64_t back = 1; back <= MIRROR_PAST && back <= mirror->ticks; back++) {
        const uint64_t place = (mirror->ticks - back) % MIRROR_PAST;
        if (mirror->missing[place][t] && same(&mirror->past[place][t], frame)) {
            mirror->missing[place][t] = false;
            return true;
        }
    }
    return false;
}

/* All torque frames of the tick were heard. */
static void conclude(struct mirror *mirror, uint64_t time_us)
{
    if (!overdue(mirror, time_us)) {
        end(mirror);
        return;
    }
    /* of this tick, by a machine that stamps late? or of the next, whose SYNC was lost? */
    keep(mirror);
    if (end(mirror))
        return;
    turn_back(mirror);
    memset(mirror->heard, 0, sizeof mirror->heard);
    pass_tick(mirror);
    begin(mirror);
    memcpy(mirror->heard, mirror->before->heard, sizeof mirror->heard);
    mirror->before_torques = mirror->pending_count;
    end(mirror);
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
    const struct can_frame_t *last = mirror->heard[t] ? &mirror->heard_torques[t] : &mirror->torques[t];
    if ((!mirror->open || mirror->heard[t]) && same(frame, last) && time_us - mirror->torques_us[t] < TWICE_US)
        return; /* heard twice */
    if (mirror->heard[t])
        mirror_finish(mirror); /* SYNC was lost, and the other's torque */
    if (!mirror->open)
        begin(mirror);
    mirror->torques_us[t] = time_us;
    if (heard_count(mirror) == 0)
        mirror->before_torques = mirror->pending_count; /* later frames are of the next tick */
    mirror->heard[t] = true;
    mirror->heard_torques[t] = *frame;
    if (heard_count(mirror) == mirror->count)
        conclude(mirror, time_us);
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
static void follow(struct mirror *mirror, uint32_t t, unsigned state)
{
    struct can_frame_t frame = {.id = WIRE_NMT_ID, .length = WIRE_NMT_LENGTH};
    if (!mirror->joined || state != SAFETY_RUN || mirror->node.controller.instrument[t].safety.state != SAFETY_READY)
        return;
    wire_nmt_pack(frame.data, &(struct wire_nmt){.command = 1, .node = (uint8_t)(mirror->node.node_id + t)});
    pend(mirror, &frame, mirror->sync_us);
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
        pend(mirror, frame, time_us);
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
        pend(mirror, frame, time_us);
    else if (t < mirror->count)
        receive_own(mirror, t, frame, time_us);
    return mirror->damaged > damaged                          ? MIRROR_DAMAGED
           : mirror->differed + mirror->hashes_differed > bad ? MIRROR_DIFFERS
           : mirror->agreed + mirror->hashes_agreed > good    ? MIRROR_AGREES
                                                              : MIRROR_NOTHING;
}
