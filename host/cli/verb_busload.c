/* trocar busload SCENE|BANK: what the protocol can take of the bus. */
#include <getopt.h>
#include <json-c/json.h>
#include <stdio.h>
#include <stdlib.h>

#include "bank.h"
#include "busload.h"
#include "cli.h"
#include "open_bank.h"
#include "scene.h"
#include "wire_dbc.h"

#define LIMIT 0.70 /* of the bus with all telemetry: what is left is for events, services and others */

static const char usage[] = "usage: trocar busload SCENE.yaml|BANK [options]\n"
                            "\n"
                            "Every frame of the protocol at the rate at which the scene's instruments send it, as long "
                            "as bit stuffing can make\n"
                            "it: frames per second, bits, share of the bus. No bank is built.\n"
                            "\n"
                            "      --instruments N   1 or 2 on the bus (default: the scene's)\n"
                            "      --bit-rate N      bit/s (default 1000000)\n"
                            "      --fd              also the same frames in CAN FD format with bit-rate switch\n"
                            "      --data-rate N     bit/s behind the switch (default 5000000)\n"
                            "      --json            one JSON object on stdout\n"
                            "\n"
                            "Exit code 12: more than 70 % of the bus, or a tick that does not fit a millisecond. "
                            "Counted is what is chosen: the\n"
                            "classic format, or with --fd that.\n";

struct options {
    const char *path;
    bool fd, json;
    uint64_t instruments; /* 0: the scene's */
    struct busload_use use;
};

static int parse(struct options *o, int argc, char **argv, bool *done, struct failure *why)
{
    static const struct option longs[] = {{"instruments", required_argument, NULL, 'i'},
                                          {"bit-rate", required_argument, NULL, 'b'},
                                          {"data-rate", required_argument, NULL, 'd'},
                                          {"fd", no_argument, NULL, 'f'},
                                          {"json", no_argument, NULL, 'j'},
                                          {"help", no_argument, NULL, 'h'},
                                          {0}};
    uint64_t bit_rate = 1000000, data_rate = 5000000;
    int status = STATUS_OK;
    opterr = 0;
    optind = 0; /* GNU: start over */
    for (int answer; !status && (answer = getopt_long(argc, argv, ":h", longs, NULL)) != -1;)
        switch (answer) {
        case 'i':
            status = cli_whole("--instruments", optarg, 1, 2, &o->instruments, why);
            break;
        case 'b':
            status = cli_whole("--bit-rate", optarg, 10000, 1000000, &bit_rate, why);
            break;
        case 'd':
            status = cli_whole("--data-rate", optarg, 10000, 8000000, &data_rate, why);
            break;
        case 'f':
            o->fd = true;
            break;
        case 'j':
            o->json = true;
            break;
        case 'h':
            fputs(usage, stdout);
            *done = true;
            return STATUS_OK;
        default:
            status = cli_bad_option("busload", answer, argv, why);
        }
    if (status)
        return status;
    if (optind != argc - 1)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar busload --help", "busload takes one scene or bank");
    o->path = argv[optind];
    o->use.bit_rate = (double)bit_rate;
    o->use.data_rate = (double)data_rate;
    return STATUS_OK;
}

static int read_instruments(struct options *o, struct failure *why)
{
    int status;
    if (is_scene(o->path)) {
        struct scene *scene = calloc(1, sizeof *scene);
        if (!scene)
            return failure_set(why, STATUS_MEMORY, o->path, NULL, "no memory for the scene");
        status = scene_read(o->path, scene, why);
        o->use.instruments = (unsigned)scene->instrument_count;
        for (unsigned i = 0; i < 2 && i < o->use.instruments; i++)
            o->use.points[i] = scene->instrument[i].tip_points;
        free(scene);
    } else {
        struct bank_file bank;
        status = load_bank(o->path, &bank, why);
        if (!status) {
            o->use.instruments = bank.view.tool_count;
            for (unsigned i = 0; i < 2 && i < o->use.instruments; i++)
                o->use.points[i] = bank.view.tools[i].point_count;
            bank_unload(&bank);
        }
    }
    if (o->use.instruments < 2)
        o->use.points[1] = o->use.points[0]; /* a second one like the first */
    if (o->instruments)
        o->use.instruments = (unsigned)o->instruments;
    return status;
}

