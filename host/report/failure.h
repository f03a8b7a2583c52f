/* How the host reports that something failed: one line that names the place, the cause and the remedy.
 *
 * A function that can fail takes a `struct failure *why`, returns STATUS_OK (0) or a negative status, and fills `why` in
 * the second case; it prints nothing. Only the command line prints (failure_print) and picks the exit code. */
#ifndef TROCAR_FAILURE_H
#define TROCAR_FAILURE_H

#include <stdio.h>

#include "status.h"

struct failure {
    int status;
    char place[300];  /* "liver.msh:12", "scene.yaml:7", or "" */
    char cause[400];  /* a clause without a final stop, with the numbers that matter */
    char remedy[300]; /* a clause in the imperative; "" takes the one of status.def */
};

/* Fill `why` and return `status`. `place` may be NULL. */
int failure_set(struct failure *why, enum status status, const char *place, const char *remedy, const char *cause, ...)
    __attribute__((format(printf, 5, 6)));

/* The same with the place "file:line" (line 0: only the file). */
int failure_at(struct failure *why, enum status status, const char *file, long line, const char *remedy,
               const char *cause, ...) __attribute__((format(printf, 6, 7)));

/* "trocar: PLACE: CAUSE; REMEDY [NAME]\n" on one line. */
void failure_print(FILE *out, const struct failure *why);

/* From status.def: "MESH_SYNTAX", its exit code, meaning and remedy; for an unknown number "UNKNOWN", 1, "", "". */
const char *status_name(int status);
int status_exit_code(int status);
const char *status_meaning(int status);
const char *status_remedy(int status);

#endif
