/* trocar replay LOG: a recording through the controller, its torques compared byte for byte. */
#include <errno.h>
#include <getopt.h>
#include <json-c/json.h>
#include <stdio.h>
#include <string.h>

#include "cli.h"
#include "decode.h"
#include "open_bank.h"
#include "progress.h"
#include "replay_bus.h"
#include "wire.h"

#define SILENCE_s 3.0 /* without SYNC for so long, there is no controller */

static const char usage[] =
    "usage: trocar replay LOG --bank BANK|SCENE.yaml [options]\n"
    "       trocar replay LOG --bus socketcan:IF|slcan:TTY [options]\n"
    "\n"
    "Gives the frames of a recording (candump's format) to the controller, in this process, and compares its torque\n"
    "frames with those of the recording byte for byte, and its state with the hashes in Health.\n"
    "With --bus the controller is one on a bus, just started, and the recording stands in for its device: at every "
    "SYNC it\n"
    "gets the next tick's frames.\n"
    "\n"
    "      --bank FILE         the bank that the controller had; of a scene it is built\n"
    "      --bus NAME          the bus with the controller; no bank is needed\n"
    "      --node N            of the controller's first instrument (default: the lowest of the first frames)\n"
    "      --interface NAME    only frames of this interface (default: the first line's)\n"
    "      --json              one JSON object on stdout\n"
    "\n"
    "Exit code 12: a torque frame or hash differs; the message names the first one's line.\n";

struct request {
    const char *log, *bank_path, *bus;
    struct replay_options options;
    bool json;
};

static int parse(struct request *r, int argc, char **argv, bool *done, struct failure *why)
{
    static const struct option longs[] = {{"bank", required_argument, NULL, 'b'},
                                          {"bus", required_argument, NULL, 'B'},
                                          {"node", required_argument, NULL, 'n'},
                                          {"interface", required_argument, NULL, 'f'},
                                          {"json", no_argument, NULL, 'j'},
                                          {"help", no_argument, NULL, 'h'},
                                          {0}};
    uint64_t n = 0;
    int status = STATUS_OK;
    opterr = 0;
    optind = 0; /* GNU: start over */
    for (int answer; !status && (answer = getopt_long(argc, argv, ":h", longs, NULL)) != -1;)
        switch (answer) {
        case 'b':
            r->bank_path = optarg;
            break;
        case 'B':
            r->bus = optarg;
            break;
        case 'n':
            status = cli_whole("--node", optarg, 1, 126, &n, why);
            r->options.node = (unsigned)n;
            break;
        case 'f':
            r->options.interface = optarg;
            break;
        case 'j':
            r->json = true;
            break;
        case 'h':
            fputs(usage, stdout);
            *done = true;
            return STATUS_OK;
        default:
            status = cli_bad_option("replay", answer, argv, why);
        }
    if (status)
        return status;
    if (optind != argc - 1)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar replay --help", "replay takes one recording");
    if (r->bus && r->bank_path)
        return failure_set(why, STATUS_USAGE, NULL, "leave out one", "the controller on a bus has its own bank");
    if (!r->bus && !r->bank_path)
        return failure_set(why, STATUS_USAGE, NULL, "say --bank FILE", "which bank the controller had is not given");
    r->log = argv[optind];
    return STATUS_OK;
}

static void print_text(const struct request *r, const struct replay_result *result)
{
    printf("%-26s %s, node %u, %llu frames in %.3f s\n", "recording", r->log, result->node,
           (unsigned long long)result->frames, 1e-6 * (double)(result->last_us - result->first_us));
    printf("%-26s %llu, with %llu samples; %llu of them lost altogether\n", "ticks", (unsigned long long)result->ticks,
           (unsigned long long)result->samples, (unsigned long long)result->lost_ticks);
    printf("%-26s %llu agree, %llu differ, %llu not in the log, %llu damaged\n", "torque frames",
           (unsigned long long)result->agreed, (unsigned long long)result->differed,
           (unsigned long long)result->unanswered, (unsigned long long)result->damaged);
    printf("%-26s %llu agree, %llu differ\n", "state hashes", (unsigned long long)result->hashes_agreed,
           (unsigned long long)result->hashes_differed);
    printf("%-26s %llu\n", "frames too late for a tick", (unsigned long long)result->late);
    printf("%-26s %.3f N\n", "peak force", result->peak_force_N);
    if (result->joined)
        puts("the recording begins in the middle of a run: what the controller had met before is not known");
}

static void whole(struct json_object *object, const char *key, uint64_t value)
{
    json_object_object_add(object, key, json_object_new_int64((int64_t)value));
}

static void print_json(const struct request *r, const struct replay_result *result)
{
    struct json_object *root = json_object_new_object();
    json_object_object_add(root, "log", json_object_new_string(r->log));
    whole(root, "node", result->node);
    whole(root, "instruments", result->instruments);
    whole(root, "frames", result->frames);
    whole(root, "ticks", result->ticks);
    whole(root, "samples", result->samples);
    whole(root, "agreed", result->agreed);
    whole(root, "differed", result->differed);
    whole(root, "not_in_log", result->unanswered);
    whole(root, "damaged", result->damaged);
    whole(root, "lost_ticks", result->lost_ticks);
    whole(root, "late", result->late);
    whole(root, "hashes_agreed", result->hashes_agreed);
    whole(root, "hashes_differed", result->hashes_differed);
    json_object_object_add(root, "joined", json_object_new_boolean(result->joined));
    json_object_object_add(root, "peak_force_N", json_object_new_double(result->peak_force_N));
    whole(root, "first_difference_line", (uint64_t)result->line);
    puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED | JSON_C_TO_STRING_NOSLASHESCAPE));
    json_object_put(root);
}

