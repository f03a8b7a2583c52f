/* Progress of a long step on stderr: a bar with the time left on a terminal, a line per tenth otherwise; and the flag
 * that Ctrl-C raises. Writing a result file: to a temporary beside it, then renamed, so that an interrupt or a full
 * disk leaves the old file or none. */
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

/* The same piece by piece, for a file that does not fit in memory twice:
 *   file_begin, file_append ..., file_patch ..., then file_commit or file_abandon
 * Until file_commit nothing is visible at `path`. Where the file system can (O_TMPFILE), the temporary has no name, so
 * that not even a killed process leaves one. A path that exists and is not a regular file is refused. After a failure
 * call file_abandon; it may be called at any time, also twice. */
struct file_writer {
    int descriptor; /* readable too: what was appended may be mapped before the commit */
    size_t length;
    char *path, *temporary;
    bool named; /* the temporary has its name already */
};
int file_begin(struct file_writer *writer, const char *path, struct failure *why);
int file_append(struct file_writer *writer, const void *bytes, size_t length, struct failure *why);
int file_patch(struct file_writer *writer, size_t offset, const void *bytes, size_t length, struct failure *why);
int file_commit(struct file_writer *writer, struct failure *why);
void file_abandon(struct file_writer *writer);

/* Whole file into memory (malloc, NUL-terminated behind `length`). */
int file_load(const char *path, unsigned char **bytes, size_t *length, struct failure *why);

#endif
