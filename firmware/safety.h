/* States and doubts. INIT: no valid bank or no encoder yet. READY: samples arrive, torque off. RUN: torque on. SAFE: a
 * doubt was seen; torque decays to zero and the state is latched until the host acknowledges. Only safety_enable returns
 * true for torque; every doubt goes through safety_doubt. */
#ifndef TROCAR_SAFETY_H
#define TROCAR_SAFETY_H

#include <stdbool.h>
#include <stdint.h>

#include "status.h"

enum safety_state { SAFETY_INIT = 0, SAFETY_READY = 1, SAFETY_RUN = 2, SAFETY_SAFE = 3 };

enum {
    SAFETY_READY_SAMPLES = 20,   /* good samples in a row before READY */
    SAFETY_STALE_TICKS = 5,      /* ticks without a fresh sample before SAFE; up to then the last force is held, decaying */
    SAFETY_IMPLAUSIBLE_TICKS = 3, /* implausible samples in a row before SAFE */
    SAFETY_OVERRUN_TICKS = 5     /* overruns in a row before SAFE */
};

struct safety {
    enum safety_state state;
    int reason;               /* STATUS_LOOP_* that led to SAFE; 0 otherwise */
    uint8_t sequence;
    bool sequence_known;
    uint32_t good_run, stale_run, implausible_run, overrun_run;
    uint32_t missed, implausible, out_of_sequence, duplicates, overruns, nonfinite, safe_entries; /* counters */
};

#endif
