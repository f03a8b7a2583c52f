/* trocar build MESH|SCENE: a bank from a scene, or from a mesh alone in the scene that is assumed and printed. */
#include <getopt.h>
#include <json-c/json.h>
#include <stdlib.h>
#include <string.h>

#include "bank.h"
#include "cli.h"
#include "open_bank.h"
#include "output.h"

static const char usage[] =
    "usage: trocar build SCENE.yaml -o BANK [--order ORDER] [--step X | --force-error P | --plain] [--json] [--quiet]\n"
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
    "      --force-error P  the smallest bank whose forces are off by at most P: 0.5%, or 0.005 (95 % of patches of 3 "
    "to "
    "10\n"
    "                       contacts)\n"
    "      --plain          the compliance uncompressed, as float32\n"
    "      --order ORDER    of the elements: linear, or quadratic, which are not too stiff; the scene's, else "
    "quadratic\n"
    "      --json           one JSON object on stdout; an assumed scene then goes to stderr\n"
    "      --quiet          no progress\n";

struct options {
    const char *input, *output;
    double extent_m, size_m;
    enum mesh_unit unit;
    bool order_given;
    enum element_order order;
    struct compression compression;
    bool json, quiet, help;
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
        return failure_set(why, STATUS_USAGE, NULL, NULL, "--force-error is a share such as 0.5%%, not \"%.60s\"",
                           text);
    *share = percent ? value / 100 : value;
    return STATUS_OK;
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
    enum { EXTENT = 256, UNIT, SIZE, ORDER, STEP, FORCE_ERROR, PLAIN, JSON, QUIET };
    static const struct option longs[] = {
        {"output", required_argument, NULL, 'o'}, {"extent", required_argument, NULL, EXTENT},
        {"unit", required_argument, NULL, UNIT},  {"size", required_argument, NULL, SIZE},
        {"json", no_argument, NULL, JSON},        {"quiet", no_argument, NULL, QUIET},
        {"step", required_argument, NULL, STEP},  {"force-error", required_argument, NULL, FORCE_ERROR},
        {"plain", no_argument, NULL, PLAIN},      {"order", required_argument, NULL, ORDER},
        {"help", no_argument, NULL, 'h'},         {0}};
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
            status = parse_share(optarg, &o->compression.force_error, why);
        else if (answer == PLAIN)
            o->compression.plain = true;
        else if (answer == ORDER)
            status = parse_order(optarg, o, why);
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
    if (o->compression.plain + (o->compression.step > 0) + (o->compression.force_error > 0) > 1)
        return failure_set(why, STATUS_USAGE, NULL, "give one of them",
                           "--step, --force-error and --plain exclude each other");
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

static void print_json(const struct build_result *r, const char *path)
{
    struct json_object *root = json_object_new_object(), *error = json_object_new_object();
    json_object_object_add(root, "bank", json_object_new_string(path));
    json_object_object_add(root, "nodes", json_object_new_int64((int64_t)r->nodes));
    json_object_object_add(root, "elements", json_object_new_int64((int64_t)r->elements));
    json_object_object_add(root, "surface_nodes", json_object_new_int64((int64_t)r->surface_nodes));
    json_object_object_add(root, "free_surface_nodes", json_object_new_int64((int64_t)r->rows));
    json_object_object_add(root, "unknowns", json_object_new_int64((int64_t)r->unknowns));
    json_object_object_add(root, "bytes", json_object_new_int64((int64_t)r->bytes));
    json_object_object_add(root, "seconds", json_object_new_double(r->seconds));
    json_object_object_add(root, "peak_rss_bytes", json_object_new_int64((int64_t)r->peak_rss_bytes));
    json_object_object_add(root, "median_compliance_m_N", json_object_new_double(r->median_compliance_m_N));
    json_object_object_add(root, "discretisation", json_object_new_string(r->discretisation));
    json_object_object_add(error, "reference", json_object_new_string(COMPRESSION_ERROR_REFERENCE));
    json_object_object_add(error, "p95", json_object_new_double(r->force_error_p95));
    json_object_object_add(error, "max", json_object_new_double(r->force_error_max));
    for (int k = 0; k < COMPRESSION_ERROR_KINDS; k++) {
        struct json_object *kind = json_object_new_object();
        json_object_object_add(kind, "p95", json_object_new_double(r->error.of[k].p95));
        json_object_object_add(kind, "max", json_object_new_double(r->error.of[k].max));
        json_object_object_add(error, compression_error_kind[k], kind);
    }
    json_object_object_add(root, "force_error", error);
    if (r->step > 0)
        json_object_object_add(root, "step", json_object_new_double(r->step));
    puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED | JSON_C_TO_STRING_NOSLASHESCAPE));
    json_object_put(root);
}

static void print_text(FILE *out, const struct build_result *r, const char *path)
{
    char measured[200];
    compression_error_print(&r->error, measured, sizeof measured);
    fprintf(out,
            "%s: %zu nodes, %zu tetrahedra (%s), %zu surface nodes (%zu free)\n"
            "%zu bytes, built in %.1f s with at most %.0f MB\n"
            "force error in %% (p95, max): %s; against the %s\n",
            path, r->nodes, r->elements, r->discretisation, r->surface_nodes, r->rows, r->bytes, r->seconds,
            1e-6 * r->peak_rss_bytes, measured, COMPRESSION_ERROR_REFERENCE);
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
    if (!scene)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the scene");
    status = get_scene(&o, scene, why);
    if (!status)
        status = check_bank_output(o.output, o.input, scene, why);
    if (!status && o.order_given)
        scene->order = o.order;
    if (!status)
        status = bank_build(scene, o.output, &o.compression, o.quiet, &result, why);
    char *assumed = !status && !is_scene(o.input) ? scene_print(scene) : NULL;
    free(scene);
    if (status)
        return status;
    if (assumed)
        fputs(assumed, o.json ? stderr : stdout);
    free(assumed);
    if (o.json)
        print_json(&result, o.output);
    else
        print_text(is_scene(o.input) ? stdout : stderr, &result, o.output);
    return STATUS_OK;
}
