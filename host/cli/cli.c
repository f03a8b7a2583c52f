#include "cli.h"

#include <errno.h>
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bank_format.h"

int cli_positive(const char *option, const char *text, double *value, struct failure *why)
{
    char *end;
    double x = strtod(text, &end);
    if (end == text || *end || !isfinite(x) || x <= 0)
        return failure_set(why, STATUS_USAGE, NULL, NULL, "%s takes a positive number, not \"%.60s\"", option, text);
    *value = x;
    return STATUS_OK;
}

int cli_whole(const char *option, const char *text, uint64_t low, uint64_t high, uint64_t *value, struct failure *why)
{
    char *end;
    errno = 0;
    unsigned long long n = strtoull(text, &end, 0);
    /* strtoull takes a minus sign and wraps */
    if (end == text || *end || errno || strchr(text, '-') || n < low || n > high)
        return failure_set(why, STATUS_USAGE, NULL, NULL,
                           "%s takes a whole number from %" PRIu64 " to %" PRIu64 ", not \"%.60s\"", option, low, high,
                           text);
    *value = n;
    return STATUS_OK;
}

int cli_bad_option(const char *verb, int answer, char **argv, struct failure *why)
{
    char remedy[100], letter[3] = {'-', (char)optopt, 0};
    snprintf(remedy, sizeof remedy, "see trocar %s --help", verb);
    /* an unknown long option leaves optopt 0; one that lacks its value leaves its letter or number */
    const char *word = optopt > 0 && optopt < 128 && answer == '?' ? letter : argv[optind - 1];
    return failure_set(why, STATUS_USAGE, NULL, remedy, "the option %.60s %s", word,
                       answer == ':' ? "needs a value" : "is not known");
}

int cli_each(const char *option, const char *argument, const char **values, struct failure *why)
{
    for (int i = 0; i < BANK_MAX_INSTRUMENTS; i++)
        if (!values[i]) {
            values[i] = argument;
            return STATUS_OK;
        }
    return failure_set(why, STATUS_USAGE, NULL, "leave one out", "%s is given more often than the %d instruments",
                       option, (int)BANK_MAX_INSTRUMENTS);
}

void cli_warn(const struct failure *why)
{
    failure_print(stderr, why);
}
