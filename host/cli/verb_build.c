/* trocar build MESH|SCENE: a bank from a scene, or from a mesh alone in the scene that is assumed and printed. */
#include <getopt.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bank.h"
#include "build_report.h"
#include "cli.h"
#include "open_bank.h"
#include "output.h"
#include "quasi_nonlinear_report.h"
#include "viscoelastic_report.h"
#include "quantity.h"

static const char usage[] =
    "usage: trocar build SCENE.yaml -o BANK [--order ORDER] [--max-bytes N] [--max-instructions N]\n"
    "                    [--max-force-error P] [--step X | --plain] [--json] [--quiet]\n"
    "       trocar build MESH --extent METRES | --unit m|cm|mm [--size METRES] -o BANK ...\n"
    "\n"
    "Builds the bank that a controller reads. With a mesh alone, the scene that is assumed (tissue E = 4 kPa, nu = "
    "0.45,\n"
    "rho = 1060 kg/m3, 4 % of the surface fixed at the end of the longest axis, one instrument above the middle) is\n"
    "printed as YAML, ready to be saved, edited and built.\n"
    "\n"
    "  -o, --output BANK    the file to write\n"
    "      --extent METRES  length of the longest side of the body's box\n"
    "      --unit UNIT      unit of the mesh's coordinates: m, cm or mm\n"
    "      --size METRES    element size with which a surface (STL, OBJ, PLY) is filled; its own triangles if not "
    "given\n"
    "      --step X         rounding of the compliance's factor relative to its median diagonal: 2e-5 (fine) to 0.05\n"
    "                       (coarse); 1.25e-3 if nothing is asked for\n"
    "      --max-bytes N    the bank with the least force error that has at most N bytes, everything included; also\n"
    "                       \"512 KiB\"\n"
    "      --max-force-error P  forces off by at most P: 0.5%, or 0.005 (95 % of patches of 3 to 10 contacts); alone, "
    "the\n"
    "                       smallest such bank\n"
    "      --max-instructions N  at most N instructions in the worst tick of a Cortex-M7, by fewer rows decoded in "
    "one\n"
    "                       A limit given here takes the place of the scene's budget. Limits that cannot be met end "
    "with\n"
    "                       exit code 13 and name the nearest that can; nothing is written then\n"
    "      --plain          the compliance uncompressed, as float32\n"
    "      --order ORDER    of the elements: linear, or quadratic, which are not too stiff; the scene's, else "
    "quadratic\n"
    "      --resume         keep the compliance in BANK.part however short it took (else from 20 s on), so that an\n"
    "                       interrupted build goes on from there; it is found without this option, too\n"
    "      --json           one JSON object on stdout; an assumed scene then goes to stderr\n"
    "      --quiet          no progress\n";

struct options {
    const char *input, *output;
    double extent_m, size_m;
    enum mesh_unit unit;
    double max_bytes, max_instructions, max_force_error; /* 0: as the scene says */
    bool order_given;
    enum element_order order;
    struct compression compression;
    bool resume, json, quiet, help;
};

static int parse_unit(const char *text, enum mesh_unit *unit, struct failure *why)
{
    static const struct {
        const char *name;
        enum mesh_unit unit;
    } units[] = {{"m", MESH_UNIT_M}, {"cm", MESH_UNIT_CM}, {"mm", MESH_UNIT_MM}};
    for (size_t k = 0; k < sizeof units / sizeof units[0]; k++)
        if (!strcmp(text, units[k].name)) {
            *unit = units[k].unit;
            return STATUS_OK;
        }
    return failure_set(why, STATUS_USAGE, NULL, NULL, "--unit is m, cm or mm, not \"%.60s\"", text);
}

static int parse_step(const char *text, double *step, struct failure *why)
{
    int status = cli_positive("--step", text, step, why);
    if (!status && (*step < COMPRESSION_STEP_MIN || *step > COMPRESSION_STEP_MAX))
        return failure_set(why, STATUS_USAGE, NULL, NULL, "--step is between %g and %g, not %s", COMPRESSION_STEP_MIN,
                           COMPRESSION_STEP_MAX, text);
    return status;
}

