/* trocar bridge A B: two buses made one. */
#include <getopt.h>
#include <json-c/json.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bridge.h"
#include "cli.h"
#include "progress.h"

static const char usage[] = "usage: trocar bridge A B [options]\n"
                            "\n"
                            "Carries every frame from the bus A to the bus B and back, until Ctrl-C: for instance a "
                            "controller on slcan:/dev/ttyACM0\n"
                            "and tools on socketcan:vcan0. A and B are socketcan:IF or slcan:TTY. An identifier "
                            "belongs to the side on which it was\n"
                            "heard first; what comes back by another way is dropped and counted.\n"
                            "\n"
                            "      --seconds N   end after so long\n"
                            "      --json        at the end one JSON object on stdout, instead of a line\n";

struct request {
    const char *name[2];
    uint64_t seconds;
    bool json;
};

static int parse(struct request *r, int argc, char **argv, bool *done, struct failure *why)
{
    static const struct option longs[] = {{"seconds", required_argument, NULL, 's'},
                                          {"json", no_argument, NULL, 'j'},
                                          {"help", no_argument, NULL, 'h'},
                                          {0}};
    int status = STATUS_OK;
    opterr = 0;
    optind = 0; /* GNU: start over */
    for (int answer; !status && (answer = getopt_long(argc, argv, ":h", longs, NULL)) != -1;)
        switch (answer) {
        case 's':
            status = cli_whole("--seconds", optarg, 1, 1000000000, &r->seconds, why);
            break;
        case 'j':
            r->json = true;
            break;
        case 'h':
            fputs(usage, stdout);
            *done = true;
            return STATUS_OK;
        default:
            status = cli_bad_option("bridge", answer, argv, why);
        }
    if (status)
        return status;
    if (optind != argc - 2)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar bridge --help", "bridge takes two buses");
    for (int i = 0; i < 2; i++) {
        r->name[i] = argv[optind + i];
        if (!strcmp(r->name[i], "soft"))
            return failure_set(why, STATUS_USAGE, "soft", "name socketcan:IF or slcan:TTY",
                               "a simulated bus lives in one program: there is nothing to bridge to");
    }
    if (!strcmp(r->name[0], r->name[1]))
        return failure_set(why, STATUS_USAGE, r->name[0], "name two", "both sides are the same bus");
    return STATUS_OK;
}

static void add_way(struct json_object *root, const char *key, const struct bridge_way *way)
{
    struct json_object *object = json_object_new_object();
    json_object_object_add(object, "heard", json_object_new_int64((int64_t)way->heard));
    json_object_object_add(object, "forwarded", json_object_new_int64((int64_t)way->forwarded));
    json_object_object_add(object, "no_room", json_object_new_int64((int64_t)way->no_room));
    json_object_object_add(object, "looped", json_object_new_int64((int64_t)way->looped));
    json_object_object_add(object, "refused", json_object_new_int64((int64_t)way->refused));
    json_object_object_add(root, key, object);
}

static void report(const struct request *r, const struct bridge *bridge)
{
    if (r->json) {
        struct json_object *root = json_object_new_object();
        json_object_object_add(root, "a", json_object_new_string(r->name[0]));
        json_object_object_add(root, "b", json_object_new_string(r->name[1]));
        add_way(root, "a_to_b", &bridge->way[0]);
        add_way(root, "b_to_a", &bridge->way[1]);
        json_object_object_add(root, "downs", json_object_new_int64((int64_t)bridge->downs));
        puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED | JSON_C_TO_STRING_NOSLASHESCAPE));
        json_object_put(root);
        return;
    }
    for (int i = 0; i < 2; i++) {
        const struct bridge_way *way = &bridge->way[i];
        printf("%s to %s: %llu of %llu frames, %llu without room, %llu come back, %llu not carried\n", r->name[i],
               r->name[!i], (unsigned long long)way->forwarded, (unsigned long long)way->heard,
               (unsigned long long)way->no_room, (unsigned long long)way->looped, (unsigned long long)way->refused);
    }
}

static int carry(const struct request *r, struct bridge *bridge, struct failure *why)
{
    const double end_s = seconds_now() + (double)r->seconds;
    while (!interrupted() && (r->seconds == 0 || seconds_now() < end_s)) {
        const int status = bridge_step(bridge, 100000, why);
        if (status == STATUS_BUS_DOWN || status == STATUS_BUS_LOST)
            failure_print(stderr, why); /* told once; it may come back */
        else if (status < 0)
            return status;
    }
    return STATUS_OK;
}

int verb_bridge(int argc, char **argv, struct failure *why)
{
    struct request r = {0};
    struct backend *side[2] = {NULL, NULL};
    bool done = false;
    int status = parse(&r, argc, argv, &done, why);
    if (status || done)
        return status;
    struct bridge *bridge = malloc(sizeof *bridge);
    if (!bridge)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the bridge");
    for (int i = 0; !status && i < 2; i++)
        status = backend_open(r.name[i], NULL, &side[i], why);
    if (!status) {
        bridge_start(bridge, side[0], side[1]);
        status = carry(&r, bridge, why);
        report(&r, bridge);
    }
    for (int i = 0; i < 2; i++)
        backend_close(side[i]);
    free(bridge);
    return status;
}
