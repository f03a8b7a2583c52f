#include "session_result.h"

#include <math.h>

static void add_safety(struct safety *to, const struct safety *from)
{
    to->missed += from->missed;
    to->implausible += from->implausible;
    to->out_of_sequence += from->out_of_sequence;
    to->duplicates += from->duplicates;
    to->overruns += from->overruns;
    to->nonfinite += from->nonfinite;
    to->safe_entries += from->safe_entries;
}

void session_result_sum(struct session_result *r)
{
    bool safe = false;
    r->ran = true;
    r->final_state = SAFETY_RUN;
    for (uint32_t t = 0; t < r->instruments; t++) {
        const struct session_instrument *i = &r->instrument[t];
        add_safety(&r->safety, &i->safety);
        r->peak_force_N = fmax(r->peak_force_N, i->peak_force_N);
        r->peak_contact_force_N = fmax(r->peak_contact_force_N, i->peak_contact_force_N);
        r->max_depth_m = fmax(r->max_depth_m, i->max_depth_m);
        r->ran = r->ran && i->ran;
        r->clamps += i->clamps;
        r->rate_limits += i->rate_limits;
        r->passivity_interventions += i->passivity_interventions;
        r->device_rejected += i->device_rejected;
        r->device_late += i->device_late;
        r->device_silences += i->device_silences;
        r->link_malformed += i->link_malformed;
        r->link_incomplete += i->link_incomplete;
        if (i->safety.state < r->final_state)
            r->final_state = i->safety.state;
        if (i->safety.state == SAFETY_SAFE && !safe) {
            safe = true;
            r->reason = i->safety.reason;
        }
    }
    if (safe)
        r->final_state = SAFETY_SAFE;
    r->missed = r->safety.missed;
}
