/* The backend of the simulated bus: a ring of received frames, filled when somebody runs the bus. */
#include <stdlib.h>

#include "backend_kind.h"
#include "bus.h"

struct soft {
    struct backend base;
    struct bus *bus;
    int node;
    size_t first, count;
    struct backend_received frame[BACKEND_MAX_FRAMES];
};

static void hears(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct soft *s = context;
    if (!backend_wanted(&s->base, frame))
        return;
    if (s->count == BACKEND_MAX_FRAMES) {
        s->base.counters.dropped++;
        return;
    }
    s->frame[(s->first + s->count++) % BACKEND_MAX_FRAMES] =
        (struct backend_received){.frame = *frame, .time_us = time_us};
}

static int receive(struct backend *b, struct backend_received *received, int64_t wait_us, struct failure *why)
{
    struct soft *s = (struct soft *)b;
    (void)wait_us;
    (void)why;
    if (s->count == 0)
        return 0;
    *received = s->frame[s->first];
    s->first = (s->first + 1) % BACKEND_MAX_FRAMES;
    s->count--;
    received->time_us = backend_time(b, received->time_us);
    return 1;
}

static int send(struct backend *b, const struct can_frame_t *frame, int64_t wait_us, struct failure *why)
{
    struct soft *s = (struct soft *)b;
    (void)wait_us;
    (void)why;
    return bus_send(s->bus, s->node, frame);
}

static int descriptor(const struct backend *b)
{
    (void)b;
    return -1;
}

static void close_soft(struct backend *b)
{
    (void)b;
}

int backend_soft(struct bus *bus, const struct backend_options *options, struct backend **backend, struct failure *why)
{
    static const struct backend_kind kind = {receive, send, descriptor, close_soft};
    struct soft *s = calloc(1, sizeof *s);
    *backend = NULL;
    if (!s)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the bus");
    int status = backend_begin(&s->base, &kind, "soft", "soft", options, why);
    if (!status && s->base.options.fd)
        status = failure_set(why, STATUS_BUS_FRAME, "soft", "leave FD out", "the simulated bus has no FD frames");
    s->bus = bus;
    s->node = status ? -1 : bus_attach(bus, hears, s);
    if (!status && s->node < 0)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "the simulated bus has no room for one more node");
    if (status) {
        free(s);
        return status;
    }
    *backend = &s->base;
    return STATUS_OK;
}
