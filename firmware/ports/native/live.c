/* A bus of this machine.
 *
 * Time is the monotonic clock's. The wait for the encoder frames ends with the last of them (poll); that for the next tick sleeps to an
 * absolute time, and takes frames that came meanwhile afterwards. A frame that the bus has no room for is dropped at once and
 * counted by the loop: an old torque must not go out late.
 *
 * Slow (native_options.slow above 1), for machines on which the bus has no millisecond to offer: a tick takes so many at
 * least, and time stands still until its samples have come.
 *
 * Following (native_options.follow), ticks begin with the SYNC of somebody else: the time is that of its ticks, LOOP_TICK_US
 * from one to the next, whatever the clock says, and a sample is waited for until then. So a recording
 * (SYNC, encoders, NMT) that is played into the bus at any speed gives the torques of the run it is of. */
#include "native.h"

#include <stdlib.h>
#include <string.h>

#include "backend.h"
#include "bank_format.h"
#include "loop.h"
#include "wire.h"

enum {
    LOOK_US = 100000,     /* how often a wait without end looks whether it should stop */
    PATIENCE_US = 1000000 /* slow: so long a sample is waited for */
};

static struct {
    struct native_options options;
    struct backend *backend;
    uint64_t start_ns;
    bool sampling; /* SYNC was sent, the torques not yet */
    uint32_t
        samples; /* bits of the instruments whose sample has come: following, what is behind the last came after the torque */
    bool have;        /* `next` was taken from the bus, and not yet by the loop */
    bool began;       /* following: the SYNC of this tick has been taken */
    uint64_t tick_us; /* following or slow: the time, that of this tick's begin */
    uint64_t next_ns; /* slow: when the next tick may begin, by the clock */
    struct backend_received next;
    uint64_t ticks;
    struct lateness lateness;
} live;

static bool slow(void)
{
    return live.options.slow > 1;
}

static uint64_t time_us(void)
{
    if (live.options.follow || slow())
        return live.tick_us;
    return (realtime_now_ns() - live.start_ns) / 1000;
}

/* A frame into `next`, waiting so long for it. A bus that went down is said once; the loop goes on without frames. */
static bool fetch(int64_t wait_us)
{
    struct failure why = {0};
    if (live.have)
        return true;
    const int status = backend_receive(live.backend, &live.next, wait_us, &why);
    if (status < 0) {
        failure_print(stderr, &why);
        if (status != STATUS_BUS_DOWN && status != STATUS_BUS_LOST)
            native_stop();
    }
    live.have = status == 1;
    return live.have;
}

static bool is_sync(const struct can_frame_t *frame)
{
    return frame->id == WIRE_SYNC_ID && frame->flags == 0;
}

static bool receive(struct can_frame_t *frame)
{
    if (live.options.follow && live.sampling && live.samples == (1u << live.options.instruments) - 1u)
        return false;
    if (!fetch(0) || (live.options.follow && is_sync(&live.next.frame)))
        return false;
    *frame = live.next.frame;
    const uint32_t t = frame->id - WIRE_ENCODERS_ID - live.options.node;
    if (t < live.options.instruments)
        live.samples |= 1u << t;
    live.have = false;
    return true;
}

static bool transmit(const struct can_frame_t *frame)
{
    struct failure why = {0};
    if (is_sync(frame)) {
        live.sampling = true;
        live.samples = 0;
        live.ticks++;
        if (live.options.follow)
            return true;                                                                           /* another's */
    } else if (frame->id == WIRE_TORQUES_ID + live.options.node + live.options.instruments - 1u) { /* the last */
        live.sampling = false;
        if (live.ticks == live.options.ticks)
            native_stop();
    }
    const int status = backend_send(live.backend, frame, 0, &why);
    if (status < 0)
        failure_print(stderr, &why);
    return status == 1;
}

