/* From the protocol file to C: the texts of shared/wire.h and shared/wire.c. The output is freestanding C11 without
 * loops over unknown bounds, formatted as .clang-format asks, and depends on nothing but the DBC, so that it can be
 * compared. */
#ifndef TROCAR_DBCGEN_H
#define TROCAR_DBCGEN_H

#include <stdio.h>

#include "dbc.h"

/* Write the header or the source. Returns 0, or a negative status: STATUS_FILE_WRITE when the stream fails. */
int dbcgen_header(FILE *out, const struct dbc *dbc, struct failure *why);
int dbcgen_source(FILE *out, const struct dbc *dbc, struct failure *why);

#endif