/* A share as "0.5%", "0.5 %" or "0.005". */
static int parse_share(const char *text, double *share, struct failure *why)
{
    char *end;
    double value = strtod(text, &end);
    while (end > text && *end == ' ')
        end++;
    bool percent = *end == '%' && !end[1];
    if (end == text || (*end && !percent) || !(value > 0) || !(value < (percent ? 100 : 1)))
        return failure_set(why, STATUS_USAGE, NULL, NULL, "--max-force-error is a share such as 0.5%%, not \"%.60s\"",
                           text);
    *share = percent ? value / 100 : value;
    return STATUS_OK;
}

/* A number of bytes, or a size with its unit. */
static int parse_bytes(const char *text, double *bytes, struct failure *why)
{
    char *end, message[200];
    double value = strtod(text, &end);
    bool good =
        end > text && !*end ? true : quantity_parse(text, DIMENSION_BYTES, &value, message, sizeof message) == 0;
    if (!good || !(value >= 1) || !(value < 4294967296.0))
        return failure_set(why, STATUS_USAGE, NULL, NULL,
                           "--max-bytes is a size such as 524288 or \"512 KiB\", not \"%.60s\"", text);
    *bytes = floor(value);
    return STATUS_OK;
}

static int parse_instructions(const char *text, double *instructions, struct failure *why)
{
    uint64_t value = 0;
    int status = cli_whole("--max-instructions", text, 1, 1000000000000u, &value, why);
    *instructions = (double)value;
    return status;
}

static int parse_order(const char *text, struct options *o, struct failure *why)
{
    o->order_given = true;
    o->order = !strcmp(text, "quadratic") ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
    if (o->order == ELEMENT_LINEAR && strcmp(text, "linear") != 0)
        return failure_set(why, STATUS_USAGE, NULL, NULL, "--order is linear or quadratic, not \"%.60s\"", text);
    return STATUS_OK;
}

static int parse(int argc, char **argv, struct options *o, struct failure *why)
{
    enum { EXTENT = 256, UNIT, SIZE, ORDER, STEP, FORCE_ERROR, BYTES, INSTRUCTIONS, PLAIN, RESUME, JSON, QUIET };
    static const struct option longs[] = {{"output", required_argument, NULL, 'o'},
                                          {"extent", required_argument, NULL, EXTENT},
                                          {"unit", required_argument, NULL, UNIT},
                                          {"size", required_argument, NULL, SIZE},
                                          {"resume", no_argument, NULL, RESUME},
                                          {"json", no_argument, NULL, JSON},
                                          {"quiet", no_argument, NULL, QUIET},
                                          {"step", required_argument, NULL, STEP},
                                          {"max-force-error", required_argument, NULL, FORCE_ERROR},
                                          {"max-bytes", required_argument, NULL, BYTES},
                                          {"max-instructions", required_argument, NULL, INSTRUCTIONS},
                                          {"plain", no_argument, NULL, PLAIN},
                                          {"order", required_argument, NULL, ORDER},
                                          {"help", no_argument, NULL, 'h'},
                                          {0}};
    int answer, status = STATUS_OK;
    opterr = 0;
    optind = 0; /* GNU: start over */
    while (!status && (answer = getopt_long(argc, argv, ":o:h", longs, NULL)) != -1) {
        if (answer == 'o')
            o->output = optarg;
        else if (answer == EXTENT)
            status = cli_positive("--extent", optarg, &o->extent_m, why);
        else if (answer == UNIT)
            status = parse_unit(optarg, &o->unit, why);
        else if (answer == SIZE)
            status = cli_positive("--size", optarg, &o->size_m, why);
        else if (answer == STEP)
            status = parse_step(optarg, &o->compression.step, why);
        else if (answer == FORCE_ERROR)
            status = parse_share(optarg, &o->max_force_error, why);
        else if (answer == BYTES)
            status = parse_bytes(optarg, &o->max_bytes, why);
        else if (answer == INSTRUCTIONS)
            status = parse_instructions(optarg, &o->max_instructions, why);
        else if (answer == PLAIN)
            o->compression.plain = true;
        else if (answer == ORDER)
            status = parse_order(optarg, o, why);
        else if (answer == RESUME)
            o->resume = true;
        else if (answer == JSON)
            o->json = true;
        else if (answer == QUIET)
            o->quiet = true;
        else if (answer == 'h') {
            o->help = true;
            return STATUS_OK;
        } else
            return cli_bad_option("build", answer, argv, why);
    }
    if (status)
        return status;
    if (optind != argc - 1)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar build --help",
                           optind == argc ? "no mesh and no scene is given" : "more than one mesh or scene is given");
    if (!o->output)
        return failure_set(why, STATUS_USAGE, NULL, "add -o BANK", "no output file is given");
    if (o->compression.plain && o->compression.step > 0)
        return failure_set(why, STATUS_USAGE, NULL, "give one of them", "--step and --plain exclude each other");
    if (o->extent_m > 0 && o->unit)
        return failure_set(why, STATUS_USAGE, NULL, "give one of them", "--extent and --unit exclude each other");
    o->input = argv[optind];
    return STATUS_OK;
}