/* The first difference, in words. */
static int judge(const struct request *r, const struct replay_result *result, struct failure *why)
{
    char recorded[129], computed[129];
    if (result->differed + result->hashes_differed == 0) {
        if (result->agreed)
            return STATUS_OK;
        fprintf(stderr, "trocar: %s: no torque frame was compared: the recording has none\n", r->log);
        return STATUS_OK;
    }
    decode_data(&result->recorded, recorded);
    decode_data(&result->computed, computed);
    const char *remedy = result->joined ? "record from the controller's start"
                                        : "check that the bank and the firmware are those of the recording";
    if (!strcmp(recorded, computed))
        return failure_at(why, STATUS_CHECK_FAILED, r->log, result->line, remedy,
                          "the state of tick %u is not the recorded one (its hash differs)", result->tick);
    return failure_at(why, STATUS_CHECK_FAILED, r->log, result->line, remedy,
                      "the torque frame of tick %u is %s in the recording and %s computed; %llu of %llu differ",
                      result->tick, recorded, computed, (unsigned long long)result->differed,
                      (unsigned long long)(result->differed + result->agreed));
}

/* The same for a controller on a bus. */
static int report_bus(const struct request *r, const struct replay_bus *replay, struct failure *why)
{
    const uint64_t compared = replay->agreed + replay->differed;
    if (r->json) {
        struct json_object *root = json_object_new_object();
        json_object_object_add(root, "log", json_object_new_string(r->log));
        json_object_object_add(root, "bus", json_object_new_string(r->bus));
        whole(root, "ticks", replay->tick_count);
        whole(root, "replayed", replay->at);
        whole(root, "agreed", replay->agreed);
        whole(root, "differed", replay->differed);
        whole(root, "not_in_log", replay->not_recorded);
        whole(root, "unanswered", replay->unanswered);
        whole(root, "no_room", replay->no_room);
        whole(root, "first_difference_line", (uint64_t)replay->line);
        puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED | JSON_C_TO_STRING_NOSLASHESCAPE));
        json_object_put(root);
    } else {
        printf("%-26s %s, node %u, %zu of %zu ticks\n", "recording", r->log, replay->node, replay->at,
               replay->tick_count);
        printf("%-26s %llu agree, %llu differ, %llu not in the log, %llu not sent by the controller\n", "torque frames",
               (unsigned long long)replay->agreed, (unsigned long long)replay->differed,
               (unsigned long long)replay->not_recorded, (unsigned long long)replay->unanswered);
        printf("%-26s %llu\n", "frames without room", (unsigned long long)replay->no_room);
    }
    if (replay->differed) {
        struct can_frame_t heard = {.length = 8};
        char text[129];
        memcpy(heard.data, replay->heard, sizeof replay->heard);
        return failure_at(
            why, STATUS_CHECK_FAILED, r->log, replay->line,
            "start the controller afresh, with the recording's bank; trocar monitor shows ticks that it missed",
            "the controller sent %s instead of this torque frame; %llu of %llu differ", decode_data(&heard, text),
            (unsigned long long)replay->differed, (unsigned long long)compared);
    }
    if (replay->at < replay->tick_count)
        return failure_set(why, interrupted() ? STATUS_INTERRUPTED : STATUS_BUS_LOST, r->bus, NULL,
                           "the controller's SYNC was not heard any more after %zu of %zu ticks", replay->at,
                           replay->tick_count);
    return STATUS_OK;
}

static int replay_on_bus(const struct request *r, FILE *in, struct failure *why)
{
    struct replay_bus replay;
    struct backend *backend = NULL;
    struct backend_received received;
    int status = replay_bus_open(&replay, in, r->log, &r->options, why);
    if (status)
        return status;
    status = backend_open(r->bus, NULL, &backend, why);
    double heard_s = seconds_now();
    while (status == 0 && !interrupted() && seconds_now() - heard_s < SILENCE_s) {
        status = backend_receive(backend, &received, 100000, why);
        if (status == 1) {
            if (received.frame.id == WIRE_SYNC_ID)
                heard_s = seconds_now();
            status = replay_bus_receive(&replay, backend, &received, why);
        }
    }
    if (status >= 0)
        status = report_bus(r, &replay, why);
    backend_close(backend);
    replay_bus_close(&replay);
    return status;
}

int verb_replay(int argc, char **argv, struct failure *why)
{
    struct request r = {0};
    struct bank_file bank;
    struct replay_result result;
    bool done = false;
    int status = parse(&r, argc, argv, &done, why);
    if (status || done)
        return status;
    FILE *in = fopen(r.log, "rb");
    if (!in)
        return failure_set(why, STATUS_FILE_OPEN, r.log, NULL, "the recording cannot be opened: %s", strerror(errno));
    if (r.bus) {
        status = replay_on_bus(&r, in, why);
        fclose(in);
        return status;
    }
    status = open_bank(r.bank_path, NULL, &bank, why);
    if (!status) {
        status = replay_log(in, r.log, &bank.view, &r.options, &result, why);
        if (!status) {
            (r.json ? print_json : print_text)(&r, &result);
            status = judge(&r, &result, why);
        }
        bank_unload(&bank);
    }
    fclose(in);
    return status;
}
