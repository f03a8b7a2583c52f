/* A board that has nothing: compiles and links anywhere, hears no frame, sends none, and has no bank. The starting point
 * of a new port: copy the folder, and fill each function from the board's reference manual. README.md says how. */
#include "hal.h"
#include "loop.h"

static uint64_t time_us;

/* A free-running timer of 1 MHz; extend 32 bits to 64 by counting its overflows. */
uint64_t hal_time_us(void)
{
    return time_us;
}

/* Sleep until the timer's compare or the CAN receive interrupt (WFI), and return the time. */
uint64_t hal_wait_us(uint64_t until_us)
{
    if (until_us > time_us)
        time_us = until_us;
    return time_us;
}

/* The oldest frame of the receive FIFO that the acceptance filter lets through: Encoders of this node (and, of two
 * instruments, the next), and NMT. */
bool hal_can_receive(struct can_frame_t *frame)
{
    (void)frame;
    return false;
}

/* The next free transmit mailbox, in order of identifiers (or FIFO order): SYNC and torque must not wait behind telemetry. */
bool hal_can_transmit(const struct can_frame_t *frame)
{
    (void)frame;
    return true;
}

/* Of the driver: receive overflows, entries into error-passive and bus-off, from which it comes back by itself. */
struct can_errors hal_can_errors(void)
{
    return (struct can_errors){0};
}

/* The flash region that the linker script keeps for the bank. */
const void *hal_bank(size_t *length)
{
    *length = 0;
    return 0;
}

/* What is left of the RAM; README.md says how much a bank needs. */
void *hal_memory(size_t *bytes)
{
    *bytes = 0;
    return 0;
}

bool hal_running(void)
{
    return time_us < 1000000; /* a board returns true */
}

/* Reached from the start-up code once stack, data, clocks and the FPU are set. */
int blank_main(void);
int blank_main(void)
{
    return loop_run(1);
}
