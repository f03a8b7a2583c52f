/* The controller on an STM32H743: the bus is FDCAN1, the time TIM2, the bank lies in flash bank 2. */
#include "bank_format.h"
#include "board.h"
#include "drivers/fdcan.h"
#include "hal.h"
#include "loop.h"
#include "ports/arm/start.h"
#include "tick.h"
#include "wire.h"

enum { NODE = 1, BIT_RATE = 1000000 };

/* Of stm32h743.ld. */
extern const unsigned char memory_bank[], memory_bank_end[];
extern unsigned char memory_rows[], memory_rows_end[];
extern struct fdcan_registers stm32h743_fdcan1;
extern struct fdcan_memory stm32h743_can_memory;

static struct fdcan can;

/* At least once per 71 minutes, or a turn of the timer is missed. */
uint64_t hal_time_us(void)
{
    static uint32_t last, turns;
    uint32_t now = board_time_us();
    turns += now < last;
    last = now;
    return (uint64_t)turns << 32 | now;
}

uint64_t hal_wait_us(uint64_t until_us)
{
    uint64_t now_us;
    do { /* bound: the time asked for */
        now_us = hal_time_us();
    } while (now_us < until_us && !fdcan_waiting(&can));
    fdcan_poll(&can);
    return now_us;
}

bool hal_can_receive(struct can_frame_t *frame)
{
    return fdcan_receive(&can, frame);
}

bool hal_can_transmit(const struct can_frame_t *frame)
{
    return frame->id == WIRE_TORQUES_ID + NODE ? fdcan_transmit_urgent(&can, frame) : fdcan_transmit(&can, frame);
}

struct can_errors hal_can_errors(void)
{
    return can.errors;
}

/* As long as its header says; what follows it in flash does not belong to it. */
const void *hal_bank(size_t *length)
{
    const struct bank_header *header = (const struct bank_header *)(const void *)memory_bank;
    size_t room = (size_t)((uintptr_t)memory_bank_end - (uintptr_t)memory_bank);
    bool there = header->magic == BANK_MAGIC && header->total_bytes <= room;
    *length = there ? header->total_bytes : 0;
    return there ? memory_bank : 0;
}

void *hal_memory(size_t *bytes)
{
    *bytes = (size_t)((uintptr_t)memory_rows_end - (uintptr_t)memory_rows);
    return memory_rows;
}

/* Asked once a tick: a loop that does not come round is reset. */
bool hal_running(void)
{
    board_watchdog();
    return true;
}

int controller_main(void)
{
    static const struct fdcan_settings settings = {
        .clock_Hz = BOARD_FDCAN_Hz,
        .bit_rate = BIT_RATE,
        .filters = 1 + TICK_INSTRUMENTS,
        .filter = {{WIRE_NMT_ID, 0x7FF}, {WIRE_ENCODERS_ID + NODE, 0x7FF}, {WIRE_ENCODERS_ID + NODE + 1, 0x7FF}},
    };
    if (!board_start() || !fdcan_start(&can, &stm32h743_fdcan1, &stm32h743_can_memory, &settings))
        return 11;
    return loop_run(NODE);
}
