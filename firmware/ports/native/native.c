/* The controller as a process: the bank is a file, the bus one of this machine, or standard input and output in lockstep. */
#include <getopt.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "hal.h"
#include "loop.h"
#include "bank_view.h"
#include "native.h"
#include "status.h"

static const char usage[] =
    "usage: controller.elf BANK [NODE] [options]\n"
    "       controller.elf --bare SECONDS\n\n"
    "The controller of a bank. Its first instrument is node NODE of the bus (1 to 126, default 1), a second one the "
    "next.\n"
    "Without --bus: frames and time in lockstep on standard input and output, as firmware/ports/lockstep.h has it.\n\n"
    "      --bus B      socketcan:IF or slcan:TTY, in real time: SCHED_FIFO, memory locked, where that is allowed\n"
    "      --follow     ticks begin with the SYNC that somebody else sends, a recording\n"
    "      --slow N     for machines that are too slow: a tick takes N milliseconds at least, and waits for its "
    "sample\n"
    "  -n, --ticks N    end after N ticks (default: on Ctrl-C)\n"
    "      --bare S     no controller: how late this machine wakes a thread that asks for every millisecond, S seconds "
    "long\n\n"
    "At the end, on stderr: how late the ticks began (maximum, 99.9 %, mean), and what was lost.\n"
    "Exit code 0 at the end, 2 for a wrong call, 3 no bank, 6 the bank is refused, 8 the bus cannot be opened.\n";

static const void *bank;
static size_t bank_length;
static const struct native_bus *bus = &stdio_bus;
static volatile sig_atomic_t stopped;

bool native_running(void)
{
    return !stopped;
}

void native_stop(void)
{
    stopped = 1;
}

/* ---- hal.h ---- */

uint64_t hal_time_us(void)
{
    return bus->time_us();
}

uint64_t hal_wait_us(uint64_t until_us)
{
    return bus->wait_us(until_us);
}

bool hal_can_receive(struct can_frame_t *frame)
{
    return bus->receive(frame);
}

bool hal_can_transmit(const struct can_frame_t *frame)
{
    return bus->transmit(frame);
}

struct can_errors hal_can_errors(void)
{
    return bus->errors();
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
    return native_running();
}

/* ---- start ---- */

static bool load(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file)
        return false;
    long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : 0;
    rewind(file);
    void *bytes = size > 0 ? aligned_alloc(64, ((size_t)size + 63) / 64 * 64) : NULL;
    bool good = bytes && fread(bytes, 1, (size_t)size, file) == (size_t)size;
    fclose(file);
    bank = bytes;
    bank_length = good ? (size_t)size : 0;
    return good;
}

/* How many nodes of the bus are its own; of a bank that will be refused, 1. */
static uint32_t instruments(void)
{
    struct bank_view view;
    return bank_view_open(&view, bank, bank_length) == STATUS_OK ? view.tool_count : 1;
}

static void name_lacking_effects(void)
{
    struct bank_view view;
    bank_view_open(&view, bank, bank_length);
#define EFFECT(bit, NAME, name, tag, parts, what)                                                                      \
    if (view.fault_record & EFFECT_##NAME)                                                                             \
        fputs("controller: this image lacks the effect " #name "; build the scene's own with make firmware\n", stderr);
#include "effects.def"
#undef EFFECT
}

static void stop(int signal)
{
    (void)signal;
    native_stop();
}

static bool whole(const char *text, long low, long high, long *value)
{
    char *end;
    *value = strtol(text, &end, 10);
    return end != text && !*end && *value >= low && *value <= high;
}

static bool parse(int argc, char **argv, struct native_options *o, long *bare)
{
    enum { BUS = 256, FOLLOW, SLOW, BARE };
    static const struct option longs[] = {
        {"bus", required_argument, NULL, BUS},   {"follow", no_argument, NULL, FOLLOW},
        {"slow", required_argument, NULL, SLOW}, {"ticks", required_argument, NULL, 'n'},
        {"bare", required_argument, NULL, BARE}, {NULL, 0, NULL, 0}};
    long n = 1, slow = 1, ticks = 0;
    bool good = true;
    for (int c; good && (c = getopt_long(argc, argv, "n:", longs, NULL)) != -1;) /* bound: argc */
        switch (c) {
        case BUS:
            o->bus = optarg;
            break;
        case FOLLOW:
            o->follow = true;
            break;
        case SLOW:
            good = whole(optarg, 1, 10000, &slow);
            break;
        case 'n':
            good = whole(optarg, 1, 1000000000, &ticks);
            break;
        case BARE:
            good = whole(optarg, 1, 3600, bare);
            break;
        default:
            good = false;
        }
    if (good && *bare == 0 && optind < argc)
        o->bank = argv[optind++];
    if (good && optind < argc)
        good = whole(argv[optind++], 1, LOOP_MAX_NODE, &n);
    o->node = (uint8_t)n;
    o->slow = (uint32_t)slow;
    o->ticks = (uint64_t)ticks;
    return good && optind == argc && (o->bank || *bare) && (o->bus || (!o->follow && slow == 1 && ticks == 0));
}

static int bare_run(long seconds)
{
    static struct lateness lateness;
    realtime_enter();
    realtime_bare((uint32_t)seconds, &lateness);
    lateness_print(stdout, "wake-up lateness without work", &lateness);
    realtime_print(stdout);
    return 0;
}

int main(int argc, char **argv)
{
    struct native_options options = {0};
    long bare = 0;
    if (!parse(argc, argv, &options, &bare)) {
        fputs(usage, stderr);
        return 2;
    }
    const struct sigaction on_stop = {.sa_handler = stop}; /* no SA_RESTART: what waits shall wake */
    sigaction(SIGINT, &on_stop, NULL);
    sigaction(SIGTERM, &on_stop, NULL);
    if (bare)
        return bare_run(bare);
    if (!load(options.bank)) {
        fprintf(stderr, "controller: %s: cannot read the bank; check the path\n", options.bank);
        return 3;
    }
    options.instruments = instruments();
    if (options.bus) {
        const int code = live_open(&options);
        if (code)
            return code;
        bus = &live_bus;
    }
    int status = loop_run(options.node);
    if (options.bus)
        live_close(stderr);
    if (status != STATUS_OK)
        fprintf(stderr, "controller: %s: the bank was refused (status %d); see trocar verify\n", options.bank, status);
    if (status == STATUS_BANK_EFFECT)
        name_lacking_effects();
    return status == STATUS_OK ? 0 : 6;
}
