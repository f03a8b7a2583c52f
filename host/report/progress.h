/* Progress of a long step on stderr: a bar with the time left on a terminal, a line per tenth otherwise; and the flag that
 * Ctrl-C raises. Writing a result file: to a temporary beside it, then renamed, so that an interrupt or a full disk leaves
 * the old file or none. */
#ifndef TROCAR_PROGRESS_H
#define TROCAR_PROGRESS_H

#include <stdbool.h>
#include <stddef.h>

#include "failure.h"

struct progress {
    const char *what;
    double started_s, shown_fraction;
    bool terminal, quiet;
};

void progress_start(struct progress *bar, const char *what, bool quiet);
void progress_show(struct progress *bar, double fraction); /* 0..1; cheap to call often */
void progress_end(struct progress *bar);

/* Install handlers for SIGINT and SIGTERM once; long loops poll interrupted() and return STATUS_INTERRUPTED. */
void interrupt_install(void);
bool interrupted(void);

double seconds_now(void); /* monotonic */

/* Write `length` bytes to `path` by temporary file, fsync and rename. */
int file_replace(const char *path, const void *bytes, size_t length, struct failure *why);
/* Whole file into memory (malloc, NUL-terminated behind `length`). */
int file_load(const char *path, unsigned char **bytes, size_t *length, struct failure *why);

#endif
