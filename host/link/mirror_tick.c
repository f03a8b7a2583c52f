#include "mirror_tick.h"

#include <string.h>

#include "loop.h"
#include "wire.h"

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
void mirror_keep(struct mirror *mirror)
{
    memcpy(mirror->before, mirror, sizeof *mirror);
    if (mirror->row_bytes)
        memcpy(mirror->before_rows, mirror->rows, mirror->row_bytes);
}

void mirror_turn_back(struct mirror *mirror)
{
    memcpy(mirror, mirror->before, sizeof *mirror);
    if (mirror->row_bytes)
        memcpy(mirror->rows, mirror->before_rows, mirror->row_bytes);
}

void mirror_begin(struct mirror *mirror)
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

bool mirror_same(const struct can_frame_t *a, const struct can_frame_t *b)
{
    return a->length == b->length && memcmp(a->data, b->data, a->length) == 0;
}

uint32_t mirror_heard(const struct mirror *mirror)
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
        all = all && (!mirror->heard[t] || mirror_same(&mirror->torques[t], &mirror->heard_torques[t]));
    return all;
}

/* Which instrument's sample is this? `count` when it is none. */
uint32_t mirror_sample_of(const struct mirror *mirror, const struct can_frame_t *frame, struct wire_encoders *sample)
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
        const uint32_t t = mirror_sample_of(mirror, &mirror->pending[i], &sample);
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
        const bool good = mirror_same(&mirror->torques[t], &mirror->heard_torques[t]);
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
bool mirror_end(struct mirror *mirror)
{
    const bool any = mirror_heard(mirror) > 0;
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

void mirror_pend(struct mirror *mirror, const struct can_frame_t *frame, uint64_t time_us)
{
    if (mirror->pending_count == MIRROR_PENDING) { /* more than a controller's tick can have: the oldest go in */
        node_receive(&mirror->node, &mirror->pending[0]);
        memmove(mirror->pending, mirror->pending + 1, --mirror->pending_count * sizeof mirror->pending[0]);
        memmove(mirror->pending_us, mirror->pending_us + 1, mirror->pending_count * sizeof mirror->pending_us[0]);
    }
    mirror->pending_us[mirror->pending_count] = time_us;
    mirror->pending[mirror->pending_count++] = *frame;
}
