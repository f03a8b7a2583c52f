/* From the contact force to what the hand is given: virtual coupling's damping, clamp, rate limit, and the time-domain
 * passivity observer and controller (Hannaford and Ryu) that dissipates what the sampled loop creates. */
#ifndef TROCAR_COUPLING_H
#define TROCAR_COUPLING_H

#include <stdint.h>

#include "bank_view.h"

struct coupling {
    float force_N[3];       /* on the tool, after all limits: what the torques realise */
    float last_tip_m[3];
    float energy_J;         /* that the rendered force has absorbed from the hand, never below 0 after control */
    uint32_t clamps, rate_limits, passivity_interventions; /* counters */
};

/* `contact_force_N` on the tool (world), tip and velocity of the device, touching or not. Returns through c->force_N. */
void coupling_update(struct coupling *c, const struct bank_view *bank, const float contact_force_N[3],
                     const float tip_m[3], const float velocity_m_s[3], int touching);

/* SAFE: damped decay to zero. */
void coupling_decay(struct coupling *c, const struct bank_view *bank);

#endif