/* Following: until the SYNC of the next tick, or a frame for the loop. */
static uint64_t wait_for_sync(uint64_t until_us)
{
    while (native_running()) {
        if (!fetch(LOOK_US))
            continue;
        if (!is_sync(&live.next.frame))
            return live.tick_us;
        if (!live.began) { /* of the tick that the loop has begun */
            live.began = true;
            live.have = false;
            continue;
        }
        if (!live.sampling) { /* the torque has gone: this SYNC begins the next tick */
            live.have = false;
            live.tick_us = until_us;
        }
        return until_us; /* else: it ends the wait for a sample, and is met again */
    }
    return until_us;
}

/* Until an absolute time of the clock; false when the controller should stop. */
static bool sleep_until(uint64_t until_ns)
{
    const int64_t late_ns = realtime_sleep(until_ns);
    if (late_ns >= 0)
        lateness_add(&live.lateness, late_ns);
    return native_running();
}

/* Slow: the time stands still until the sample is there. */
static uint64_t wait_slowly(uint64_t until_us)
{
    if (live.sampling)
        return fetch(PATIENCE_US) ? live.tick_us : until_us;
    const uint64_t now_ns = realtime_now_ns();
    live.next_ns += 1000000 * (uint64_t)live.options.slow;
    if (now_ns > live.next_ns)
        live.next_ns = now_ns;
    else
        sleep_until(live.next_ns);
    live.tick_us = until_us;
    return until_us;
}

static uint64_t wait_us(uint64_t until_us)
{
    if (live.options.follow)
        return live.ticks ? wait_for_sync(until_us) : until_us; /* before the first tick: a refusal is let out */
    if (slow())
        return wait_slowly(until_us);
    const uint64_t until_ns = live.start_ns + 1000 * until_us;
    if (live.sampling) {
        const uint64_t now_ns = realtime_now_ns();
        if (now_ns < until_ns)
            fetch((int64_t)((until_ns - now_ns) / 1000 + 1));
        return time_us();
    }
    return sleep_until(until_ns) ? time_us() : until_us;
}

static struct can_errors errors(void)
{
    const struct backend_counters *c = backend_counters(live.backend);
    return (struct can_errors){.receive_overflows = (uint32_t)(c->dropped + c->overflows),
                               .error_passive = (uint32_t)c->passive,
                               .bus_off = (uint32_t)c->bus_off};
}

const struct native_bus live_bus = {time_us, wait_us, receive, transmit, errors};

int live_open(const struct native_options *options)
{
    struct backend_filter wanted[2 + BANK_MAX_INSTRUMENTS] = {{WIRE_NMT_ID, 0x7FF}};
    struct backend_options bus = {.filter = wanted, .filters = 1};
    for (uint32_t t = 0; t < options->instruments; t++) /* bound: BANK_MAX_INSTRUMENTS */
        wanted[bus.filters++] = (struct backend_filter){WIRE_ENCODERS_ID + options->node + t, 0x7FF};
    if (options->follow)
        wanted[bus.filters++] = (struct backend_filter){WIRE_SYNC_ID, 0x7FF};
    struct failure why = {0};
    live.options = *options;
    const int status = backend_open(options->bus, &bus, &live.backend, &why);
    if (status) {
        failure_print(stderr, &why);
        return status_exit_code(status);
    }
    if (!options->follow)
        realtime_enter();
    for (uint32_t t = 0; t < options->instruments; t++) /* bound: BANK_MAX_INSTRUMENTS */
        fprintf(stderr, "controller: node %u is on %s%s\n", options->node + t, options->bus,
                options->follow ? ", and follows its SYNC" : "");
    live.start_ns = live.next_ns = realtime_now_ns();
    return 0;
}

void live_close(FILE *out)
{
    const struct backend_counters *c = backend_counters(live.backend);
    if (!live.options.follow) {
        lateness_print(out, "wake-up lateness", &live.lateness);
        realtime_print(out);
    }
    fprintf(out, "%llu ticks; frames: %llu sent, %llu without room, %llu received, %llu lost\n",
            (unsigned long long)live.ticks, (unsigned long long)c->sent, (unsigned long long)c->no_room,
            (unsigned long long)c->received, (unsigned long long)c->dropped);
    backend_close(live.backend);
}
