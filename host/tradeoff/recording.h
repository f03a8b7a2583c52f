/* One run, kept: the frames that a controller hears, and what its ticks see of them. Every setting is measured on the
 * same recording, so their forces and their work can be compared tick by tick. */
#ifndef TROCAR_RECORDING_H
#define TROCAR_RECORDING_H

#include <stddef.h>
#include <stdint.h>

#include "bank.h"
#include "can_frame.h"
#include "tick.h"

struct recording {
    size_t ticks;
    struct tick_input (*input)[TICK_INSTRUMENTS]; /* per tick */
    size_t frames;
    struct can_frame_t *frame; /* from device and host, in the order of their times */
    uint64_t *time_us;
    char gesture[64];
};

/* Run `gesture` on the bank with the simulated device and hand. STATUS_LOOP_SAFE when the run did not stay in RUN. */
int recording_make(const struct bank_file *bank, const char *gesture, struct recording *recording, struct failure *why);
void recording_free(struct recording *recording);

enum { REPLAY_MAX_RUNS = 16 };

/* The ticks of a recording on another bank of the same instrument: contact forces, and the time they took. */
struct replay {
    size_t ticks;
    float (*force_N)[3];    /* of the contact system, per tick */
    uint8_t *contacts;      /* per tick */
    double ns_mean, ns_max; /* per tick in contact; each tick's time is the median of the runs */
    unsigned contacts_max, factors_max;
    uint32_t solver_cuts;
    uint32_t waits; /* contacts that waited for their rows, or were held on older ones */
};
int replay_run(const struct bank_view *bank, const struct recording *recording, unsigned runs, struct replay *replay,
               struct failure *why);
void replay_free(struct replay *replay);

/* |f - f_ref| / peak |f_ref| over the ticks in which either is in contact, f held between ticks at `rate_Hz` (a divisor of
 * TICK_RATE_HZ). */
struct tick_error {
    double p95, max;
};
/* Of `count` differences, which are sorted, in parts of `peak`. */
struct tick_error tick_error_of(double *found, size_t count, double peak);
int replay_compare(const struct replay *replay, const struct replay *reference, unsigned rate_Hz,
                   struct tick_error *error, struct failure *why);

#endif
