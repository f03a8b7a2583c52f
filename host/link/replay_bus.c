#include "replay_bus.h"

#include <stdlib.h>
#include <string.h>

#include "candump.h"
#include "wire.h"

enum { ROOM_WAIT_US = 200 };

static int no_memory(struct failure *why, const char *file)
{
    return failure_set(why, STATUS_MEMORY, file, NULL, "no memory for the recording");
}

/* Room for one more of each, doubling. */
static bool grow(struct replay_bus *replay)
{
    if ((replay->tick_count & (replay->tick_count + 1)) == 0) {
        void *ticks = realloc(replay->tick, 2 * (replay->tick_count + 1) * sizeof *replay->tick);
        if (!ticks)
            return false;
        replay->tick = ticks;
    }
    if ((replay->frame_count & (replay->frame_count + 1)) == 0) {
        void *frames = realloc(replay->frame, 2 * (replay->frame_count + 1) * sizeof *replay->frame);
        if (!frames)
            return false;
        replay->frame = frames;
    }
    return true;
}

static struct replay_bus_tick *begin(struct replay_bus *replay)
{
    struct replay_bus_tick *tick = &replay->tick[replay->tick_count++];
    *tick = (struct replay_bus_tick){.first = replay->frame_count};
    return tick;
}

static bool any_torques(const struct replay_bus_tick *tick)
{
    return tick->torques[0].there || tick->torques[1].there;
}

/* Which instrument's torque frame is this? BANK_MAX_INSTRUMENTS when it is none. */
static uint32_t torques_of(const struct replay_bus *replay, const struct can_frame_t *frame)
{
    const uint32_t t = frame->id - WIRE_TORQUES_ID - replay->node;
    return t < BANK_MAX_INSTRUMENTS && frame->length == WIRE_TORQUES_LENGTH ? t : BANK_MAX_INSTRUMENTS;
}

static void take(struct replay_bus *replay, const struct can_frame_t *frame, long line)
{
    struct replay_bus_tick *tick = replay->tick_count ? &replay->tick[replay->tick_count - 1] : NULL;
    const uint32_t t = torques_of(replay, frame);
    if (frame->flags)
        return;
    if (frame->id == WIRE_SYNC_ID) {
        begin(replay);
    } else if (t < BANK_MAX_INSTRUMENTS) {
        if (!tick || tick->torques[t].there)
            tick = begin(replay); /* its SYNC was lost */
        tick->torques[t].there = true;
        tick->torques[t].line = line;
        memcpy(tick->torques[t].data, frame->data, sizeof tick->torques[t].data);
        replay->count = t + 1 > replay->count ? t + 1 : replay->count;
    } else if (frame->id - WIRE_ENCODERS_ID - replay->node < BANK_MAX_INSTRUMENTS || frame->id == WIRE_NMT_ID) {
        if (!tick)
            tick = begin(replay);
        (*(any_torques(tick) ? &tick->after : &tick->before))++;
        replay->frame[replay->frame_count++] = *frame;
    }
}

int replay_bus_open(struct replay_bus *replay, FILE *in, const char *file, const struct replay_options *options,
                    struct failure *why)
{
    char interface[CANDUMP_INTERFACE];
    struct candump_record record;
    long line = 0;
    *replay = (struct replay_bus){.count = 1};
    int status = replay_subject(in, file, options, interface, &replay->node, why);
    while (!status && (status = candump_read(in, file, &line, &record, why)) == 1) {
        status = STATUS_OK;
        if (strcmp(record.interface, interface) != 0)
            continue;
        if (!grow(replay))
            status = no_memory(why, file);
        else
            take(replay, &record.frame, line);
    }
    if (!status && replay->frame_count == 0)
        status = failure_set(why, STATUS_BUS_LOG, file, "record the whole bus",
                             "the recording has no frame for a controller");
    if (status)
        replay_bus_close(replay);
    return status;
}

static int send(struct replay_bus *replay, struct backend *backend, size_t first, size_t count, struct failure *why)
{
    for (size_t i = 0; i < count; i++) {
        const int status = backend_send(backend, &replay->frame[first + i], ROOM_WAIT_US, why);
        if (status < 0)
            return status;
        replay->no_room += status == 0;
    }
    return STATUS_OK;
}

static void compare(struct replay_bus *replay, const struct replay_bus_tick *tick, uint32_t t,
                    const struct can_frame_t *frame)
{
    if (!tick->torques[t].there) {
        replay->not_recorded++;
    } else if (memcmp(tick->torques[t].data, frame->data, sizeof tick->torques[t].data) == 0) {
        replay->agreed++;
    } else {
        if (replay->differed++ == 0) {
            replay->line = tick->torques[t].line;
            memcpy(replay->heard, frame->data, sizeof replay->heard);
        }
    }
}

static uint32_t heard_count(const struct replay_bus *replay)
{
    return (uint32_t)replay->heard_torques[0] + replay->heard_torques[1];
}

/* The tick is over; the next one waits for its SYNC. */
static void close_tick(struct replay_bus *replay)
{
    replay->unanswered += replay->count - heard_count(replay);
    memset(replay->heard_torques, 0, sizeof replay->heard_torques);
    replay->open = false;
    replay->at++;
}

int replay_bus_receive(struct replay_bus *replay, struct backend *backend, const struct backend_received *received,
                       struct failure *why)
{
    const struct can_frame_t *frame = &received->frame;
    const uint32_t t = torques_of(replay, frame);
    int status = STATUS_OK;
    if (frame->flags)
        return 0;
    if (frame->id == WIRE_SYNC_ID) {
        if (replay->open)
            close_tick(replay);
        replay->open = replay->at < replay->tick_count;
        if (!replay->open)
            return 1;
        const struct replay_bus_tick *tick = &replay->tick[replay->at];
        status = send(replay, backend, tick->first, tick->before, why);
    } else if (t < replay->count && replay->open && !replay->heard_torques[t]) {
        const struct replay_bus_tick *tick = &replay->tick[replay->at];
        const bool first = heard_count(replay) == 0;
        compare(replay, tick, t, frame);
        replay->heard_torques[t] = true;
        if (first)
            status = send(replay, backend, tick->first + tick->before, tick->after, why);
        if (heard_count(replay) == replay->count)
            close_tick(replay);
    }
    return status ? status : replay->at == replay->tick_count;
}

void replay_bus_close(struct replay_bus *replay)
{
    free(replay->tick);
    free(replay->frame);
    replay->tick = NULL;
    replay->frame = NULL;
}
