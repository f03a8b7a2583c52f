/* trocar device: the simulated instrument and its hand as a node on a bus. */
#include <getopt.h>
#include <stdio.h>
#include <string.h>

#include "cli.h"
#include "device_process.h"
#include "open_bank.h"

struct request {
    const char *file, *bus;
    struct device_process_options options;
};

static void help(void)
{
    printf(
        "usage: trocar device SCENE.yaml|BANK --bus BUS [options]\n\n"
        "Puts the simulated instrument and the hand that holds it on a bus, for a controller that is another program\n"
        "or a board. Every SYNC of the controller is one millisecond. A scene's bank is built first.\n\n"
        "      --bus BUS      socketcan:IF or slcan:TTY\n"
        "  -g, --gesture G    what the hand does once there is torque: %s, or a file (default press)\n"
        "      --repeat       over and over, until Ctrl-C (default: once, then it leaves the bus)\n"
        "  -n, --ticks N      leave after N ticks\n"
        "      --instrument N which of the bank's instruments, 1 or 2 (default 1)\n"
        "      --node N       its number on the bus (default: the instrument's)\n"
        "      --device NAME  the instrument (default: the scene's; known: %s)\n",
        gesture_names(), device_model_names());
}

static int parse(struct request *r, int argc, char **argv, bool *done, struct failure *why)
{
    enum { HELP = 256, BUS, REPEAT, INSTRUMENT, NODE, DEVICE };
    static const struct option longs[] = {{"help", no_argument, NULL, HELP},
                                          {"bus", required_argument, NULL, BUS},
                                          {"gesture", required_argument, NULL, 'g'},
                                          {"repeat", no_argument, NULL, REPEAT},
                                          {"ticks", required_argument, NULL, 'n'},
                                          {"node", required_argument, NULL, NODE},
                                          {"device", required_argument, NULL, DEVICE},
                                          {"instrument", required_argument, NULL, INSTRUMENT},
                                          {NULL, 0, NULL, 0}};
    uint64_t node = 0, instrument = 1;
    int status = STATUS_OK;
    opterr = 0;
    optind = 1;
    for (int o; !status && (o = getopt_long(argc, argv, ":g:n:", longs, NULL)) != -1;)
        switch (o) {
        case HELP:
            help();
            *done = true;
            return STATUS_OK;
        case BUS:
            r->bus = optarg;
            break;
        case 'g':
            r->options.gesture = optarg;
            break;
        case REPEAT:
            r->options.repeat = true;
            break;
        case 'n':
            status = cli_whole("--ticks", optarg, 1, 1000000000, &r->options.ticks, why);
            break;
        case INSTRUMENT:
            status = cli_whole("--instrument", optarg, 1, BANK_MAX_INSTRUMENTS, &instrument, why);
            break;
        case NODE:
            status = cli_whole("--node", optarg, 1, 126, &node, why);
            break;
        case DEVICE:
            r->options.device = optarg;
            break;
        default:
            status = cli_bad_option("device", o, argv, why);
        }
    if (status)
        return status;
    if (optind != argc - 1)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar device --help", "%s",
                           optind >= argc ? "no scene or bank is given" : "device takes one scene or bank");
    if (!r->bus)
        return failure_set(why, STATUS_USAGE, NULL, "add --bus socketcan:IF or --bus slcan:TTY",
                           "device needs a bus; trocar run has its own");
    r->options.instrument = (uint32_t)instrument - 1;
    r->options.node = (uint8_t)(node ? node : instrument);
    r->file = argv[optind];
    return STATUS_OK;
}

int verb_device(int argc, char **argv, struct failure *why)
{
    struct request request = {0};
    static struct bank_file bank;         /* large: paths */
    static struct device_process process; /* large: the gesture */
    bool done = false;
    int status = parse(&request, argc, argv, &done, why);
    if (status || done)
        return status;
    status = open_bank(request.file, NULL, &bank, why);
    if (status)
        return status;
    if (request.options.instrument >= bank.view.tool_count)
        status = failure_set(why, STATUS_USAGE, request.file, NULL, "the bank has %u instrument%s",
                             bank.view.tool_count, bank.view.tool_count > 1 ? "s" : "");
    if (!status)
        status = device_process_start(&process, &bank, request.bus, &request.options, why);
    if (!status)
        fprintf(stderr, "device: node %u is on %s\n", (unsigned)request.options.node, backend_name(process.backend));
    if (!status)
        status = device_process_run(&process, cli_warn, why);
    if (process.backend) {
        const struct device *d = &process.bench.node.device;
        const struct backend_counters *c = backend_counters(process.backend);
        fprintf(stderr,
                "%llu ticks (%llu SYNC lost), %u torques taken, %u refused, %u late; %llu samples without room on the "
                "bus, motors dropped %u times, %llu frames lost here\n",
                (unsigned long long)process.ticks, (unsigned long long)process.skipped, d->commands_received,
                d->commands_rejected, process.bench.node.late, (unsigned long long)process.unsent, d->silences,
                (unsigned long long)c->dropped);
    }
    device_process_end(&process);
    bank_unload(&bank);
    return status;
}
