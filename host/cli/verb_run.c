/* trocar run: device, hand, controller and host on a simulated bus. */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bank.h"
#include "cli.h"
#include "faults_option.h"
#include "gestures.h"
#include "open_bank.h"
#include "progress.h"
#include "remote.h"
#include "run_report.h"
#include "session.h"
#include "serve_session.h"

struct run {
    const char *file, *bank_path, *out_path, *bus;
    uint64_t node; /* with bus */
    bool json, view, hold;
    int port; /* -1: not given */
    struct session_options options;
    struct bank_file bank;
    struct body body;
    bool body_open;
    struct session *session;
    struct session_result result;
};

enum {
    OPTION_HELP = 256,
    OPTION_JSON,
    OPTION_TORQUE_LOG,
    OPTION_NO_FEM,
    OPTION_FEM_EVERY,
    OPTION_FAULTS,
    OPTION_SEED,
    OPTION_REALTIME,
    OPTION_VIEW,
    OPTION_PORT,
    OPTION_HOLD,
    OPTION_BANK,
    OPTION_PRINT_GESTURE,
    OPTION_DEVICE,
    OPTION_BUS,
    OPTION_NODE
};

static const struct option long_options[] = {{"help", no_argument, NULL, OPTION_HELP},
                                             {"gesture", required_argument, NULL, 'g'},
                                             {"ticks", required_argument, NULL, 'n'},
                                             {"output", required_argument, NULL, 'o'},
                                             {"bank", required_argument, NULL, OPTION_BANK},
                                             {"device", required_argument, NULL, OPTION_DEVICE},
                                             {"bus", required_argument, NULL, OPTION_BUS},
                                             {"node", required_argument, NULL, OPTION_NODE},
                                             {"json", no_argument, NULL, OPTION_JSON},
                                             {"torque-log", required_argument, NULL, OPTION_TORQUE_LOG},
                                             {"no-fem", no_argument, NULL, OPTION_NO_FEM},
                                             {"fem-every", required_argument, NULL, OPTION_FEM_EVERY},
                                             {"faults", required_argument, NULL, OPTION_FAULTS},
                                             {"seed", required_argument, NULL, OPTION_SEED},
                                             {"realtime", no_argument, NULL, OPTION_REALTIME},
                                             {"view", no_argument, NULL, OPTION_VIEW},
                                             {"port", required_argument, NULL, OPTION_PORT},
                                             {"hold", no_argument, NULL, OPTION_HOLD},
                                             {"print-gesture", required_argument, NULL, OPTION_PRINT_GESTURE},
                                             {NULL, 0, NULL, 0}};

static void help(void)
{
    printf(
        "usage: trocar run SCENE.yaml|BANK [options]\n"
        "       trocar run --bus BUS [--node N] [--ticks N] [--torque-log FILE] [--json]\n\n"
        "Runs the simulated instrument and hand, the controller and the host on a simulated CAN bus, 1 ms a tick, in\n"
        "lockstep: the same input gives the same torques, byte for byte. A scene's bank is built first.\n\n"
        "  -g, --gesture G        what the hand does: %s, or a file (default press); a\n"
        "                         second one is the second instrument's\n"
        "      --print-gesture G  print a built-in gesture's text, to start your own from\n"
        "  -n, --ticks N          so many ticks (default: the whole gesture)\n"
        "  -o, --output FILE      keep the scene's bank in FILE\n"
        "      --bank FILE        use this bank of the scene instead of building it\n"
        "      --device NAME      the instrument (default: the scene's; known: %s); a second one as above\n"
        "      --torque-log FILE  write the torque frames as a candump log\n"
        "      --no-fem           do not compare with the full finite-element solve\n"
        "      --fem-every N      compare at every N-th tick in contact (default: 8 to 16 spread over the run)\n"
        "      --faults LIST      drop=P,duplicate=P,corrupt=P,reorder=P,delay=P (probabilities per frame),\n"
        "                         delay_us=N, from=ID,to=ID (only these identifiers)\n"
        "      --seed N           of the faults (default 1)\n"
        "      --realtime         as fast as the clock on the wall, not faster\n"
        "      --view             serve the live page on 127.0.0.1, in real time\n"
        "      --port P           of the page (default %d, or any free one)\n"
        "      --hold             keep the page up afterwards, until Ctrl-C\n"
        "      --json             one JSON object on stdout\n"
        "      --bus BUS          socketcan:IF or slcan:TTY: the host of a controller that is out there, and nothing "
        "else;\n"
        "                         trocar device puts a simulated instrument there (default: soft, all in this "
        "program)\n"
        "      --node N           of the controller's first instrument, with --bus (default 1)\n\n"
        "Exit code 9: the controller ended in the state SAFE, or had not come to RUN in %d ticks; whether a shorter "
        "run\n"
        "came to RUN is not judged.\n",
        gesture_names(), device_model_names(), (int)VIEW_DEFAULT_PORT, (int)SESSION_WAIT_TICKS);
}

