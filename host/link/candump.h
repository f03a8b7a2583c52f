/* Recordings: the log format of can-utils (candump -l, canplayer), one frame per line:
 *
 *   (1700000000.000123) can0 181#00112233AABBCCDD
 *
 *   (SECONDS.MICROSECONDS) six digits behind the point; seconds have ten digits when written, any number when read
 *   INTERFACE              1..15 characters without space
 *   ID#DATA                identifier in 3 hexadecimal digits (11 bits) or 8 (29 bits; 20000000 and more: an error
 *                          frame), then 0..8 bytes of two digits each; capitals when written, either when read
 *   ID#R  ID#R4            remote frame, with the length it asks for when it is not 0
 *   ID##FDATA              FD frame: one digit of flags (bit 0 bit-rate switch, bit 1 error state), then 0..64 bytes of
 *                          a length that FD has (0..8, 12, 16, 20, 24, 32, 48, 64); the flags are written as 0
 *
 * A direction mark (R or T) that newer versions append is read and ignored. Everything else is an error with file and
 * line: a recording that is replayed must be what was recorded. Empty lines are allowed. */
#ifndef TROCAR_CANDUMP_H
#define TROCAR_CANDUMP_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "can_frame.h"
#include "failure.h"

enum {
    CANDUMP_LINE = 256,     /* characters of the longest line, with its end */
    CANDUMP_INTERFACE = 16, /* with its NUL */
};

/* One line with its line feed into `line`; returns its length. */
size_t candump_format(char line[CANDUMP_LINE], const char *interface, const struct can_frame_t *frame,
                      uint64_t time_us);

/* Append a line to a stream. STATUS_FILE_WRITE. */
int candump_write(FILE *out, const char *interface, const struct can_frame_t *frame, uint64_t time_us,
                  struct failure *why);

struct candump_record {
    uint64_t time_us;
    char interface[CANDUMP_INTERFACE];
    struct can_frame_t frame;
};

/* One line without or with its line feed; `file` and `number` are for the message. STATUS_BUS_LOG. */
int candump_parse(const char *line, const char *file, long number, struct candump_record *record, struct failure *why);

/* Next frame of a stream; *number counts lines and starts at 0. Returns 1, 0 at the end, or a negative status
 * (STATUS_BUS_LOG, STATUS_FILE_READ, STATUS_INTERRUPTED). */
int candump_read(FILE *in, const char *file, long *number, struct candump_record *record, struct failure *why);

#endif
