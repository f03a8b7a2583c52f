#include "faults_option.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"

int faults_option(const char *list, struct bus_faults *faults, struct failure *why)
{
    const struct {
        const char *key;
        double *probability;
        uint32_t *number;
        uint64_t most;
    } keys[] = {
        {"drop", &faults->drop, NULL, 0},        {"duplicate", &faults->duplicate, NULL, 0},
        {"delay", &faults->delay, NULL, 0},      {"corrupt", &faults->corrupt, NULL, 0},
        {"reorder", &faults->reorder, NULL, 0},  {"delay_us", NULL, &faults->delay_us, 1000000},
        {"from", NULL, &faults->id_from, 0x7FF}, {"to", NULL, &faults->id_to, 0x7FF},
    };
    char text[200], *rest = NULL;
    if (snprintf(text, sizeof text, "%s", list) >= (int)sizeof text)
        return failure_set(why, STATUS_USAGE, NULL, NULL, "--faults: the list is too long");
    for (char *word = strtok_r(text, ",", &rest); word; word = strtok_r(NULL, ",", &rest)) {
        char *equals = strchr(word, '='), *end = NULL;
        size_t k = 0;
        if (equals)
            *equals = 0;
        while (k < sizeof keys / sizeof keys[0] && strcmp(keys[k].key, word) != 0)
            k++;
        if (!equals || k == sizeof keys / sizeof keys[0])
            return failure_set(why, STATUS_USAGE, NULL, NULL, "--faults: \"%.40s\" is not KEY=VALUE", word);
        if (keys[k].number) {
            uint64_t n = 0;
            char option[60];
            snprintf(option, sizeof option, "--faults %s", keys[k].key);
            int status = cli_whole(option, equals + 1, 0, keys[k].most, &n, why);
            if (status)
                return status;
            *keys[k].number = (uint32_t)n;
            continue;
        }
        double p = strtod(equals + 1, &end);
        if (end == equals + 1 || *end || !(p >= 0 && p <= 1))
            return failure_set(why, STATUS_USAGE, NULL, NULL,
                               "--faults: %s takes a probability from 0 to 1, not \"%.40s\"", word, equals + 1);
        *keys[k].probability = p;
    }
    return STATUS_OK;
}
