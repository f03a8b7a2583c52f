/* Frames and time in lockstep on standard input and output. */
#include "native.h"
#include "ports/lockstep.h"

static struct lockstep bus;

static uint64_t time_us(void)
{
    return bus.time_us;
}

static bool receive(struct can_frame_t *frame)
{
    return lockstep_receive(&bus, frame);
}

static struct can_errors errors(void)
{
    return (struct can_errors){.receive_overflows = bus.lost};
}

static bool transmit(const struct can_frame_t *frame)
{
    struct lockstep_record r = lockstep_send(frame);
    return fwrite(&r, sizeof r, 1, stdout) == 1;
}

static uint64_t wait_us(uint64_t until_us)
{
    struct lockstep_record r = {.kind = LOCKSTEP_TIME, .u.time_us = until_us};
    if (fwrite(&r, sizeof r, 1, stdout) != 1 || fflush(stdout) != 0)
        native_stop();
    do { /* bound: the peer's batch */
        if (native_running() && fread(&r, sizeof r, 1, stdin) != 1)
            native_stop();
    } while (native_running() && !lockstep_take(&bus, &r));
    if (!native_running())
        bus.time_us = until_us; /* let the loop come to its end */
    return bus.time_us;
}

const struct native_bus stdio_bus = {time_us, wait_us, receive, transmit, errors};
