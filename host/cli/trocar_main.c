/* The program `trocar`: finds the verb, runs it, prints its failure on one line, exits by the class of failure. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"
#include "progress.h"

#define TROCAR_VERSION "0.1.0"

static const struct verb {
    const char *name;
    verb_function *run;
    const char *what;
} verbs[] = {
    {"mesh", verb_mesh, "read a mesh, measure it, judge whether a bank can be built from it"},
    {"build", verb_build, "build a bank from a scene or from a mesh alone"},
    {"info", verb_info, "print what a bank holds"},
    {"verify", verb_verify, "check a bank's structure, and its numbers against its scene"},
    {"run", verb_run, "run device, controller and host on a simulated bus"},
    {"device", verb_device, "put the simulated instrument on a bus"},
    {"view", verb_view, "show the organ live on a local page"},
    {"tradeoff", verb_tradeoff, "measure what accuracy costs in time and bytes"},
    {"monitor", verb_monitor, "show what passes on a bus, decoded"},
    {"record", verb_record, "write the frames of a bus as a candump log"},
    {"replay", verb_replay, "run a recording through the controller and compare its torques"},
    {"bridge", verb_bridge, "make one bus of two"},
    {"busload", verb_busload, "compute what the protocol takes of the bus"},
    {"doctor", verb_doctor, "look at what this machine can do, and say how to mend the rest"},
    {"explain", verb_explain, "say what a named or numbered status means and what to do"},
};
enum { VERBS = sizeof verbs / sizeof verbs[0] };

/* Levenshtein's distance; verbs are short, and longer words than 31 letters are no typing error. */
static unsigned edit_distance(const char *a, const char *b)
{
    size_t n = strlen(b);
    unsigned row[32];
    if (strlen(a) > 31 || n > 31)
        return 100;
    for (size_t j = 0; j <= n; j++)
        row[j] = (unsigned)j;
    for (size_t i = 1; a[i - 1]; i++) {
        unsigned diagonal = row[0];
        row[0] = (unsigned)i;
        for (size_t j = 1; j <= n; j++) {
            unsigned best = diagonal + (a[i - 1] != b[j - 1]);
            if (row[j] + 1 < best)
                best = row[j] + 1;
            if (row[j - 1] + 1 < best)
                best = row[j - 1] + 1;
            diagonal = row[j];
            row[j] = best;
        }
    }
    return row[n];
}

static void help(FILE *out)
{
    fputs("usage: trocar VERB [options]\n\n", out);
    for (size_t i = 0; i < VERBS; i++)
        fprintf(out, "  %-8s  %s\n", verbs[i].name, verbs[i].what);
    fputs(
        "\n  trocar VERB --help    options of a verb\n"
        "  trocar --version      version and licence\n\n"
        "Results go to stdout (--json: one JSON object), everything else to stderr. Exit codes: 0 success, 2 usage,\n"
        "3 file, 4 mesh, 5 scene, 6 bank, 7 model, 8 bus, 9 loop, 10 missing tool, 11 memory, 12 failed check,\n"
        "13 a limit that no bank keeps, 130 interrupted.\n\n"
        "A failure is one line on stderr; stdout may then hold no JSON. What was measured before the failure is still\n"
        "printed: mesh prints its report of a mesh that it refuses, verify its comparison, run its result.\n",
        out);
}

static int unknown_verb(const char *word, struct failure *why)
{
    size_t nearest = 0;
    unsigned distance = 100;
    for (size_t i = 0; i < VERBS; i++) {
        unsigned d = edit_distance(word, verbs[i].name);
        if (d < distance) {
            distance = d;
            nearest = i;
        }
    }
    char remedy[100] = "see trocar --help";
    if (distance <= 2)
        snprintf(remedy, sizeof remedy, "did you mean trocar %s?", verbs[nearest].name);
    return failure_set(why, STATUS_USAGE, NULL, remedy, "there is no verb \"%.60s\"", word);
}

/* The table's remedy for a wrong command line names no verb; here it is known. */
static int with_verb(const char *verb, int status, struct failure *why)
{
    if (status == STATUS_USAGE && !strcmp(why->remedy, status_remedy(STATUS_USAGE)))
        snprintf(why->remedy, sizeof why->remedy, "see trocar %s --help", verb);
    return status;
}

static int run(int argc, char **argv, struct failure *why)
{
    if (argc < 2)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar --help", "no verb is given");
    if (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h") || !strcmp(argv[1], "help")) {
        help(stdout);
        return STATUS_OK;
    }
    if (!strcmp(argv[1], "--version")) {
        puts("trocar " TROCAR_VERSION "\nGPL-3.0-or-later; no warranty");
        return STATUS_OK;
    }
    for (size_t i = 0; i < VERBS; i++)
        if (!strcmp(argv[1], verbs[i].name))
            return with_verb(verbs[i].name, verbs[i].run(argc - 1, argv + 1, why), why);
    return unknown_verb(argv[1], why);
}

int main(int argc, char **argv)
{
    struct failure why = {0};
    interrupt_install();
    int status = run(argc, argv, &why);
    if (fflush(stdout) != 0 && status >= 0)
        status = failure_set(&why, STATUS_FILE_WRITE, "stdout", NULL, "cannot write: %s", strerror(errno));
    if (status < 0) {
        if (why.status == 0)
            failure_set(&why, (enum status)status, NULL, NULL, "%s", status_meaning(status));
        failure_print(stderr, &why);
    }
    return status_exit_code(status);
}
