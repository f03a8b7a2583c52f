/* The controller on an emulated board: bus and time in lockstep (../lockstep.h) over two files or pipes that the command
 * line names, the bank at a fixed address.
 *
 * Exit code as the native port's: 0 at the end of the input, 6 when the bank is refused, 2 for a wrong call, 3 when a file
 * cannot be opened; and 10 for a fault. */
#include "hal.h"
#include "loop.h"
#include "ports/lockstep.h"
#include "semihosting.h"
#include "start.h"
#include "status.h"

enum { NODE = 1, COMMAND_LINE = 512, BATCH = 64 };

/* Of an500.ld. */
extern const unsigned char an500_bank[];
extern const uint32_t an500_bank_length[];
extern unsigned char an500_rows[], an500_rows_end[];

static struct lockstep bus;
static bool running = true;
static int32_t in, out;
static struct lockstep_record read_ahead[BATCH], written[BATCH];
static size_t read_first, read_bytes; /* records taken; bytes that are there */
static size_t written_count;

uint64_t hal_time_us(void)
{
    return bus.time_us;
}

const void *hal_bank(size_t *length)
{
    *length = an500_bank_length[0];
    return an500_bank;
}

void *hal_memory(size_t *bytes)
{
    *bytes = (size_t)((uintptr_t)an500_rows_end - (uintptr_t)an500_rows);
    return an500_rows;
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

static bool flush(void)
{
    bool good = written_count == 0 || semihosting_write(out, written, written_count * sizeof written[0]);
    written_count = 0;
    return good;
}

bool hal_can_transmit(const struct can_frame_t *frame)
{
    if (written_count == BATCH && !flush())
        return false;
    written[written_count++] = lockstep_send(frame);
    return true;
}

/* The next record, NULL at the end of the input. */
static const struct lockstep_record *next(void)
{
    unsigned char *bytes = (unsigned char *)read_ahead;
    if (read_bytes / sizeof read_ahead[0] == read_first) { /* what is left is a record that has come in part */
        size_t taken = read_first * sizeof read_ahead[0];
        read_bytes -= taken;
        for (size_t i = 0; i < read_bytes; i++) /* bound: LOCKSTEP_RECORD - 1 */
            bytes[i] = bytes[taken + i];
        read_first = 0;
    }
    while (read_bytes < sizeof read_ahead[0]) { /* bound: LOCKSTEP_RECORD, as each read brings a byte */
        size_t got = semihosting_read(in, bytes + read_bytes, sizeof read_ahead - read_bytes);
        if (got == 0)
            return 0;
        read_bytes += got;
    }
    return &read_ahead[read_first++];
}

uint64_t hal_wait_us(uint64_t until_us)
{
    if (written_count == BATCH)
        running = flush() && running;
    written[written_count++] = (struct lockstep_record){.kind = LOCKSTEP_TIME, .u.time_us = until_us};
    running = flush() && running;
    const struct lockstep_record *r;
    do { /* bound: the peer's batch */
        r = running ? next() : 0;
    } while (r && !lockstep_take(&bus, r));
    if (!r) {
        running = false;
        bus.time_us = until_us; /* let the loop come to its end */
    }
    return bus.time_us;
}

/* "IN OUT" */
static bool open_streams(char *line)
{
    char *second = line;
    while (*second && *second != ' ') /* bound: COMMAND_LINE */
        second++;
    if (!*second || !second[1])
        return false;
    *second++ = 0;
    in = semihosting_open(line, SEMIHOSTING_READ);
    out = semihosting_open(second, SEMIHOSTING_WRITE);
    return true;
}

int controller_main(void)
{
    static char line[COMMAND_LINE];
    if (!semihosting_command_line(line, sizeof line) || !open_streams(line)) {
        semihosting_print("usage: -semihosting-config enable=on,target=native,arg=IN,arg=OUT\n");
        return 2;
    }
    if (in < 0 || out < 0) {
        semihosting_print(in < 0 ? "controller: the input cannot be opened\n"
                                 : "controller: the output cannot be opened\n");
        return 3;
    }
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
