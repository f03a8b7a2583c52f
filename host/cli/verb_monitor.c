/* trocar monitor: a bus as it lives, decoded. */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include "candump.h"
#include "cli.h"
#include "decode.h"
#include "monitor.h"
#include "progress.h"
#include "source_option.h"
#include "wire_dbc.h"

static const char usage[] =
    "usage: trocar monitor SCENE.yaml|BANK [options]\n"
    "       trocar monitor [BANK] --bus socketcan:IF|slcan:TTY [options]\n"
    "\n"
    "Shows what passes on a bus: frames and rates by identifier, decoded by the protocol; the load; what each "
    "controller\n"
    "says of its health. With a bank at hand it computes the torques itself and says whether they agree. On a terminal "
    "a\n"
    "table that is kept up to date, elsewhere a line per second. Without hardware it shows a simulated session.\n"
    "\n"
    "      --lines          lines also on a terminal\n"
    "      --frames         a line for every frame, decoded\n"
    "      --json           JSON, an object in a line: a summary per second, or with --frames every frame\n"
    "      --every MS       between two lines (default 1000; of the table 250)\n"
    "      --bit-rate N     of the bus, for its load (default 1000000)\n"
    "      --fast           a simulated session as fast as it goes, not in real time\n" SOURCE_USAGE;

struct request {
    struct source_request source;
    bool lines, frames, json;
    uint64_t every_ms, bit_rate;
};

static int parse(struct request *r, int argc, char **argv, bool *done, struct failure *why)
{
    static const struct option longs[] = {{"lines", no_argument, NULL, 'l'},
                                          {"frames", no_argument, NULL, 'f'},
                                          {"json", no_argument, NULL, 'j'},
                                          {"every", required_argument, NULL, 'e'},
                                          {"bit-rate", required_argument, NULL, 'b'},
                                          {"fast", no_argument, NULL, 'q'},
                                          {"help", no_argument, NULL, 'h'},
                                          SOURCE_LONG_OPTIONS,
                                          {0}};
    int status = STATUS_OK;
    r->bit_rate = 1000000;
    r->source.options.session.realtime = true;
    r->source.options.errors = true;
    opterr = 0;
    optind = 0; /* GNU: start over */
    for (int answer; !status && (answer = getopt_long(argc, argv, ":hg:n:", longs, NULL)) != -1;) {
        status = source_option(&r->source, answer, optarg, why);
        if (status > 0) {
            status = STATUS_OK;
            continue;
        }
        if (status < 0)
            return status;
        switch (answer) {
        case 'l':
            r->lines = true;
            break;
        case 'f':
            r->frames = true;
            break;
        case 'j':
            r->json = true;
            break;
        case 'e':
            status = cli_whole("--every", optarg, 10, 3600000, &r->every_ms, why);
            break;
        case 'b':
            status = cli_whole("--bit-rate", optarg, 10000, 1000000, &r->bit_rate, why);
            break;
        case 'q':
            r->source.options.session.realtime = false;
            break;
        case 'h':
            fputs(usage, stdout);
            *done = true;
            return STATUS_OK;
        default:
            status = cli_bad_option("monitor", answer, argv, why);
        }
    }
    if (status)
        return status;
    if (argc - optind > 1 || (argc == optind && source_simulated(&r->source)))
        return failure_set(why, STATUS_USAGE, NULL, "see trocar monitor --help",
                           "monitor takes one scene or bank, or --bus");
    r->source.path = argv[optind];
    return STATUS_OK;
}

struct screen {
    const struct request *request;
    bool table;
    uint64_t every_us;
    struct monitor *monitor;
};

static void put_json(struct json_object *object)
{
    puts(json_object_to_json_string_ext(object, JSON_C_TO_STRING_PLAIN));
    json_object_put(object);
}

static void show_window(const struct screen *screen)
{
    struct winsize size = {0};
    if (!monitor_window(screen->monitor))
        return;
    if (screen->table) {
        if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col < 20)
            size.ws_col = 100;
        monitor_table(stdout, screen->monitor, size.ws_col);
    } else if (screen->request->json) {
        put_json(monitor_json(screen->monitor));
        fflush(stdout);
    } else {
        monitor_line(stdout, screen->monitor);
    }
}

