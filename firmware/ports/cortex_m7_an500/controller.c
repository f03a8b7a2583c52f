/* The controller on an emulated board: bus and time in lockstep (../lockstep.h) over two files or pipes that the command
 * line names, the bank at a fixed address.
 *
 * Exit code as the native port's: 0 at the end of the input, 6 when the bank is refused, 2 for a wrong call, 3 when a file
 * cannot be opened; and 10 for a fault. */
#include "hal.h"
#include "loop.h"
#include "ports/arm/semihosting.h"
#include "ports/arm/start.h"
#include "ports/arm/streams.h"
#include "status.h"

enum { NODE = 1 };

/* Of an500.ld. */
extern const unsigned char memory_bank[];
extern const uint32_t memory_bank_length[];
extern unsigned char memory_rows[], memory_rows_end[];

static struct lockstep bus;
static bool running = true;

uint64_t hal_time_us(void)
{
    return bus.time_us;
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
    return lockstep_receive(&bus, frame);
}

struct can_errors hal_can_errors(void)
{
    return (struct can_errors){.receive_overflows = bus.lost};
}

bool hal_can_transmit(const struct can_frame_t *frame)
{
    return streams_write(lockstep_send(frame));
}

uint64_t hal_wait_us(uint64_t until_us)
{
    running = streams_write((struct lockstep_record){.kind = LOCKSTEP_TIME, .u.time_us = until_us}) &&
              streams_flush() && running;
    const struct lockstep_record *r;
    do { /* bound: the peer's batch */
        r = running ? streams_next() : 0;
    } while (r && !lockstep_take(&bus, r));
    if (!r) {
        running = false;
        bus.time_us = until_us; /* let the loop come to its end */
    }
    return bus.time_us;
}

int controller_main(void)
{
    int code = streams_open();
    if (code)
        return code;
    int status = loop_run(NODE);
    semihosting_print("controller: stack ");
    semihosting_print_decimal(start_stack_used());
    semihosting_print(" of ");
    semihosting_print_decimal(start_stack_bytes());
    semihosting_print(" bytes used\n");
    if (status != STATUS_OK)
        semihosting_print("controller: the bank was refused; see trocar verify\n");
    return status == STATUS_OK ? 0 : 6;
}
