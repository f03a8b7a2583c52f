/* drivers/fdcan.c on its model, as driver_cases.h and driver_loop.h want it. */
#ifndef TROCAR_FDCAN_DRIVER_H
#define TROCAR_FDCAN_DRIVER_H

#include "fdcan_model.h"

#include "drivers/can_timing.c"
#include "drivers/fdcan.c"

#define driver fdcan

enum { DRIVER_TRANSMIT = FDCAN_TRANSMIT, DRIVER_RECEIVE = FDCAN_RECEIVE };

static struct fdcan_settings driver_settings = {
    .clock_Hz = 80000000, .bit_rate = 1000000, .memory_word = MODEL_OFFSET, .filter = {{0x181, 0x7FF}, {0x000, 0x7FF}}};

static bool driver_start(struct driver *d, unsigned filters)
{
    driver_settings.filters = filters;
    return fdcan_start(d, (struct fdcan_registers *)(void *)model.block,
                       (struct fdcan_memory *)(void *)(model.ram + MODEL_OFFSET), &driver_settings);
}

#define driver_poll     fdcan_poll
#define driver_receive  fdcan_receive
#define driver_transmit fdcan_transmit
#define driver_urgent   fdcan_transmit_urgent

#endif
