/* A CAN bus with one controller on it, the one under test, and everything that can be wrong with it. ISO 11898-1's fault
 * confinement is here; the model of a controller (xilinx_can_model.h, fdcan_model.h) supplies the functions declared below,
 * written from its manual and not from its driver.
 *
 * Time is counted in bits. bus_run lets the controller send what waits; `spoilt` says what becomes of it:
 *
 *   BUS_GOOD      frames go through
 *   BUS_UNHEARD   nobody acknowledges: TEC rises by 8 until error-passive, and stays (12.1.4.2 c, exception 1)
 *   BUS_SHORTED   dominant bits read back as recessive: an error in the first bit; TEC rises by 8 up to bus-off
 *   BUS_BUSY      others always win the arbitration */
#ifndef TROCAR_BUS_MODEL_H
#define TROCAR_BUS_MODEL_H

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "can_frame.h"

#define SIMULATED_REGISTERS
#include "drivers/registers.h"

enum bus_state { BUS_GOOD, BUS_UNHEARD, BUS_SHORTED, BUS_BUSY };

static struct {
    uint64_t bits;
    enum bus_state spoilt;
    bool absent;       /* no controller answers: its registers read 0 */
    unsigned tec, rec; /* ISO 11898-1's counters, before the controller clears them */
    bool passive, off;
    /* what happened, for the tests to compare with */
    unsigned violations; /* what a driver must not do */
    unsigned overflows, passives, bus_offs, attempts, sent_count;
    struct can_frame_t sent[4096];
} bus;

/* The controller takes part in the bus: configured, joined, not off. */
static bool controller_normal(void);
/* The frame that it would send now. */
static bool controller_next(struct can_frame_t *frame);
/* What became of that one. */
static void controller_attempted(bool sent);
/* TEC has passed 255; bus.off is set already. */
static void controller_bus_off(void);
/* So much time has passed. */
static void controller_time(void);
/* A frame of somebody else's: filter and store. */
static void controller_store(const struct can_frame_t *frame);

static inline void bus_confine(void)
{
    if (bus.off)
        return;
    bool passive = bus.tec >= 128 || bus.rec >= 128;
    bus.passives += passive && !bus.passive;
    bus.passive = passive;
    if (bus.tec > 255) {
        bus.off = true;
        bus.passive = false;
        bus.bus_offs++;
        controller_bus_off();
    }
}

static inline void bus_hear(const struct can_frame_t *frame)
{
    if (!controller_normal() || bus.spoilt == BUS_UNHEARD || bus.spoilt == BUS_SHORTED)
        return;
    bus.rec -= bus.rec > 0;
    bus_confine();
    controller_store(frame);
}

/* A frame of somebody else's that this controller, and it alone, sees as damaged. */
static inline void bus_mishear(void)
{
    if (controller_normal() && bus.rec < 248)
        bus.rec += 8;
    bus_confine();
}

static inline void bus_run(unsigned bits)
{
    uint64_t end = bus.bits + bits;
    while (bus.bits < end) {
        struct can_frame_t frame;
        controller_time();
        if (!controller_normal() || bus.spoilt == BUS_BUSY || !controller_next(&frame)) {
            bus.bits++;
            continue;
        }
        unsigned length = 55 + 10 * frame.length; /* with stuffing, at most */
        bus.attempts++;
        if (bus.spoilt == BUS_GOOD) {
            bus.bits += length;
            bus.tec -= bus.tec > 0;
            if (bus.sent_count < sizeof bus.sent / sizeof bus.sent[0])
                bus.sent[bus.sent_count++] = frame;
        } else if (bus.spoilt == BUS_UNHEARD) {
            bus.bits += length + 20; /* and an error frame */
            bus.tec += bus.tec < 128 ? 8 : 0;
        } else {
            bus.bits += 1 + 20 + (bus.passive ? 8 : 0); /* suspended transmission */
            bus.tec += 8;
        }
        controller_attempted(bus.spoilt == BUS_GOOD);
        bus_confine();
    }
}

#endif
