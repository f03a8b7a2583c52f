#include "failure.h"

#include <stdarg.h>
#include <string.h>

static const struct {
    int number, exit_code;
    const char *name, *meaning, *remedy;
} table[] = {
#define STATUS(name, number, exit_code, meaning, remedy) {number, exit_code, #name, meaning, remedy},
#include "status.def"
#undef STATUS
};

static int row(int status)
{
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++)
        if (table[i].number == status)
            return (int)i;
    return -1;
}

const char *status_name(int status)
{
    int i = row(status);
    return i < 0 ? "UNKNOWN" : table[i].name;
}

int status_exit_code(int status)
{
    int i = row(status > 0 ? 0 : status);
    return i < 0 ? 1 : table[i].exit_code;
}

const char *status_meaning(int status)
{
    int i = row(status);
    return i < 0 ? "" : table[i].meaning;
}

const char *status_remedy(int status)
{
    int i = row(status);
    return i < 0 ? "" : table[i].remedy;
}

static int fill(struct failure *why, enum status status, const char *place, const char *remedy, const char *cause,
                va_list arguments)
{
    why->status = status;
    snprintf(why->place, sizeof why->place, "%s", place ? place : "");
    vsnprintf(why->cause, sizeof why->cause, cause, arguments);
    snprintf(why->remedy, sizeof why->remedy, "%s", remedy && *remedy ? remedy : status_remedy(status));
    return status;
}

int failure_set(struct failure *why, enum status status, const char *place, const char *remedy, const char *cause, ...)
{
    va_list arguments;
    va_start(arguments, cause);
    fill(why, status, place, remedy, cause, arguments);
    va_end(arguments);
    return status;
}

int failure_at(struct failure *why, enum status status, const char *file, long line, const char *remedy,
               const char *cause, ...)
{
    char place[300];
    if (line > 0)
        snprintf(place, sizeof place, "%.270s:%ld", file, line);
    else
        snprintf(place, sizeof place, "%.280s", file);
    va_list arguments;
    va_start(arguments, cause);
    fill(why, status, place, remedy, cause, arguments);
    va_end(arguments);
    return status;
}

/* Bad input may hold control characters; they must not reach the terminal or break the line. */
static void put_clean(FILE *out, const char *text)
{
    for (; *text; text++)
        fputc((unsigned char)*text < 32 || *text == 127 ? '?' : *text, out);
}

void failure_print(FILE *out, const struct failure *why)
{
    fputs("trocar: ", out);
    if (*why->place) {
        put_clean(out, why->place);
        fputs(": ", out);
    }
    put_clean(out, why->cause);
    if (*why->remedy) {
        fputs("; ", out);
        put_clean(out, why->remedy);
    }
    fprintf(out, " [%s]\n", status_name(why->status));
}