static int get_scene(const struct options *o, struct scene *scene, struct failure *why)
{
    char head[4];
    size_t length;
    int status = file_head(o->input, head, sizeof head, &length, why);
    if (status)
        return status;
    if (length == sizeof head && !memcmp(head, "TRCB", sizeof head))
        return failure_set(why, STATUS_MESH_FORMAT, o->input, "give the mesh or the scene that it was built from",
                           "this is a bank, not a mesh or a scene");
    if (is_scene(o->input)) {
        if (o->extent_m > 0 || o->unit || o->size_m > 0)
            return failure_set(why, STATUS_USAGE, o->input, "write it under body: mesh: there",
                               "--extent, --unit and --size are for a mesh; a scene says its own");
        return scene_read(o->input, scene, why);
    }
    if (!(o->extent_m > 0) && !o->unit)
        return failure_set(why, STATUS_MESH_SIZE, o->input, NULL, "the mesh's length unit is not given");
    scene_assume(o->input, o->extent_m, o->unit, scene);
    scene->surface_size_m = o->size_m;
    return STATUS_OK;
}

/* Limits become the scene's budget, so that the bank's own scene says them. */
static void set_limits(const struct options *o, struct scene *scene)
{
    if (o->max_bytes > 0)
        scene->budget_bank_bytes = o->max_bytes;
    if (o->max_instructions > 0)
        scene->budget_instructions = o->max_instructions;
    if (o->max_force_error > 0)
        scene->budget_force_error = o->max_force_error;
}

int verb_build(int argc, char **argv, struct failure *why)
{
    struct options o = {0};
    int status = parse(argc, argv, &o, why);
    if (status)
        return status;
    if (o.help) {
        fputs(usage, stdout);
        return STATUS_OK;
    }
    struct scene *scene = calloc(1, sizeof *scene);
    struct build_result result;
    struct row_cost cost = {0};
    if (!scene)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the scene");
    status = get_scene(&o, scene, why);
    if (!status)
        status = check_bank_output(o.output, o.input, scene, why);
    if (!status && o.order_given)
        scene->order = o.order;
    if (!status)
        set_limits(&o, scene);
    if (!status)
        status = viscoelastic_report(scene, o.output, o.quiet ? NULL : stderr, why);
    if (!status)
        status = quasi_nonlinear_report(scene, o.output, o.quiet ? NULL : stderr, why);
    if (!status)
        status = bank_build(scene, o.output, &o.compression, o.resume ? 0 : BANK_KEEP_AFTER_S, o.quiet, &result, why);
    if (!status && result.row_work)
        status = row_cost_measure(o.output, &cost, why);
    char *assumed = !status && !is_scene(o.input) ? scene_print(scene) : NULL;
    const struct build_report report = {
        o.output, &result, &cost, scene->budget_bank_bytes, scene->budget_instructions, scene->budget_force_error};
    free(scene);
    if (status)
        return status;
    if (assumed)
        fputs(assumed, o.json ? stderr : stdout);
    free(assumed);
    if (o.json)
        build_report_json(stdout, &report);
    else
        build_report_text(is_scene(o.input) ? stdout : stderr, &report);
    return STATUS_OK;
}
