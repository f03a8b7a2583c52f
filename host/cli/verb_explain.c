/* trocar explain [NAME|NUMBER]: the table of status.def for people. */
#include <ctype.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "cli.h"

static const struct {
    int number;
    const char *name;
} table[] = {
#define STATUS(name, number, exit_code, meaning, remedy) {number, #name},
#include "status.def"
#undef STATUS
};
enum { ROWS = sizeof table / sizeof table[0] };

static void print(int number)
{
    printf("%s (%d, exit code %d): %s", status_name(number), number, status_exit_code(number), status_meaning(number));
    if (*status_remedy(number))
        printf("; %s", status_remedy(number));
    putchar('\n');
}

int verb_explain(int argc, char **argv, struct failure *why)
{
    if (argc > 2)
        return failure_set(why, STATUS_USAGE, NULL, "trocar explain NAME|NUMBER", "explain takes one name or number");
    if (argc == 2 && (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h"))) {
        puts("usage: trocar explain [NAME|NUMBER]\n\n"
             "What a status means and what to do about it; all of them without an argument. NAME is what stands in\n"
             "brackets at the end of a message (MESH_SYNTAX); NUMBER is the frozen number, also found in EMCY and\n"
             "health frames (-201, or 201).");
        return STATUS_OK;
    }
    if (argc < 2) {
        for (size_t i = 0; i < ROWS; i++)
            print(table[i].number);
        return STATUS_OK;
    }
    const char *word = argv[1];
    if (!strncasecmp(word, "STATUS_", 7))
        word += 7;
    char *end;
    long number = strtol(word, &end, 10);
    bool numeric = *word && !*end;
    for (size_t i = 0; i < ROWS; i++)
        if (numeric ? labs(number) == labs((long)table[i].number) : !strcasecmp(word, table[i].name)) {
            print(table[i].number);
            return STATUS_OK;
        }
    return failure_set(why, STATUS_USAGE, NULL, "trocar explain lists all", "there is no status \"%.60s\"", argv[1]);
}
