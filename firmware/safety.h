/* States and doubts.
 *
 *   INIT   no good encoder samples yet              silent
 *   READY  samples are good                         silent; the host may start
 *   RUN    torque on
 *   SAFE   a doubt was seen: torque decays to zero, then off; latched until the host acknowledges
 *
 *   INIT -> READY   SAFETY_READY_SAMPLES good samples in a row
 *   READY -> RUN    the host starts (acknowledges) while samples are good
 *   RUN -> SAFE     any doubt; READY -> INIT on the same
 *   SAFE -> READY   the host acknowledges, and samples are good again, and the force is gone
 *
 * Torque is allowed by safety_torque alone. */
#ifndef TROCAR_SAFETY_H
#define TROCAR_SAFETY_H

#include <stdbool.h>
#include <stdint.h>

#include "status.h"

enum safety_state { SAFETY_INIT = 0, SAFETY_READY = 1, SAFETY_RUN = 2, SAFETY_SAFE = 3 };

enum {
    SAFETY_READY_SAMPLES = 20, /* good samples in a row before READY */
    SAFETY_STALE_TICKS = 5,    /* ticks without a usable sample before SAFE; until then the force decays */
    SAFETY_LOSS = 300,         /* of a bucket that a tick without a sample fills by 3 and every tick drains by 1: more
                                     than a third lost for long is SAFE too */
    SAFETY_IMPLAUSIBLE_TICKS = 3, /* implausible samples in a row before SAFE */
    SAFETY_OVERRUN_TICKS = 5      /* overruns in a row before SAFE */
};

struct safety {
    enum safety_state state;
    int reason; /* STATUS_LOOP_* that led to SAFE; 0 otherwise */
    uint8_t sequence;
    bool sequence_known;
    uint32_t since_sample; /* ticks without any sample since the last usable one; refused samples do not count */
    uint32_t loss;         /* the bucket of SAFETY_LOSS */
    uint32_t good_run, stale_run, discarded_run, implausible_run, overrun_run;
    /* counters; they only rise */
    uint32_t missed; /* ticks without a usable sample */
    uint32_t implausible, out_of_sequence, duplicates, overruns, nonfinite, safe_entries;
};

/* Is this sample newer than the last? Duplicates and older ones are counted and refused. Four bits of sequence: up to
 * seven lost frames in a row still read as newer. */
bool safety_sequence(struct safety *s, uint8_t sequence);

/* After the sample was judged: `fresh` arrived in time and in sequence, `plausible` passed the kinematics. Updates runs,
 * counters and state. */
void safety_update(struct safety *s, bool fresh, bool plausible, bool overrun);

/* The host's wish to go on: READY -> RUN, SAFE -> READY. `settled`: the force has decayed to zero. */
void safety_acknowledge(struct safety *s, bool settled);

/* A reason to stop: RUN -> SAFE, READY -> INIT. */
void safety_doubt(struct safety *s, enum status reason);

/* The only permission for torque: in RUN, and in SAFE while the force decays. */
bool safety_torque(const struct safety *s);

#endif
