/* trocar verify BANK: its structure, then its numbers against the scene and mesh that it was built from. */
#include <getopt.h>
#include <inttypes.h>
#include <json-c/json.h>
#include <stdlib.h>

#include "bank.h"
#include "cli.h"
#include "open_bank.h"
#include "verify.h"

static const char usage[] =
    "usage: trocar verify BANK [--scene FILE] [--columns N] [--seed S] [--json] [--quiet]\n"
    "\n"
    "Checks the bank's structure as a controller would, then derives everything in it again from the scene and the\n"
    "mesh: surface, grid, instruments, contact, and N random columns of the compliance by direct solves. Ends with\n"
    "exit code 12 when something differs, or when the mesh has changed; 3 when the mesh is not found; 6 when the bank\n"
    "itself is damaged.\n"
    "\n"
    "      --scene FILE   the scene to compare with; otherwise the one inside the bank\n"
    "      --columns N    columns to recompute (8)\n"
    "      --seed S       which ones (1)\n"
    "      --json         one JSON object on stdout\n"
    "      --quiet        no progress\n";

struct options {
    const char *bank, *scene;
    uint64_t columns, seed;
    bool json, quiet, help;
};

static int parse(int argc, char **argv, struct options *o, struct failure *why)
{
    enum { SCENE = 256, COLUMNS, SEED, JSON, QUIET };
    static const struct option longs[] = {{"scene", required_argument, NULL, SCENE},
                                          {"columns", required_argument, NULL, COLUMNS},
                                          {"seed", required_argument, NULL, SEED},
                                          {"json", no_argument, NULL, JSON},
                                          {"quiet", no_argument, NULL, QUIET},
                                          {"help", no_argument, NULL, 'h'},
                                          {0}};
    int answer, status = STATUS_OK;
    opterr = 0;
    optind = 0; /* GNU: start over */
    while (!status && (answer = getopt_long(argc, argv, ":h", longs, NULL)) != -1) {
        if (answer == SCENE)
            o->scene = optarg;
        else if (answer == COLUMNS)
            status = cli_whole("--columns", optarg, 1, BANK_MAX_VERTICES, &o->columns, why);
        else if (answer == SEED)
            status = cli_whole("--seed", optarg, 0, UINT64_MAX, &o->seed, why);
        else if (answer == JSON)
            o->json = true;
        else if (answer == QUIET)
            o->quiet = true;
        else if (answer == 'h') {
            o->help = true;
            return STATUS_OK;
        } else
            return cli_bad_option("verify", answer, argv, why);
    }
    if (!status && optind != argc - 1)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar verify --help", "verify takes one bank");
    o->bank = argv[optind];
    return status;
}

/* `result` NULL: the body is not known, so only the structure was checked. */
static void print_json(const struct options *o, const struct verify_result *result, const struct failure *why)
{
    struct json_object *root = json_object_new_object();
    json_object_object_add(root, "bank", json_object_new_string(o->bank));
    json_object_object_add(root, "structure", json_object_new_boolean(1));
    json_object_object_add(root, "body_found", json_object_new_boolean(result != NULL));
    json_object_object_add(root, "agrees", json_object_new_boolean(result && !*result->differs));
    if (!result)
        json_object_object_add(root, "reason", json_object_new_string(why->cause));
    else {
        json_object_object_add(root, "seed", json_object_new_uint64(o->seed));
        json_object_object_add(root, "columns", json_object_new_int64((int64_t)result->columns));
        json_object_object_add(root, "entries", json_object_new_int64((int64_t)result->entries));
        json_object_object_add(root, "wrong", json_object_new_int64((int64_t)result->wrong));
        json_object_object_add(root, "worst_relative", json_object_new_double(result->worst_relative));
        json_object_object_add(root, "worst_in_tolerances", json_object_new_double(result->worst));
        if (*result->differs)
            json_object_object_add(root, "reason", json_object_new_string(result->differs));
    }
    puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED | JSON_C_TO_STRING_NOSLASHESCAPE));
    json_object_put(root);
}

static int verify(const struct options *o, const struct bank_file *bank, struct body *body, struct failure *why)
{
    int status = body_open(bank, o->scene, body, why);
    if (!o->json)
        printf("%s: structure, checksums, indices and numbers are good\n", o->bank);
    if (status) {
        if (o->json)
            print_json(o, NULL, why);
        return status;
    }
    struct verify_result result;
    status = bank_verify(&bank->view, body, o->columns, o->seed, o->quiet, &result, why);
    if (!status) {
        if (o->json)
            print_json(o, &result, why);
        else
            printf("against %s: %zu columns (seed %" PRIu64 "), %zu numbers, %zu wrong; largest difference %.1e of the "
                   "column's largest entry, %.2f of the tolerance\n",
                   body->scene.mesh_path, result.columns, o->seed, result.entries, result.wrong, result.worst_relative,
                   result.worst);
        if (*result.differs)
            status = failure_set(why, STATUS_CHECK_FAILED, o->bank, NULL, "%s", result.differs);
    }
    body_close(body);
    return status;
}

int verb_verify(int argc, char **argv, struct failure *why)
{
    struct options o = {.columns = 8, .seed = 1};
    int status = parse(argc, argv, &o, why);
    if (status)
        return status;
    if (o.help) {
        fputs(usage, stdout);
        return STATUS_OK;
    }
    struct bank_file bank;
    status = load_bank(o.bank, &bank, why);
    if (status)
        return status;
    struct body *body = malloc(sizeof *body);
    status =
        body ? verify(&o, &bank, body, why) : failure_set(why, STATUS_MEMORY, o.bank, NULL, "no memory for the body");
    free(body);
    bank_unload(&bank);
    return status;
}