static void print_table(const struct options *o, const struct busload *load)
{
    printf("%u instrument%s at %.6g Mbit/s, %g points%s\n", o->use.instruments, o->use.instruments > 1 ? "s" : "",
           1e-6 * o->use.bit_rate, (double)o->use.points[0], o->use.instruments > 1 ? " each" : "");
    printf("%-14s %5s  %-10s %8s %5s %8s", "frame", "id", "from", "per s", "bits", "share");
    printf(o->fd ? " %8s %8s\n" : "\n", "FD us", "share");
    for (size_t i = 0; i < load->count; i++) {
        const struct busload_row *row = &load->row[i];
        const struct dbc_message *m = row->message;
        bool per_node;
        const uint32_t base = dbc_base(m, &per_node);
        printf("%-14s 0x%03X%s %-9s", m->name, base, per_node ? "+n" : "  ",
               m->sender == 0   ? "host"
               : m->sender == 1 ? "controller"
                                : "device");
        if (row->per_second > 0)
            printf(" %9.1f %5u %6.2f %%", row->per_second, row->bits, 100 * row->share);
        else
            printf(" %9s %5u %8s", "on event", row->bits, "-");
        if (o->fd)
            printf(" %8.1f %6.2f %%", framebits_fd_us(row->fd_bits, o->use.bit_rate, o->use.data_rate),
                   100 * row->fd_share);
        putchar('\n');
    }
    printf("%-14s %39s %6.2f %%", "all", "", 100 * load->share);
    if (o->fd)
        printf(" %8s %6.2f %%", "", 100 * load->fd_share);
    printf("\nfullest tick: %.0f us of bus time\n", load->worst_tick_us);
}

static void print_json(const struct options *o, const struct busload *load)
{
    struct json_object *root = json_object_new_object(), *frames = json_object_new_array();
    json_object_object_add(root, "instruments", json_object_new_int((int)o->use.instruments));
    json_object_object_add(root, "bit_rate", json_object_new_double(o->use.bit_rate));
    for (size_t i = 0; i < load->count; i++) {
        const struct busload_row *row = &load->row[i];
        struct json_object *frame = json_object_new_object();
        json_object_object_add(frame, "name", json_object_new_string(row->message->name));
        json_object_object_add(frame, "id", json_object_new_int((int)row->message->id));
        json_object_object_add(frame, "per_second", json_object_new_double(row->per_second));
        json_object_object_add(frame, "bits", json_object_new_int((int)row->bits));
        json_object_object_add(frame, "share", json_object_new_double(row->share));
        if (o->fd)
            json_object_object_add(frame, "fd_share", json_object_new_double(row->fd_share));
        json_object_array_add(frames, frame);
    }
    json_object_object_add(root, "frames", frames);
    json_object_object_add(root, "share", json_object_new_double(load->share));
    if (o->fd) {
        json_object_object_add(root, "data_rate", json_object_new_double(o->use.data_rate));
        json_object_object_add(root, "fd_share", json_object_new_double(load->fd_share));
    }
    json_object_object_add(root, "fullest_tick_us", json_object_new_double(load->worst_tick_us));
    puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED));
    json_object_put(root);
}

int verb_busload(int argc, char **argv, struct failure *why)
{
    struct options o = {0};
    bool done = false;
    int status = parse(&o, argc, argv, &done, why);
    if (status || done)
        return status;
    status = read_instruments(&o, why);
    struct dbc *dbc = NULL;
    struct busload load;
    if (!status)
        status = wire_dbc(&dbc, why);
    if (!status)
        status = busload(dbc, &o.use, &load, why);
    if (!status) {
        (o.json ? print_json : print_table)(&o, &load);
        const double share = o.fd ? load.fd_share : load.share;
        if (share > LIMIT || (!o.fd && load.worst_tick_us > 1000))
            status = failure_set(why, STATUS_CHECK_FAILED, o.path, "raise the bit rate, use --fd, or fewer instruments",
                                 "the protocol can take %.1f %% of the bus, and %.0f us of a tick", 100 * share,
                                 load.worst_tick_us);
    }
    dbc_free(dbc);
    return status;
}
