/* drivers/xilinx_can.c on its model, as driver_cases.h and driver_loop.h want it. */
#ifndef TROCAR_XILINX_CAN_DRIVER_H
#define TROCAR_XILINX_CAN_DRIVER_H

#include "xilinx_can_model.h"

#include "drivers/can_timing.c"
#include "drivers/xilinx_can.c"

#define driver xilinx_can

enum { DRIVER_TRANSMIT = XILINX_CAN_FIFO, DRIVER_RECEIVE = XILINX_CAN_FIFO };

static struct xilinx_can_settings driver_settings = {
    .clock_Hz = 100000000, .bit_rate = 1000000, .filter = {{0x181, 0x7FF}, {0x000, 0x7FF}}};

static bool driver_start(struct driver *d, unsigned filters)
{
    driver_settings.filters = filters;
    return xilinx_can_start(d, (struct xilinx_can_registers *)(void *)model.block, &driver_settings);
}

static void driver_poll(struct driver *d)
{
    xilinx_can_poll(d, bus.bits); /* a bit is a microsecond */
}

#define driver_receive  xilinx_can_receive
#define driver_transmit xilinx_can_transmit
#define driver_urgent   xilinx_can_transmit_urgent

#endif
