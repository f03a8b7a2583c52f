/* The controller as a process: the bank is a file, the bus is standard input and output in lockstep (../lockstep.h).
 *
 *   controller.elf BANK [NODE]     exit code 0 at the end of the input, 6 when the bank is refused, 2 for a wrong call */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal.h"
#include "loop.h"
#include "ports/lockstep.h"
#include "status.h"

static const void *bank;
static size_t bank_length;
static bool running = true;
static struct lockstep bus;

uint64_t hal_time_us(void)
{
    return bus.time_us;
}

const void *hal_bank(size_t *length)
{
    *length = bank_length;
    return bank;
}

void *hal_memory(size_t *bytes)
{
    static uint64_t memory[(4u << 20) / 8]; /* 4 MiB: rows of up to 4400 blocks */
    *bytes = sizeof memory;
    return memory;
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
    struct lockstep_record r = lockstep_send(frame);
    return fwrite(&r, sizeof r, 1, stdout) == 1;
}

uint64_t hal_wait_us(uint64_t until_us)
{
    struct lockstep_record r = {.kind = LOCKSTEP_TIME, .u.time_us = until_us};
    if (fwrite(&r, sizeof r, 1, stdout) != 1 || fflush(stdout) != 0)
        running = false;
    do { /* bound: the peer's batch */
        if (running && fread(&r, sizeof r, 1, stdin) != 1)
            running = false;
    } while (running && !lockstep_take(&bus, &r));
    if (!running)
        bus.time_us = until_us; /* let the loop come to its end */
    return bus.time_us;
}

static bool load(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END) != 0)
        return false;
    long size = ftell(file);
    rewind(file);
    void *bytes = size > 0 ? aligned_alloc(64, ((size_t)size + 63) / 64 * 64) : NULL;
    bool good = bytes && fread(bytes, 1, (size_t)size, file) == (size_t)size;
    fclose(file);
    bank = bytes;
    bank_length = good ? (size_t)size : 0;
    return good;
}

int main(int argc, char **argv)
{
    long node = argc > 2 ? strtol(argv[2], NULL, 10) : 1;
    if (argc < 2 || node < 1 || node > 126) {
        fputs("usage: controller.elf BANK [NODE 1..126]\n", stderr);
        return 2;
    }
    if (!load(argv[1])) {
        fprintf(stderr, "controller: %s: cannot read the bank; check the path\n", argv[1]);
        return 3;
    }
    int status = loop_run((uint8_t)node);
    if (status != STATUS_OK)
        fprintf(stderr, "controller: %s: the bank was refused (status %d); see trocar verify\n", argv[1], status);
    return status == STATUS_OK ? 0 : 6;
}
