/* A recording being written: a candump log (candump.h) that is whole lines at every moment, so that what was recorded before
 * an interrupt, a full disk or the end of the process can be replayed. Lines are handed to the system at most
 * RECORDING_FLUSH_MS after their frame; a process that is killed outright loses at most that. */
#ifndef TROCAR_RECORDING_H
#define TROCAR_RECORDING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "candump.h"
#include "failure.h"

enum { RECORDING_FLUSH_MS = 100, RECORDING_BUFFER = 1 << 16 };

struct recording {
    int descriptor;
    const char *path;
    uint64_t frames, bytes;
    double flushed_s;
    size_t length;
    char buffer[RECORDING_BUFFER];
};

/* A new file at `path` ("-": standard output), or with `append` the end of one that is there. What exists is not overwritten,
 * and appended to only when it ends with a whole line of a log. STATUS_FILE_WRITE, STATUS_BUS_LOG (with the line). */
int recording_open(struct recording *recording, const char *path, bool append, struct failure *why);
int recording_frame(struct recording *recording, const char *interface, const struct can_frame_t *frame,
                    uint64_t time_us, struct failure *why);
/* Hand over what waits; call it when nothing comes. */
int recording_flush(struct recording *recording, struct failure *why);
/* Flush, write through to the disk, close. */
int recording_close(struct recording *recording, struct failure *why);

#endif
