/* A recording given to a controller in this process (mirror.h): its torque frames are compared byte for byte with those of the
 * log, its state with the hashes in Health. */
#ifndef TROCAR_REPLAY_H
#define TROCAR_REPLAY_H

#include <stdio.h>

#include "candump.h"
#include "mirror.h"

struct replay_options {
    unsigned node;         /* of the first instrument; 0: the lowest of the first encoder and torque frames */
    const char *interface; /* only frames of this one; NULL: of the first line's */
};

struct replay_result {
    uint64_t frames, others; /* read; of other interfaces */
    unsigned node;           /* of the first instrument */
    uint32_t instruments;    /* the bank's; torque frames and samples are those of all */
    uint64_t first_us, last_us;
    uint64_t ticks, samples, agreed, differed, damaged, unanswered, lost_ticks, late, hashes_agreed, hashes_differed;
    uint64_t starts;
    bool joined;
    /* the first torque frame or hash that differs; line 0: none */
    long line;
    uint32_t tick;
    struct can_frame_t recorded, computed; /* torque frames; the same when only the hash differed */
    unsigned final_state;                  /* enum safety_state */
    double peak_force_N;
};

/* Which interface and node a recording is about: those of the options, else of its first line and the lowest of its first encoder
 * and torque frames. The stream is at its beginning again. STATUS_BUS_LOG when it has none. */
int replay_subject(FILE *in, const char *file, const struct replay_options *options, char interface[CANDUMP_INTERFACE],
                   unsigned *node, struct failure *why);

/* STATUS_BUS_LOG for a line that is none, or a log in which no controller ticks; STATUS_INTERRUPTED. A difference is no
 * failure. */
int replay_log(FILE *in, const char *file, const struct bank_view *bank, const struct replay_options *options,
               struct replay_result *result, struct failure *why);

#endif
