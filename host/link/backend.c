#include "backend_kind.h"

#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const uint32_t extended_bit = 0x80000000; /* CAN_EFF_FLAG of SocketCAN */

int backend_begin(struct backend *b, const struct backend_kind *kind, const char *name, const char *interface,
                  const struct backend_options *options, struct failure *why)
{
    static const struct backend_options defaults;
    b->kind = kind;
    b->options = options ? *options : defaults;
    if (b->options.filters > BACKEND_MAX_FILTERS)
        return failure_set(why, STATUS_USAGE, name, "ask for fewer", "at most %d filters can be set",
                           (int)BACKEND_MAX_FILTERS);
    if (b->options.filters)
        memcpy(b->filter, b->options.filter, b->options.filters * sizeof b->filter[0]);
    b->options.filter = b->filter;
    if (snprintf(b->name, sizeof b->name, "%s", name) >= (int)sizeof b->name)
        return failure_set(why, STATUS_USAGE, NULL, "use a shorter path", "the bus's name \"%.60s...\" is too long",
                           name);
    snprintf(b->interface, sizeof b->interface, "%s", interface);
    return STATUS_OK;
}

int backend_open(const char *name, const struct backend_options *options, struct backend **backend, struct failure *why)
{
    *backend = NULL;
    if (!strncmp(name, "socketcan:", 10) && name[10])
        return socketcan_open(name + 10, options, backend, why);
    if (!strncmp(name, "slcan:", 6) && name[6])
        return slcan_open(name + 6, options, backend, why);
    if (!strcmp(name, "soft"))
        return failure_set(why, STATUS_BUS_NAME, NULL,
                           "name a bus that other programs reach: socketcan:IF or slcan:TTY",
                           "the bus \"soft\" lives inside one program");
    return failure_set(why, STATUS_BUS_NAME, NULL, NULL, "there is no bus \"%.80s\"", name);
}

int backend_receive(struct backend *b, struct backend_received *received, int64_t wait_us, struct failure *why)
{
    const int status = b->kind->receive(b, received, wait_us, why);
    b->counters.received += status == 1;
    return status;
}

int backend_send(struct backend *b, const struct can_frame_t *frame, int64_t wait_us, struct failure *why)
{
    const bool fd = frame->flags & CAN_FLAG_FD, extended = frame->flags & CAN_FLAG_EXTENDED;
    if (frame->flags & CAN_FLAG_ERROR || frame->length > (fd ? 64 : 8) || frame->id > (extended ? 0x1fffffffu : 0x7ffu))
        return failure_set(why, STATUS_BUS_FRAME, b->name, "", "a frame that cannot be was to be sent");
    if (fd && !b->options.fd)
        return failure_set(why, STATUS_BUS_FRAME, b->name, "open the bus with FD, where it has it",
                           "an FD frame was to be sent on a classic bus");
    const int status = b->kind->send(b, frame, wait_us, why);
    b->counters.sent += status == 1;
    b->counters.no_room += status == 0;
    return status;
}

int backend_descriptor(const struct backend *b)
{
    return b->kind->descriptor(b);
}

const char *backend_name(const struct backend *b)
{
    return b->name;
}

const char *backend_interface(const struct backend *b)
{
    return b->interface;
}

enum backend_state backend_state(const struct backend *b)
{
    return b->state;
}

const struct backend_counters *backend_counters(const struct backend *b)
{
    return &b->counters;
}

void backend_close(struct backend *b)
{
    if (!b)
        return;
    b->kind->close(b);
    free(b);
}

bool backend_wanted(const struct backend *b, const struct can_frame_t *frame)
{
    if (frame->flags & CAN_FLAG_ERROR)
        return b->options.errors;
    const uint32_t id = frame->id | (frame->flags & CAN_FLAG_EXTENDED ? extended_bit : 0);
    for (size_t i = 0; i < b->options.filters; i++)
        if (((id ^ b->filter[i].id) & (b->filter[i].mask | extended_bit)) == 0)
            return true;
    return b->options.filters == 0;
}

/* ---- time ---- */

uint64_t backend_time(struct backend *b, uint64_t time_us)
{
    if (time_us > b->newest_us)
        b->newest_us = time_us;
    return b->newest_us;
}

static uint64_t clock_us(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (uint64_t)t.tv_sec * 1000000 + (uint64_t)t.tv_nsec / 1000;
}

uint64_t backend_wall_us(void)
{
    return clock_us(CLOCK_REALTIME);
}

uint64_t backend_monotonic_us(void)
{
    return clock_us(CLOCK_MONOTONIC);
}

uint64_t backend_until(int64_t wait_us)
{
    return wait_us < 0 ? UINT64_MAX : wait_us == 0 ? 0 : backend_monotonic_us() + (uint64_t)wait_us;
}

bool backend_poll(int descriptor, short events, uint64_t until_us)
{
    struct pollfd poll = {.fd = descriptor, .events = events};
    struct timespec left = {0};
    if (until_us != 0 && until_us != UINT64_MAX) {
        const uint64_t now_us = backend_monotonic_us();
        if (until_us > now_us) {
            left.tv_sec = (time_t)((until_us - now_us) / 1000000);
            left.tv_nsec = (long)((until_us - now_us) % 1000000) * 1000;
        }
    }
    return ppoll(&poll, 1, until_us == UINT64_MAX ? NULL : &left, NULL) > 0;
}