static int print_gesture(const char *name, struct failure *why)
{
    const char *text = gesture_builtin(name);
    if (!text)
        return failure_set(why, STATUS_USAGE, NULL, NULL, "there is no built-in gesture \"%.60s\" (there are %s)", name,
                           gesture_names());
    fputs(text, stdout);
    return STATUS_OK;
}

/* `*done`: the command was answered already. */
static int parse(struct run *run, int argc, char **argv, bool *done, struct failure *why)
{
    uint64_t n = 0;
    int status = STATUS_OK;
    run->port = -1;
    run->options = (struct session_options){.fem = true, .faults = {.id_to = 0x7FF, .seed = 1, .delay_us = 500}};
    opterr = 0;
    optind = 1;
    for (int o; !status && (o = getopt_long(argc, argv, ":g:n:o:", long_options, NULL)) != -1;)
        switch (o) {
        case OPTION_HELP:
            help();
            *done = true;
            return STATUS_OK;
        case OPTION_PRINT_GESTURE:
            *done = true;
            return print_gesture(optarg, why);
        case 'g':
            status = cli_each("--gesture", optarg, run->options.gesture, why);
            break;
        case 'n':
            status = cli_whole("--ticks", optarg, 1, 1000000000, &run->options.ticks, why);
            break;
        case 'o':
            run->out_path = optarg;
            break;
        case OPTION_BANK:
            run->bank_path = optarg;
            break;
        case OPTION_DEVICE:
            status = cli_each("--device", optarg, run->options.device, why);
            break;
        case OPTION_BUS:
            run->bus = strcmp(optarg, "soft") ? optarg : NULL;
            break;
        case OPTION_NODE:
            status = cli_whole("--node", optarg, 1, 126, &run->node, why);
            break;
        case OPTION_JSON:
            run->json = true;
            break;
        case OPTION_TORQUE_LOG:
            run->options.torque_log = optarg;
            break;
        case OPTION_NO_FEM:
            run->options.fem = false;
            break;
        case OPTION_FEM_EVERY:
            status = cli_whole("--fem-every", optarg, 1, UINT32_MAX, &n, why);
            run->options.fem_every = (uint32_t)n;
            break;
        case OPTION_FAULTS:
            status = faults_option(optarg, &run->options.faults, why);
            break;
        case OPTION_SEED:
            status = cli_whole("--seed", optarg, 0, UINT64_MAX, &run->options.faults.seed, why);
            break;
        case OPTION_REALTIME:
            run->options.realtime = true;
            break;
        case OPTION_VIEW:
            run->view = run->options.realtime = true;
            break;
        case OPTION_PORT:
            status = cli_whole("--port", optarg, 0, 65535, &n, why);
            run->port = (int)n;
            break;
        case OPTION_HOLD:
            run->hold = true;
            break;
        default:
            status = cli_bad_option("run", o, argv, why);
        }
    if (status)
        return status;
    if (run->bus)
        return optind == argc ? STATUS_OK
                              : failure_set(why, STATUS_USAGE, NULL,
                                            "leave the scene out; trocar device SCENE --bus BUS has the instrument",
                                            "with --bus run is the host alone, which needs no scene");
    if (run->node)
        return failure_set(why, STATUS_USAGE, NULL, "add --bus, or leave it out", "--node goes with --bus");
    if (optind != argc - 1)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar run --help", "%s",
                           optind >= argc ? "no scene or bank is given" : "run takes one scene or bank");
    if ((run->hold || run->port >= 0) && !run->view)
        return failure_set(why, STATUS_USAGE, NULL, "add --view, or leave it out", "%s goes with --view",
                           run->hold ? "--hold" : "--port");
    run->file = argv[optind];
    return STATUS_OK;
}

