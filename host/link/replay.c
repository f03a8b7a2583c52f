#include "replay.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "wire.h"

enum { FIRST_FRAMES = 32 }; /* a few ticks: a recording may begin between the frames of two instruments */

/* The node that a frame is of, when it tells: an encoder or a torque frame. */
static unsigned node_of(const struct can_frame_t *frame)
{
    const uint32_t node = frame->id & 0x7F, base = frame->id - node;
    return frame->flags == 0 && node >= 1 && node <= 126 && (base == WIRE_ENCODERS_ID || base == WIRE_TORQUES_ID) ? node
                                                                                                                  : 0;
}

int replay_subject(FILE *in, const char *file, const struct replay_options *options, char interface[CANDUMP_INTERFACE],
                   unsigned *node, struct failure *why)
{
    struct candump_record record;
    long line = 0;
    int status = 0;
    *node = options->node;
    snprintf(interface, CANDUMP_INTERFACE, "%s", options->interface ? options->interface : "");
    for (int seen = 0; seen < FIRST_FRAMES && (status = candump_read(in, file, &line, &record, why)) == 1;) {
        if (!*interface)
            snprintf(interface, CANDUMP_INTERFACE, "%s", record.interface);
        if (options->node)
            break;
        const unsigned of = !strcmp(interface, record.interface) ? node_of(&record.frame) : 0;
        *node = of && (!*node || of < *node) ? of : *node;
        seen += *node != 0;
    }
    if (status < 0)
        return status;
    if (!*node)
        return failure_set(why, STATUS_BUS_LOG, file, "record the whole bus, or say --interface",
                           "the recording has no encoder or torque frame on the interface \"%s\"", interface);
    rewind(in);
    return STATUS_OK;
}

static void take(struct replay_result *result, const struct mirror *mirror)
{
    const struct controller *c = &mirror->node.controller;
    result->ticks = mirror->ticks;
    result->agreed = mirror->agreed;
    result->differed = mirror->differed;
    result->damaged = mirror->damaged;
    result->unanswered = mirror->unanswered;
    result->lost_ticks = mirror->lost_ticks;
    result->late = mirror->late;
    result->hashes_agreed = mirror->hashes_agreed;
    result->hashes_differed = mirror->hashes_differed;
    result->starts = mirror->starts;
    result->joined = mirror->joined;
    result->instruments = mirror->count;
    result->final_state = c->instrument[0].safety.state;
    for (uint32_t t = 1; t < mirror->count; t++)
        if (c->instrument[t].safety.state == SAFETY_SAFE)
            result->final_state = SAFETY_SAFE;
}

static void step(struct replay_result *result, struct mirror *mirror, const struct candump_record *record, long line)
{
    const struct can_frame_t *frame = &record->frame;
    if (result->frames++ == 0)
        result->first_us = record->time_us;
    result->last_us = record->time_us;
    result->samples += frame->id - WIRE_ENCODERS_ID - result->node < mirror->count;
    const enum mirror_verdict verdict = mirror_receive(mirror, frame, record->time_us);
    for (uint32_t t = 0; t < mirror->count; t++) {
        const float *f = mirror->node.controller.instrument[t].coupling.force_N;
        result->peak_force_N = fmax(result->peak_force_N, sqrt((double)(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])));
    }
    if (verdict != MIRROR_DIFFERS || result->line)
        return;
    result->line = line;
    result->tick = mirror->node.controller.tick_count;
    result->computed = mirror->computed;
    result->recorded = mirror->recorded;
}

int replay_log(FILE *in, const char *file, const struct bank_view *bank, const struct replay_options *options,
               struct replay_result *result, struct failure *why)
{
    struct mirror *mirror = malloc(sizeof *mirror); /* large */
    char interface[CANDUMP_INTERFACE];
    struct candump_record record;
    long line = 0;
    memset(result, 0, sizeof *result);
    if (!mirror)
        return failure_set(why, STATUS_MEMORY, file, NULL, "no memory for a controller");
    int status = replay_subject(in, file, options, interface, &result->node, why);
    if (!status)
        status = mirror_open(mirror, bank, (uint8_t)result->node, why);
    if (status) {
        free(mirror);
        return status;
    }
    while ((status = candump_read(in, file, &line, &record, why)) == 1)
        if (!strcmp(record.interface, interface))
            step(result, mirror, &record, line);
        else
            result->others++;
    mirror_finish(mirror);
    take(result, mirror);
    mirror_close(mirror);
    free(mirror);
    if (!status && result->ticks == 0)
        return failure_set(why, STATUS_BUS_LOG, file, "record the whole bus",
                           "the recording has neither SYNC nor torque frames: no controller ticks in it");
    return status;
}
