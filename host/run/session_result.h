/* What a run came to, instrument by instrument and in all. */
#ifndef TROCAR_SESSION_RESULT_H
#define TROCAR_SESSION_RESULT_H

#include <stdbool.h>
#include <stdint.h>

#include "bus.h"
#include "bank_format.h"
#include "safety.h"

enum { SESSION_INSTRUMENTS = BANK_MAX_INSTRUMENTS };

/* Of one instrument. */
struct session_instrument {
    char name[32]; /* in the scene; "" when the bank does not tell */
    uint64_t contact_ticks;
    double peak_force_N;         /* of the force rendered: after damping, clamp, rate limit */
    double peak_contact_force_N; /* of the contact system's */
    double max_depth_m;          /* of a tool point below the rest surface */
    unsigned max_contacts;
    double peak_fem_force_N, force_error_vs_fem; /* as below, of this one's force and its peak; when fem_known */
    double from_other_N;  /* largest part of its force that is there only because of the other; when fem_known */
    struct safety safety; /* state, reason, counters */
    uint32_t clamps, rate_limits, passivity_interventions;
    uint32_t device_rejected, device_late, device_silences; /* torque frames; motors dropped */
    uint64_t link_malformed, link_incomplete;               /* host */
    bool ran;                                               /* RUN was reached */
};

/* Of the run: counts are the sums over the instruments, forces the largest. */
struct session_result {
    uint64_t ticks, missed; /* missed: ticks without a usable encoder sample, after the first good ones */
    uint64_t
        late_ticks; /* in real time: ticks that the machine began more than a tick late; no matter for the result */
    uint64_t contact_ticks; /* with any contact */
    double peak_force_N, peak_contact_force_N, max_depth_m;
    bool fem_known;
    double
        force_error_vs_fem; /* largest |f - f_fem| / peak |f_fem| over the compared ticks; fem_force.h says of what */
    char fem_reason[400];   /* why it is not known */
    const char *fem_reference; /* what was compared with what; NULL when not known */
    double
        correction_N; /* largest difference between the linear force and that of the effects neo_hookean, quasi_nonlinear */
    uint32_t beyond_range; /* ticks in which that was beyond its range of validity */
    uint32_t fem_compared;
    double peak_fem_force_N;
    char torque_log_sha256[65];
    uint64_t torque_frames;
    unsigned max_contacts;
    uint32_t max_factors;
    unsigned final_state; /* enum safety_state: SAFE if one instrument is, else the lowest */
    int reason;           /* STATUS_LOOP_* when that is SAFE */
    bool stopped;         /* the host asked for SAFE, so it is no surprise */
    bool ran;             /* RUN was reached by all */
    struct safety safety; /* counters */
    uint32_t clamps, rate_limits, passivity_interventions, walks_cut, solver_cuts;
    uint32_t frames_malformed, queue_overflows; /* controller */
    uint32_t device_rejected, device_late, device_silences;
    uint64_t link_malformed, link_incomplete;
    struct bus_statistics bus;
    double bus_load; /* share of the simulated time that the bus was busy */
    double seconds;  /* wall clock, without the finite-element comparison */
    uint32_t instruments;
    struct session_instrument instrument[SESSION_INSTRUMENTS];
};

/* Fill what is summed up or largest over `instruments` instruments: from missed to link_incomplete, state and reason. */
void session_result_sum(struct session_result *result);

#endif
