/* trocar doctor: what this machine can do, and the command for what it cannot. */
#include <getopt.h>
#include <json-c/json.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli.h"
#include "doctor.h"

static const char usage[] = "usage: trocar doctor [--json]\n"
                            "\n"
                            "Looks at this machine: what building, running and viewing need, CAN, real time, "
                            "emulators; and says for every \"no\" the\n"
                            "command that helps. It changes nothing.\n"
                            "\n"
                            "      --json   one JSON object on stdout\n"
                            "\n"
                            "Exit code 10: something is missing that the default path (build, run, view) needs.\n";

static const char *answer_name(enum doctor_answer answer)
{
    return answer == DOCTOR_YES ? "yes" : answer == DOCTOR_PARTLY ? "partly" : "no";
}

static void print_text(const struct doctor *doctor)
{
    const char *group = "";
    for (size_t i = 0; i < doctor->count; i++) {
        const struct doctor_check *c = &doctor->check[i];
        if (strcmp(group, c->group) != 0)
            printf("%s%s\n", *group ? "\n" : "", c->group);
        group = c->group;
        printf("  %-6s  %-20s %s (for %s%s)\n", answer_name(c->answer), c->name, c->found, c->use,
               c->needed ? "; needed" : "");
        if (*c->fix)
            printf("          %20s %s\n", "->", c->fix);
    }
}

static void print_json(const struct doctor *doctor)
{
    struct json_object *root = json_object_new_object(), *checks = json_object_new_array();
    bool ready = true;
    for (size_t i = 0; i < doctor->count; i++) {
        const struct doctor_check *c = &doctor->check[i];
        struct json_object *entry = json_object_new_object();
        json_object_object_add(entry, "group", json_object_new_string(c->group));
        json_object_object_add(entry, "name", json_object_new_string(c->name));
        json_object_object_add(entry, "use", json_object_new_string(c->use));
        json_object_object_add(entry, "needed", json_object_new_boolean(c->needed));
        json_object_object_add(entry, "answer", json_object_new_string(answer_name(c->answer)));
        json_object_object_add(entry, "found", json_object_new_string(c->found));
        json_object_object_add(entry, "fix", json_object_new_string(c->fix));
        json_object_array_add(checks, entry);
        ready &= !c->needed || c->answer == DOCTOR_YES;
    }
    json_object_object_add(root, "ready", json_object_new_boolean(ready));
    json_object_object_add(root, "checks", checks);
    puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED | JSON_C_TO_STRING_NOSLASHESCAPE));
    json_object_put(root);
}

int verb_doctor(int argc, char **argv, struct failure *why)
{
    static const struct option longs[] = {{"json", no_argument, NULL, 'j'}, {"help", no_argument, NULL, 'h'}, {0}};
    bool json = false;
    opterr = 0;
    optind = 0; /* GNU: start over */
    for (int answer; (answer = getopt_long(argc, argv, ":h", longs, NULL)) != -1;) {
        if (answer == 'h') {
            fputs(usage, stdout);
            return STATUS_OK;
        }
        if (answer != 'j')
            return cli_bad_option("doctor", answer, argv, why);
        json = true;
    }
    if (optind != argc)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar doctor --help", "doctor takes no file");
    char program[300] = "";
    const ssize_t n = readlink("/proc/self/exe", program, sizeof program - 1);
    program[n > 0 ? n : 0] = 0;
    struct doctor *doctor = malloc(sizeof *doctor);
    if (!doctor)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the checks");
    doctor_look(doctor, &(struct doctor_place){.root = "", .program = program});
    (json ? print_json : print_text)(doctor);
    int status = STATUS_OK;
    for (size_t i = 0; !status && i < doctor->count; i++) {
        const struct doctor_check *c = &doctor->check[i];
        if (c->needed && c->answer != DOCTOR_YES)
            status = failure_set(why, STATUS_TOOL_MISSING, c->name, c->fix, "%s needs it: %s", c->use, c->found);
    }
    free(doctor);
    return status;
}
