/* A table of numbers as text: fields split by commas (or semicolons, when the header has one), one header line that names
 * the columns, each with its unit in brackets: "omega [rad/s], G' [Pa], G'' [Pa]". Lines that are empty or begin with # are
 * skipped. An empty field or "nan" is a missing value (NaN); everything else must be a finite number. */
#ifndef TROCAR_CSV_H
#define TROCAR_CSV_H

#include <stddef.h>

#include "failure.h"

enum { CSV_MAX_COLUMNS = 16, CSV_NAME = 48 };

struct csv {
    char path[1024];
    size_t columns, rows;
    char name[CSV_MAX_COLUMNS][CSV_NAME], unit[CSV_MAX_COLUMNS][CSV_NAME]; /* unit "": none is written */
    double *value;                                                         /* rows by columns */
    long *line;                                                            /* of the file, per row */
};

/* STATUS_FILE_*, or STATUS_TABLE_SYNTAX with the line. At most 256 MiB. Free with csv_free, also after a failure. */
int csv_read(const char *path, struct csv *table, struct failure *why);
void csv_free(struct csv *table);

/* Number of the column of that name, or STATUS_TABLE_SYNTAX: the header lacks it. */
int csv_column(const struct csv *table, const char *name, size_t *column, struct failure *why);

#endif
