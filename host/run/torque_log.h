/* The torque frames of a run as a candump log ("(seconds.microseconds) soft 201#0011223344556677", one frame per line)
 * and the SHA-256 of exactly those bytes, computed on the way whether or not a file is written. The file appears under
 * its name only when it is complete. */
#ifndef TROCAR_TORQUE_LOG_H
#define TROCAR_TORQUE_LOG_H

#include <stdint.h>
#include <stdio.h>

#include "can_frame.h"
#include "failure.h"

struct torque_log {
    FILE *file; /* NULL: only the hash */
    char *path, *temporary;
    const char *interface; /* as candump names it; NULL: soft */
    void *digest;          /* EVP_MD_CTX */
    uint64_t frames;
    int error; /* errno of the first write that failed */
};

/* `path` NULL: only the hash. */
int torque_log_open(struct torque_log *log, const char *path, struct failure *why);
void torque_log_frame(struct torque_log *log, const struct can_frame_t *frame, uint64_t time_us);
/* Finish: rename the file into place, give the hash in hexadecimal. The log is closed in any case. */
int torque_log_close(struct torque_log *log, char sha256[65], struct failure *why);
/* Give up: nothing is left behind. Harmless on a log that is closed. */
void torque_log_discard(struct torque_log *log);

#endif
