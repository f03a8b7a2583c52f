#include "csv.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "progress.h"

enum { MOST_BYTES = 1 << 28 };

static int complain(const struct csv *table, long line, struct failure *why, const char *cause)
{
    return failure_at(why, STATUS_TABLE_SYNTAX, table->path, line, NULL, "%s", cause);
}

/* [*begin, *end) without the blanks, and one pair of double quotes, around it. */
static void trim(const char **begin, const char **end)
{
    while (*begin < *end && strchr(" \t\r", **begin))
        (*begin)++;
    while (*end > *begin && strchr(" \t\r", (*end)[-1]))
        (*end)--;
    if (*end - *begin >= 2 && **begin == '"' && (*end)[-1] == '"') {
        (*begin)++;
        (*end)--;
    }
}

static int read_header(struct csv *table, const char *begin, const char *end, char separator, long line,
                       struct failure *why)
{
    for (const char *at = begin; at <= end;) {
        const char *next = memchr(at, separator, (size_t)(end - at)), *stop = next ? next : end, *from = at;
        if (table->columns == CSV_MAX_COLUMNS)
            return complain(table, line, why, "the header has more than 16 columns");
        trim(&from, &stop);
        const char *open = memchr(from, '[', (size_t)(stop - from)), *close = stop;
        const char *name_end = open ? open : stop;
        if (open && (stop[-1] != ']' || memchr(open + 1, '[', (size_t)(stop - open - 1))))
            return complain(table, line, why, "a unit in the header is not closed: write NAME [UNIT]");
        trim(&from, &name_end);
        if (name_end == from || name_end - from >= CSV_NAME || (open && close - open - 2 >= CSV_NAME))
            return complain(table, line, why, "a column of the header has no name, or one above 47 bytes");
        snprintf(table->name[table->columns], CSV_NAME, "%.*s", (int)(name_end - from), from);
        snprintf(table->unit[table->columns], CSV_NAME, "%.*s", open ? (int)(close - open - 2) : 0,
                 open ? open + 1 : "");
        table->columns++;
        at = next ? next + 1 : end + 1;
    }
    return STATUS_OK;
}

static int read_number(const struct csv *table, const char *from, const char *end, long line, size_t column,
                       double *value, struct failure *why)
{
    char text[64], *rest;
    trim(&from, &end);
    *value = NAN;
    if (from == end || (end - from == 3 && strncasecmp(from, "nan", 3) == 0))
        return STATUS_OK;
    snprintf(text, sizeof text, "%.*s", end - from < 63 ? (int)(end - from) : 63, from);
    *value = strtod(text, &rest);
    if (*rest == 0 && isfinite(*value))
        return STATUS_OK;
    return failure_at(why, STATUS_TABLE_SYNTAX, table->path, line, NULL, "'%.40s' in column '%s' is not a number", text,
                      table->name[column]);
}

static bool grow(void **memory, size_t bytes)
{
    void *larger = realloc(*memory, bytes);
    if (larger)
        *memory = larger;
    return larger != NULL;
}

static int read_row(struct csv *table, const char *begin, const char *end, char separator, long line, size_t *room,
                    struct failure *why)
{
    if (table->rows == *room) {
        size_t larger = *room ? 2 * *room : 256;
        if (!grow((void **)&table->value, larger * table->columns * sizeof *table->value) ||
            !grow((void **)&table->line, larger * sizeof *table->line))
            return failure_set(why, STATUS_MEMORY, table->path, NULL, "no memory for %zu rows", larger);
        *room = larger;
    }
    table->line[table->rows] = line;
    const char *at = begin;
    for (size_t c = 0; c < table->columns; c++) {
        const char *next = memchr(at, separator, (size_t)(end - at));
        if ((c + 1 < table->columns) != (next != NULL))
            return failure_at(why, STATUS_TABLE_SYNTAX, table->path, line, NULL,
                              "the line has %s fields than the header's %zu", next ? "more" : "fewer", table->columns);
        int status =
            read_number(table, at, next ? next : end, line, c, &table->value[table->rows * table->columns + c], why);
        if (status)
            return status;
        at = next ? next + 1 : end;
    }
    table->rows++;
    return STATUS_OK;
}

int csv_read(const char *path, struct csv *table, struct failure *why)
{
    *table = (struct csv){.rows = 0};
    snprintf(table->path, sizeof table->path, "%s", path);
    unsigned char *bytes;
    size_t length, room = 0;
    int status = file_load(path, &bytes, &length, why);
    if (status)
        return status;
    long line = 0;
    char separator = ',';
    if (length > MOST_BYTES || memchr(bytes, 0, length))
        status = complain(table, 1, why, length > MOST_BYTES ? "the table is above 256 MiB" : "this is not text");
    const char *at = (const char *)bytes, *all = at + length;
    if (length >= 3 && memcmp(at, "\xEF\xBB\xBF", 3) == 0) /* a byte order mark */
        at += 3;
    while (status == STATUS_OK && at < all) {
        const char *end = memchr(at, '\n', (size_t)(all - at));
        const char *begin = at, *stop = end ? end : all;
        line++;
        at = end ? end + 1 : all;
        const char *first = begin, *last = stop;
        trim(&first, &last);
        if (first == last || *first == '#')
            continue;
        if (table->columns == 0) {
            separator = memchr(begin, ';', (size_t)(stop - begin)) ? ';' : ',';
            status = read_header(table, begin, stop, separator, line, why);
        } else {
            status = read_row(table, begin, stop, separator, line, &room, why);
        }
    }
    free(bytes);
    if (status == STATUS_OK && table->rows == 0)
        status = complain(table, line, why, "the table has no header, or no row below it");
    return status;
}

void csv_free(struct csv *table)
{
    free(table->value);
    free(table->line);
    table->value = NULL;
    table->line = NULL;
    table->rows = 0;
}

int csv_column(const struct csv *table, const char *name, size_t *column, struct failure *why)
{
    char known[300] = "";
    size_t used = 0;
    for (size_t c = 0; c < table->columns; c++) {
        if (strcmp(table->name[c], name) == 0) {
            *column = c;
            return STATUS_OK;
        }
        if (used < sizeof known)
            used += (size_t)snprintf(known + used, sizeof known - used, "%s%s", c ? ", " : "", table->name[c]);
    }
    return failure_at(why, STATUS_TABLE_SYNTAX, table->path, 0, NULL, "the table has no column '%s'; it has: %s", name,
                      known);
}
