#include "frame_source.h"

#include <stdlib.h>
#include <string.h>

enum { FRAMES_PER_TICK = 64 }; /* seven full frames fit 1 ms; what faults held back may come with them */

struct frame_source {
    struct backend *backend;
    struct session *session;
    size_t count, taken, lost;
    struct backend_received frame[FRAMES_PER_TICK];
};

static void hear(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct frame_source *source = context;
    if (source->count == FRAMES_PER_TICK) {
        source->lost++;
        return;
    }
    source->frame[source->count++] = (struct backend_received){.frame = *frame, .time_us = time_us};
}

int frame_source_open(const struct frame_source_options *options, struct frame_source **source, struct failure *why)
{
    int status;
    *source = calloc(1, sizeof **source);
    if (!*source)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to listen");
    if (options->bus && strcmp(options->bus, "soft") != 0) {
        const struct backend_options backend = {.errors = options->errors};
        status = backend_open(options->bus, &backend, &(*source)->backend, why);
    } else if (!options->bank) {
        status = failure_set(why, STATUS_USAGE, NULL, "name a scene to simulate, or --bus socketcan:IF or slcan:TTY",
                             "there is nothing to listen to");
    } else {
        status = session_create(options->bank, NULL, &options->session, &(*source)->session, why);
        if (!status)
            bus_listen(session_bus((*source)->session), hear, *source);
    }
    if (status) {
        frame_source_close(*source);
        *source = NULL;
    }
    return status;
}

int frame_source_next(struct frame_source *source, struct backend_received *received, int64_t wait_us,
                      struct failure *why)
{
    if (source->backend)
        return backend_receive(source->backend, received, wait_us, why);
    if (source->taken == source->count) {
        source->taken = source->count = 0;
        if (!session_tick(source->session))
            return FRAME_SOURCE_END;
        if (source->lost)
            return failure_set(why, STATUS_BUS_LOST, "soft", "", "more than %d frames came in one tick",
                               (int)FRAMES_PER_TICK);
        if (source->count == 0)
            return FRAME_SOURCE_NONE;
    }
    *received = source->frame[source->taken++];
    return FRAME_SOURCE_FRAME;
}

const char *frame_source_interface(const struct frame_source *source)
{
    return source->backend ? backend_interface(source->backend) : "soft";
}

const struct backend_counters *frame_source_counters(const struct frame_source *source)
{
    return source->backend ? backend_counters(source->backend) : NULL;
}

struct session *frame_source_session(struct frame_source *source)
{
    return source->session;
}

void frame_source_close(struct frame_source *source)
{
    if (!source)
        return;
    backend_close(source->backend);
    session_free(source->session);
    free(source);
}
