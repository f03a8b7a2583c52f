/* The host's end of the bus, on a Cortex-A53 of the same chip: CAN controller 1 is on one bus with the R5F's controller 0, and
 * the frames pass between it and two files or pipes of the host's (../../lockstep.h) that the command line names, read and
 * written by semihosting. The time goes by the mailbox.
 *
 * Ends the emulation itself only when it cannot start: 2 for a wrong call, 3 when a file cannot be opened, 11 when its CAN
 * controller does not start, 12 when the R5F does not. */
#include "../mailbox.h"
#include "drivers/xilinx_can.h"
#include "ports/arm/semihosting.h"
#include "ports/arm/streams.h"

#define CAN1 ((struct xilinx_can_registers *)0xFF070000u)

enum { R5_NUMBER = 4, R5_ENTRY = 0 };

long bridge_power_on(long processor, long entry);
void bridge_main(void);

static struct xilinx_can can;

static void fail(const char *what, int code)
{
    semihosting_print(what);
    semihosting_exit(code);
}

static void write(struct lockstep_record record)
{
    if (!streams_write(record))
        fail("bridge: the output cannot be written\n", 3);
}

/* Frames of the R5F's to the host. */
static void forward(void)
{
    struct can_frame_t frame;
    while (xilinx_can_receive(&can, &frame)) /* bound: XILINX_CAN_FIFO, as the R5F waits meanwhile */
        write(lockstep_send(&frame));
}

/* One request of the R5F's. */
static void serve(struct mailbox *m)
{
    forward();
    write((struct lockstep_record){.kind = LOCKSTEP_TIME, .u.time_us = m->until_us});
    if (!streams_flush())
        fail("bridge: the output cannot be written\n", 3);
    const struct lockstep_record *r;
    while ((r = m->ended ? 0 : streams_next()) && r->kind != LOCKSTEP_TIME) { /* bound: the host's batch */
        struct can_frame_t frame = {.id = r->id, .length = r->length, .flags = r->flags};
        for (uint32_t i = 0; i < sizeof r->u.data; i++) /* bound: 8 */
            frame.data[i] = r->u.data[i];
        if (!xilinx_can_transmit(&can, &frame))
            fail("bridge: a frame does not go onto the bus\n", 11);
    }
    if (r)
        m->time_us = r->u.time_us;
    else { /* let the loop come to its end */
        m->time_us = m->until_us;
        m->ended = 1;
    }
}

void bridge_main(void)
{
    static const struct xilinx_can_settings settings = {.clock_Hz = 100000000, .bit_rate = 1000000};
    struct mailbox *m = (struct mailbox *)MAILBOX_ADDRESS;
    int code = streams_open();
    if (code)
        semihosting_exit(code);
    if (!xilinx_can_start(&can, CAN1, &settings))
        fail("bridge: CAN controller 1 does not start\n", 11);
    if (bridge_power_on(R5_NUMBER, R5_ENTRY) != 0)
        fail("bridge: the R5F does not start\n", 12);
    for (;;) {                         /* bound: none; the R5F ends the emulation */
        while (m->asked == m->granted) /* bound: the R5F's tick */
            __asm__ volatile("yield");
        __asm__ volatile("dmb sy" ::: "memory");
        uint32_t asked = m->asked;
        serve(m);
        __asm__ volatile("dmb sy" ::: "memory");
        m->granted = asked;
    }
}
