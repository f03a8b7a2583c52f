/* The controller on the Cortex-R5F of a Zynq UltraScale+: the bus is CAN controller 0, by its registers; the time comes from
 * the bridge (mailbox.h); the bank is at a fixed address.
 *
 * Exit code as the native port's: 0 at the end of the input, 6 when the bank is refused; 2 and 3 come from the bridge; 10 for
 * a fault, 11 when the CAN controller does not start. */
#include "drivers/xilinx_can.h"
#include "hal.h"
#include "loop.h"
#include "mailbox.h"
#include "ports/arm/semihosting.h"
#include "ports/arm/start.h"
#include "status.h"
#include "tick.h"
#include "wire.h"

enum { NODE = 1, CAN_REF_CLK_Hz = 100000000, BIT_RATE = 1000000 };

/* Of zcu102.ld. */
extern const unsigned char memory_bank[];
extern const uint32_t memory_bank_length[];
extern unsigned char memory_rows[], memory_rows_end[];
extern struct xilinx_can_registers zcu102_can0;
extern struct mailbox zcu102_mailbox;

static struct xilinx_can can;
static uint64_t time_us;
static bool running = true;
static uint32_t received, sent, refused;

uint64_t hal_time_us(void)
{
    return time_us;
}

const void *hal_bank(size_t *length)
{
    *length = memory_bank_length[0];
    return memory_bank;
}

void *hal_memory(size_t *bytes)
{
    *bytes = (size_t)((uintptr_t)memory_rows_end - (uintptr_t)memory_rows);
    return memory_rows;
}

bool hal_running(void)
{
    return running;
}

bool hal_can_receive(struct can_frame_t *frame)
{
    bool got = xilinx_can_receive(&can, frame);
    received += got;
    return got;
}

/* A torque must not be sent late: it goes by the buffer from which an older one can be taken back. */
bool hal_can_transmit(const struct can_frame_t *frame)
{
    bool good = frame->id == WIRE_TORQUES_ID + NODE ? xilinx_can_transmit_urgent(&can, frame)
                                                    : xilinx_can_transmit(&can, frame);
    sent += good;
    refused += !good;
    return good;
}

struct can_errors hal_can_errors(void)
{
    return can.errors;
}

uint64_t hal_wait_us(uint64_t until_us)
{
    struct mailbox *m = &zcu102_mailbox;
    m->until_us = until_us;
    __asm__ volatile("dmb" ::: "memory");
    uint32_t number = m->asked + 1u;
    m->asked = number;
    while (m->granted != number) /* bound: the host's */
        __asm__ volatile("yield");
    __asm__ volatile("dmb" ::: "memory");
    time_us = m->time_us > time_us ? m->time_us : time_us;
    running = running && !m->ended;
    xilinx_can_poll(&can, time_us);
    return time_us;
}

static void print_number(const char *what, uint32_t number)
{
    semihosting_print(what);
    semihosting_print_decimal(number);
}

int controller_main(void)
{
    static const struct xilinx_can_settings settings = {
        .clock_Hz = CAN_REF_CLK_Hz,
        .bit_rate = BIT_RATE,
        .filters = 1 + TICK_INSTRUMENTS,
        .filter = {{WIRE_NMT_ID, 0x7FF}, {WIRE_ENCODERS_ID + NODE, 0x7FF}, {WIRE_ENCODERS_ID + NODE + 1, 0x7FF}},
    };
    if (!xilinx_can_start(&can, &zcu102_can0, &settings)) {
        semihosting_print("controller: the CAN controller does not start\n");
        return 11;
    }
    int status = loop_run(NODE);
    print_number("controller: stack ", start_stack_used());
    print_number(" of ", start_stack_bytes());
    print_number(" bytes used; frames: received ", received);
    print_number(", sent ", sent);
    print_number(", refused ", refused);
    print_number(", overflows ", can.errors.receive_overflows);
    semihosting_print("\n");
    if (status != STATUS_OK)
        semihosting_print("controller: the bank was refused; see trocar verify\n");
    return status == STATUS_OK ? 0 : 6;
}
