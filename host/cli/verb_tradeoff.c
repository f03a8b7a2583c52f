/* trocar tradeoff SCENE: what accuracy costs in time and bytes, measured. */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"
#include "hand.h"
#include "open_bank.h"
#include "progress.h"
#include "report.h"
#include "tradeoff.h"

enum { QUICK_LIMIT_S = 60, FULL_LIMIT_S = 1800 };

struct options {
    const char *scene, *html, *svg;
    bool json, help;
    struct tradeoff_options measure;
};

static void help(void)
{
    printf("usage: trocar tradeoff SCENE.yaml [options]\n\n"
           "Measures what accuracy costs: for each setting of each knob the force errors, the instructions and the "
           "time of a\n"
           "tick, the bank's size and the time to build it, on one recording of one gesture. Says what to pick for a\n"
           "given budget.\n\n"
           "  -o, --output FILE    write a page with plots (HTML, needs no network)\n"
           "      --svg FILE       write the plot of error against bytes alone\n"
           "      --json           one JSON object on stdout instead of the table\n"
           "      --quick          few settings and few random contact sets, within %d s\n"
           "      --limit SECONDS  begin no setting after so long (default %d, with --quick %d)\n"
           "  -g, --gesture G      what the hand does: %s, or a file (default slide, with --quick a\n"
           "                       short stroke)\n"
           "      --controller F   the native controller whose instructions are counted (default: the one beside this\n"
           "                       program); valgrind counts them\n"
           "      --seed N         of the random contact sets (default 1)\n"
           "      --quiet          no progress\n",
           (int)QUICK_LIMIT_S, (int)FULL_LIMIT_S, (int)QUICK_LIMIT_S, gesture_names());
}

static int parse(int argc, char **argv, struct options *o, struct failure *why)
{
    enum { JSON = 256, QUICK, LIMIT, SVG, CONTROLLER, SEED, QUIET };
    static const struct option longs[] = {{"output", required_argument, NULL, 'o'},
                                          {"svg", required_argument, NULL, SVG},
                                          {"json", no_argument, NULL, JSON},
                                          {"quick", no_argument, NULL, QUICK},
                                          {"limit", required_argument, NULL, LIMIT},
                                          {"gesture", required_argument, NULL, 'g'},
                                          {"controller", required_argument, NULL, CONTROLLER},
                                          {"seed", required_argument, NULL, SEED},
                                          {"quiet", no_argument, NULL, QUIET},
                                          {"help", no_argument, NULL, 'h'},
                                          {0}};
    int answer, status = STATUS_OK;
    o->measure.seed = 1;
    opterr = 0;
    optind = 0; /* GNU: start over */
    while (!status && (answer = getopt_long(argc, argv, ":o:g:h", longs, NULL)) != -1) {
        if (answer == 'o')
            o->html = optarg;
        else if (answer == SVG)
            o->svg = optarg;
        else if (answer == JSON)
            o->json = true;
        else if (answer == QUICK)
            o->measure.quick = true;
        else if (answer == LIMIT)
            status = cli_positive("--limit", optarg, &o->measure.limit_s, why);
        else if (answer == 'g')
            o->measure.gesture = optarg;
        else if (answer == CONTROLLER)
            o->measure.controller = optarg;
        else if (answer == SEED) /* the JSON holds it as a number that every reader keeps whole */
            status = cli_whole("--seed", optarg, 0, (uint64_t)1 << 53, &o->measure.seed, why);
        else if (answer == QUIET)
            o->measure.quiet = true;
        else if (answer == 'h') {
            o->help = true;
            return STATUS_OK;
        } else
            return cli_bad_option("tradeoff", answer, argv, why);
    }
    if (status)
        return status;
    if (optind != argc - 1)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar tradeoff --help",
                           optind == argc ? "no scene is given" : "tradeoff takes one scene");
    o->scene = argv[optind];
    if (!is_scene(o->scene))
        return failure_set(why, STATUS_USAGE, o->scene, "trocar build MESH prints one; save it as FILE.yaml",
                           "tradeoff takes a scene");
    if (!(o->measure.limit_s > 0))
        o->measure.limit_s = o->measure.quick ? QUICK_LIMIT_S : FULL_LIMIT_S;
    return STATUS_OK;
}

/* A file that cannot be written is refused before the long part. */
static int writable(const char *path, struct failure *why)
{
    struct file_writer writer;
    if (!path)
        return STATUS_OK;
    int status = file_begin(&writer, path, why);
    file_abandon(&writer);
    return status;
}

int verb_tradeoff(int argc, char **argv, struct failure *why)
{
    struct options o = {0};
    int status = parse(argc, argv, &o, why);
    if (status)
        return status;
    if (o.help) {
        help();
        return STATUS_OK;
    }
    struct scene *scene = calloc(1, sizeof *scene);
    struct tradeoff result = {0};
    if (!scene)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the scene");
    status = scene_read(o.scene, scene, why);
    if (!status)
        status = writable(o.html, why);
    if (!status)
        status = writable(o.svg, why);
    if (!status)
        status = tradeoff_measure(scene, &o.measure, &result, why);
    free(scene);
    if (!status && o.html)
        status = report_html(&result, o.html, why);
    if (!status && o.svg)
        status = report_svg(&result, o.svg, why);
    if (!status && o.json)
        status = report_json(stdout, &result, why);
    else if (!status)
        report_table(stdout, &result);
    tradeoff_free(&result);
    return status;
}