static int find_bank(struct run *run, struct failure *why)
{
    if (!is_scene(run->file) && (run->out_path || run->bank_path))
        return failure_set(why, STATUS_USAGE, NULL, "give a scene, or leave it out",
                           "%s goes with a scene, and %.200s is none", run->out_path ? "-o" : "--bank", run->file);
    if (run->out_path && run->bank_path)
        return failure_set(why, STATUS_USAGE, NULL, "leave out one",
                           "-o keeps a bank that is built; --bank builds none");
    return open_bank(run->bank_path ? run->bank_path : run->file, run->out_path, &run->bank, why);
}

/* Without the mesh there is no comparison, but a run all the same. */
static int open_body(struct run *run, struct failure *why)
{
    if (!run->options.fem)
        return STATUS_OK;
    struct failure reason = {0};
    int status = body_open(&run->bank, is_scene(run->file) ? run->file : NULL, &run->body, &reason);
    run->body_open = !status;
    if (status == STATUS_INTERRUPTED) {
        *why = reason;
        return status;
    }
    if (status) {
        fputs("no finite-element comparison: ", stderr);
        failure_print(stderr, &reason);
    }
    return STATUS_OK;
}

/* ---- running ---- */

static int loop(struct run *run, struct view *view, struct failure *why)
{
    struct progress bar;
    bool shown = false;
    double started_s = seconds_now();
    while (session_tick(run->session)) {
        if (view && !serve_session(run->session, view))
            break;
        /* a bar only for those who wait */
        if (!shown && !view && seconds_now() - started_s > 2) {
            progress_start(&bar, "running", false);
            shown = true;
        }
        if (shown)
            progress_show(&bar, session_progress(run->session));
    }
    if (shown)
        progress_end(&bar);
    if (interrupted())
        return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted after %.3f s of the run",
                           session_time_s(run->session));
    return STATUS_OK;
}

/* A run that ended without torque although nobody asked for it has failed. */
static int judge(const struct session_result *r, struct failure *why)
{
    if (r->final_state == SAFETY_SAFE && !r->stopped)
        return failure_set(why, STATUS_LOOP_SAFE, NULL, status_remedy(r->reason),
                           "the controller ended in SAFE: %s [%s]", status_meaning(r->reason), status_name(r->reason));
    if (!r->ran && r->ticks >= SESSION_WAIT_TICKS) /* a shorter run may end before the host starts it */
        return failure_set(why, STATUS_LOOP_STALE, NULL, NULL, "the controller never came to RUN in %llu ticks",
                           (unsigned long long)r->ticks);
    return STATUS_OK;
}

static int run_and_report(struct run *run, struct failure *why)
{
    struct view *view = NULL;
    int status = session_create(&run->bank, run->body_open ? &run->body : NULL, &run->options, &run->session, why);
    if (!status && run->view)
        status = serve_open(&run->bank, run->port, &view, why);
    if (!status && view)
        fprintf(stderr, "the organ is at http://127.0.0.1:%u/\n", (unsigned)view_port(view));
    if (!status)
        status = loop(run, view, why);
    if (!status)
        status = session_finish(run->session, &run->result, why);
    if (!status && run->json)
        status = run_report_json(stdout, &run->result, why);
    else if (!status)
        run_report_table(stdout, &run->result);
    if (!status)
        status = judge(&run->result, why);
    if (status >= 0 && view && run->hold) {
        fflush(stdout);
        fputs("the run is over; the page stays until Ctrl-C\n", stderr);
        session_continue(run->session);
        while (session_tick(run->session) && serve_session(run->session, view))
            ;
    }
    view_free(view);
    session_free(run->session);
    return status;
}

int verb_run(int argc, char **argv, struct failure *why)
{
    static struct run run; /* large: the body's scene is in it */
    memset(&run, 0, sizeof run);
    bool done = false;
    int status = parse(&run, argc, argv, &done, why);
    if (status || done)
        return status;
    if (run.bus) {
        const struct remote_options remote = {.bus = run.bus,
                                              .torque_log = run.options.torque_log,
                                              .node = run.node ? (uint8_t)run.node : SESSION_NODE,
                                              .ticks = run.options.ticks};
        return run_remote(&remote, run.json, why);
    }
    status = find_bank(&run, why);
    if (status)
        return status;
    status = open_body(&run, why);
    if (!status)
        status = run_and_report(&run, why);
    if (run.body_open)
        body_close(&run.body);
    bank_unload(&run.bank);
    return status;
}
