/* trocar view: the organ live on a local page, until Ctrl-C. */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"
#include "open_bank.h"
#include "serve_session.h"

struct request {
    const char *file;
    int port;        /* -1: not given */
    const char *bus; /* NULL: simulated, in this program */
    uint64_t node;   /* with bus */
    struct session_options session;
};

enum { OPTION_HELP = 256, OPTION_PORT, OPTION_DEVICE, OPTION_BUS, OPTION_NODE };

static const struct option long_options[] = {{"help", no_argument, NULL, OPTION_HELP},
                                             {"gesture", required_argument, NULL, 'g'},
                                             {"ticks", required_argument, NULL, 'n'},
                                             {"port", required_argument, NULL, OPTION_PORT},
                                             {"device", required_argument, NULL, OPTION_DEVICE},
                                             {"bus", required_argument, NULL, OPTION_BUS},
                                             {"node", required_argument, NULL, OPTION_NODE},
                                             {NULL, 0, NULL, 0}};

static void help(void)
{
    printf(
        "usage: trocar view SCENE.yaml|BANK [options]\n\n"
        "Runs the simulated instrument and hand, the controller and the host in real time, and serves a page on\n"
        "127.0.0.1 that shows the organ, the instrument and the force; keys and mouse of the page move the hand.\n"
        "A scene's bank is built first. The address is printed on stdout. Ctrl-C ends it.\n\n"
        "  -g, --gesture G    what the hand does, over and over: %s, or a file\n"
        "                     (default press); a second one is the second instrument's\n"
        "  -n, --ticks N      end after N ticks of 1 ms (default: never)\n"
        "      --port P       of the page; 0 takes any free one (default %d, or any free one)\n"
        "      --device NAME  the instrument (default impulse-engine; known: %s)\n"
        "      --bus BUS      socketcan:IF or slcan:TTY: shows the controller that is out there, which was given this\n"
        "                     bank too; start and stop of the page go to it (default: soft, all in this program)\n"
        "      --node N       of its first instrument, with --bus (default 1)\n",
        gesture_names(), (int)VIEW_DEFAULT_PORT, device_model_names());
}

static int parse(struct request *request, int argc, char **argv, bool *done, struct failure *why)
{
    uint64_t n = 0;
    int status = STATUS_OK;
    *request = (struct request){.port = -1, .session = {.realtime = true, .endless = true, .repeat = true}};
    opterr = 0;
    optind = 1;
    for (int o; !status && (o = getopt_long(argc, argv, ":g:n:", long_options, NULL)) != -1;)
        switch (o) {
        case OPTION_HELP:
            help();
            *done = true;
            return STATUS_OK;
        case 'g':
            status = cli_each("--gesture", optarg, request->session.gesture, why);
            break;
        case 'n':
            status = cli_whole("--ticks", optarg, 1, 1000000000, &request->session.ticks, why);
            request->session.endless = false;
            break;
        case OPTION_PORT:
            status = cli_whole("--port", optarg, 0, 65535, &n, why);
            request->port = (int)n;
            break;
        case OPTION_DEVICE:
            status = cli_each("--device", optarg, request->session.device, why);
            break;
        case OPTION_BUS:
            request->bus = strcmp(optarg, "soft") ? optarg : NULL;
            break;
        case OPTION_NODE:
            status = cli_whole("--node", optarg, 1, 126, &request->node, why);
            break;
        default:
            status = cli_bad_option("view", o, argv, why);
        }
    if (status)
        return status;
    if (optind != argc - 1)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar view --help", "%s",
                           optind >= argc ? "no scene or bank is given" : "view takes one scene or bank");
    if (request->node && !request->bus)
        return failure_set(why, STATUS_USAGE, NULL, "add --bus, or leave it out", "--node goes with --bus");
    if (request->bus && (*request->session.gesture || *request->session.device))
        return failure_set(why, STATUS_USAGE, NULL, "give it to trocar device", "%s does not go with --bus",
                           *request->session.gesture ? "--gesture" : "--device");
    request->file = argv[optind];
    return STATUS_OK;
}

/* Ctrl-C is how a view ends: no failure. */
static int serve(const struct bank_file *bank, const struct request *request, struct failure *why)
{
    struct session *session = NULL;
    struct view *view = NULL;
    int status = session_create(bank, NULL, &request->session, &session, why);
    if (!status)
        status = serve_open(bank, request->port, &view, why);
    if (!status) {
        printf("http://127.0.0.1:%u/\n", (unsigned)view_port(view));
        fflush(stdout);
        while (session_tick(session) && serve_session(session, view))
            ;
    }
    view_free(view);
    session_free(session);
    return status;
}

static int serve_remote_until_it_ends(struct remote *remote, const struct bank_file *bank, struct view *view,
                                      struct failure *why)
{
    enum { WAIT_US = 5000 }; /* so often the page is served while the bus is silent */
    int status;
    printf("http://127.0.0.1:%u/\n", (unsigned)view_port(view));
    fflush(stdout);
    do {
        status = remote_step(remote, WAIT_US, cli_warn, why);
        if (status == 1)
            status = serve_remote(remote, bank, view, why);
    } while (status == 1);
    return status;
}

static int serve_bus(const struct bank_file *bank, const struct request *request, struct failure *why)
{
    const uint8_t node = request->node ? (uint8_t)request->node : SESSION_NODE;
    struct mirror *mirror = calloc(1, sizeof *mirror);
    if (!mirror)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for a controller");
    struct remote remote = {.instruments = 0};
    struct view *view = NULL;
    int status = mirror_open(mirror, &bank->view, node, why);
    const struct remote_options options = {
        .bus = request->bus, .node = node, .ticks = request->session.ticks, .patient = true, .mirror = mirror};
    if (!status)
        status = remote_open(&remote, &options, why);
    if (!status)
        status = serve_open(bank, request->port, &view, why);
    if (!status)
        status = serve_remote_until_it_ends(&remote, bank, view, why);
    view_free(view);
    remote_free(&remote);
    mirror_close(mirror);
    free(mirror);
    return status;
}

int verb_view(int argc, char **argv, struct failure *why)
{
    struct request request;
    static struct bank_file bank; /* large: paths */
    bool done = false;
    int status = parse(&request, argc, argv, &done, why);
    if (status || done)
        return status;
    status = open_bank(request.file, NULL, &bank, why);
    if (status)
        return status;
    status = (request.bus ? serve_bus : serve)(&bank, &request, why);
    bank_unload(&bank);
    return status;
}