static void show_frame(const struct screen *screen, const struct backend_received *received, const char *interface)
{
    char text[DECODE_TEXT], line[CANDUMP_LINE];
    if (screen->request->json) {
        put_json(decode_json(screen->monitor->dbc, &received->frame, received->time_us));
        return;
    }
    const size_t n = candump_format(line, interface, &received->frame, received->time_us);
    decode_text(screen->monitor->dbc, &received->frame, text);
    printf("%.*s  %s\n", (int)(n - 1), line, text);
}

static uint64_t wall_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return (uint64_t)now.tv_sec * 1000000 + (uint64_t)now.tv_nsec / 1000;
}

static int watch(const struct screen *screen, struct frame_source *source, struct failure *why)
{
    const struct request *r = screen->request;
    const char *interface = frame_source_interface(source);
    const bool simulated = frame_source_session(source) != NULL;
    struct monitor *monitor = screen->monitor;
    struct backend_received received;
    for (bool more = true; more && !interrupted() && !ferror(stdout);) {
        const int answer = frame_source_next(source, &received, 50000, why);
        if (answer == FRAME_SOURCE_FRAME) {
            if (r->frames)
                show_frame(screen, &received, interface);
            monitor_receive(monitor, &received.frame, received.time_us);
        } else if (answer == FRAME_SOURCE_NONE && !simulated) {
            monitor_idle(monitor, wall_us());
        } else if (answer == STATUS_BUS_DOWN || answer == STATUS_BUS_LOST) {
            failure_print(stderr, why); /* told once; it may come back */
        } else if (answer < 0) {
            return answer;
        }
        more = answer != FRAME_SOURCE_END &&
               (r->source.seconds == 0 || monitor->now_us - monitor->first_us < 1000000 * r->source.seconds);
        if (!r->frames && monitor->now_us - monitor->window_us >= screen->every_us)
            show_window(screen);
    }
    if (!r->frames && (monitor->now_us - monitor->window_us > screen->every_us / 10 || monitor->window_us == 0))
        show_window(screen);
    if (ferror(stdout))
        return failure_set(why, STATUS_FILE_WRITE, "stdout", NULL, "cannot write: %s", strerror(errno));
    return STATUS_OK;
}

static int start(struct request *r, struct monitor *monitor, struct mirror *mirror, struct dbc *dbc,
                 struct failure *why)
{
    struct frame_source *source = NULL;
    struct screen screen = {.request = r, .monitor = monitor};
    int status = source_open(&r->source, &source, why);
    const bool bank = r->source.bank_open;
    if (!status && bank)
        status = mirror_open(mirror, &r->source.bank.view, SESSION_NODE, why);
    if (!status) {
        screen.table = isatty(STDOUT_FILENO) && !r->lines && !r->frames && !r->json;
        screen.every_us = 1000 * (r->every_ms ? r->every_ms : screen.table ? 250 : 1000);
        monitor_start(monitor, dbc, (double)r->bit_rate, bank ? mirror : NULL);
        if (screen.table)
            fputs("\033[2J", stdout);
        status = watch(&screen, source, why);
    }
    mirror_close(mirror);
    source_close(&r->source, source);
    return status;
}

int verb_monitor(int argc, char **argv, struct failure *why)
{
    struct request *r = calloc(1, sizeof *r);
    struct monitor *monitor = calloc(1, sizeof *monitor);
    struct mirror *mirror = calloc(1, sizeof *mirror);
    struct dbc *dbc = NULL;
    bool done = false;
    int status = STATUS_OK;
    if (!r || !monitor || !mirror)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to listen");
    if (!status) {
        source_request_start(&r->source);
        status = parse(r, argc, argv, &done, why);
    }
    if (!status && !done) {
        status = wire_dbc(&dbc, why);
        if (!status)
            status = start(r, monitor, mirror, dbc, why);
        dbc_free(dbc);
    }
    free(mirror);
    free(monitor);
    free(r);
    return status;
}
