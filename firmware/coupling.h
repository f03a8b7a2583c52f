/* From the contact force to what the hand is given: the virtual coupling's damping, the clamp, the rate limit, and the
 * time-domain passivity observer and controller (Hannaford and Ryu 2002), which dissipates what the sampled loop creates. */
#ifndef TROCAR_COUPLING_H
#define TROCAR_COUPLING_H

#include <stdbool.h>
#include <stdint.h>

#include "bank_view.h"

struct coupling {
    bool started;
    float force_N[3]; /* on the tool, world, after all limits: what the torques realise */
    float last_tip_m[3];
    float
        gravity_share; /* 0..1: how much of the gravity compensation is on; comes and goes with the decay's time constant */
    float
        contact_share; /* 0..1: the contact force comes in with the same time constant when torque is enabled in tissue */
    float energy_J;    /* that the rendered force took from the hand in this contact and has not given back */
    uint32_t clamps, rate_limits, passivity_interventions; /* counters, in ticks */
};

/* `contact_force_N` on the tool (world), tip and velocity of the device (world), whether any point touches. The result is
 * c->force_N: |force| <= force_limit_N, |change| <= force_rate_N_s / 1000 per tick. */
void coupling_update(struct coupling *c, const struct bank_view *bank, const float contact_force_N[3],
                     const float tip_m[3], const float velocity_m_s[3], bool touching);

/* One tick of decay to zero, with the bank's time constant; below 1 mN (and 1/1000 of gravity) it is zero. */
void coupling_decay(struct coupling *c, const struct bank_view *bank);

/* Silent: no force, and the next update starts anew. */
void coupling_silence(struct coupling *c);

bool coupling_settled(const struct coupling *c); /* force and gravity compensation are zero */

#endif
