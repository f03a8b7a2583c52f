/* trocar record: the frames of a bus as a candump log. */
#include <getopt.h>
#include <json-c/json.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"
#include "progress.h"
#include "recording.h"
#include "source_option.h"

static const char usage[] =
    "usage: trocar record SCENE.yaml|BANK -o LOG [options]\n"
    "       trocar record --bus socketcan:IF|slcan:TTY -o LOG [options]\n"
    "\n"
    "Writes every frame of a bus as a log of can-utils (candump -l, canplayer): of a real bus until Ctrl-C, or of a\n"
    "simulated session, as fast as it goes. The log is whole lines at any moment. `trocar replay` runs it through the\n"
    "controller; for a long one give a gesture file that ends with \"repeat N\" (trocar run --print-gesture tour).\n"
    "\n"
    "  -o, --output LOG     the file; - is standard output. A file that exists is not overwritten\n"
    "      --append         go on with a log that exists\n"
    "      --errors         also error frames\n"
    "      --json           one JSON object on stdout\n" SOURCE_USAGE;

struct request {
    struct source_request source;
    const char *output;
    bool append, json;
};

static int parse(struct request *r, int argc, char **argv, bool *done, struct failure *why)
{
    static const struct option longs[] = {{"output", required_argument, NULL, 'o'},
                                          {"append", no_argument, NULL, 'a'},
                                          {"errors", no_argument, NULL, 'e'},
                                          {"json", no_argument, NULL, 'j'},
                                          {"help", no_argument, NULL, 'h'},
                                          SOURCE_LONG_OPTIONS,
                                          {0}};
    opterr = 0;
    optind = 0; /* GNU: start over */
    for (int answer; (answer = getopt_long(argc, argv, ":ho:g:n:", longs, NULL)) != -1;) {
        const int taken = source_option(&r->source, answer, optarg, why);
        if (taken < 0)
            return taken;
        if (taken)
            continue;
        switch (answer) {
        case 'o':
            r->output = optarg;
            break;
        case 'a':
            r->append = true;
            break;
        case 'e':
            r->source.options.errors = true;
            break;
        case 'j':
            r->json = true;
            break;
        case 'h':
            fputs(usage, stdout);
            *done = true;
            return STATUS_OK;
        default:
            return cli_bad_option("record", answer, argv, why);
        }
    }
    const bool simulated = source_simulated(&r->source);
    if (argc - optind != (simulated ? 1 : 0))
        return failure_set(why, STATUS_USAGE, NULL, "see trocar record --help", "%s",
                           simulated ? "record takes one scene or bank, or --bus"
                                     : "a bus needs no scene to be recorded");
    if (!r->output)
        return failure_set(why, STATUS_USAGE, NULL, "say -o LOG", "where to write is not given");
    if (r->json && !strcmp(r->output, "-"))
        return failure_set(why, STATUS_USAGE, NULL, "leave out --json, or name a file",
                           "the log and the object cannot both go to standard output");
    r->source.path = argv[optind];
    return STATUS_OK;
}

static int listen(struct request *r, struct frame_source *source, struct recording *recording, struct failure *why)
{
    const double end_s = seconds_now() + (double)r->source.seconds;
    const char *interface = frame_source_interface(source);
    const bool simulated = source_simulated(&r->source);
    struct backend_received received;
    int status = STATUS_OK;
    while (!status && !interrupted() && (r->source.seconds == 0 || simulated || seconds_now() < end_s)) {
        const int answer = frame_source_next(source, &received, 1000 * RECORDING_FLUSH_MS, why);
        if (answer == FRAME_SOURCE_END)
            break;
        if (answer == FRAME_SOURCE_FRAME)
            status = recording_frame(recording, interface, &received.frame, received.time_us, why);
        else if (answer == FRAME_SOURCE_NONE)
            status = simulated ? STATUS_OK : recording_flush(recording, why);
        else if (answer == STATUS_BUS_DOWN || answer == STATUS_BUS_LOST)
            failure_print(stderr, why); /* told once; it may come back */
        else
            status = answer;
    }
    return status;
}

static int report(const struct request *r, const struct frame_source *source, const struct recording *recording,
                  struct failure *why)
{
    const struct backend_counters *c = frame_source_counters(source);
    const uint64_t lost = c ? c->dropped : 0;
    if (r->json) {
        struct json_object *root = json_object_new_object();
        json_object_object_add(root, "output", json_object_new_string(r->output));
        json_object_object_add(root, "frames", json_object_new_int64((int64_t)recording->frames));
        json_object_object_add(root, "bytes", json_object_new_int64((int64_t)recording->bytes));
        json_object_object_add(root, "lost", json_object_new_int64((int64_t)lost));
        puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED));
        json_object_put(root);
    } else {
        fprintf(stderr, "%llu frames, %llu bytes in %s\n", (unsigned long long)recording->frames,
                (unsigned long long)recording->bytes, r->output);
    }
    if (lost)
        return failure_set(why, STATUS_BUS_LOST, r->output, "run it on a quieter machine, or with real-time priority",
                           "%llu frames came while the receive buffer was full; they are not in the recording",
                           (unsigned long long)lost);
    return STATUS_OK;
}

int verb_record(int argc, char **argv, struct failure *why)
{
    struct request *r = calloc(1, sizeof *r);
    struct recording *recording = malloc(sizeof *recording);
    struct frame_source *source = NULL;
    bool done = false;
    int status = r && recording ? STATUS_OK : failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to record");
    if (!status) {
        source_request_start(&r->source);
        status = parse(r, argc, argv, &done, why);
    }
    if (!status && !done) {
        if (source_simulated(&r->source) && r->source.seconds && !r->source.options.session.ticks)
            r->source.options.session.ticks = 1000 * r->source.seconds;
        status = source_open(&r->source, &source, why);
        if (!status)
            status = recording_open(recording, r->output, r->append, why);
        if (!status) {
            status = listen(r, source, recording, why);
            struct failure closing = {0};
            const int closed = recording_close(recording, status ? &closing : why);
            status = status ? status : closed;
            if (!status)
                status = report(r, source, recording, why);
        }
        source_close(&r->source, source);
    }
    free(recording);
    free(r);
    return status;
}
