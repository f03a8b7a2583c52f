#include "coupling.h"

#include "real.h"

#define TICK_S 0.001f

/* Shorten v to at most `limit`; true when it was longer. */
static bool limit_length(float v[3], float limit)
{
    float squared = real_dot(v, v);
    if (squared <= limit * limit)
        return false;
    float part = limit / real_sqrt(squared);
    for (int i = 0; i < 3; i++) /* bound: 3 */
        v[i] *= part;
    return true;
}

void coupling_update(struct coupling *c, const struct bank_view *bank, const float contact_force_N[3],
                     const float tip_m[3], const float velocity_m_s[3], bool touching)
{
    const struct bank_contact *limits = bank->contact;
    float moved[3] = {0.0f, 0.0f, 0.0f}, wanted[3];
    if (c->started)
        real_subtract(tip_m, c->last_tip_m, moved);
    c->started = true;
    for (int i = 0; i < 3; i++) /* bound: 3 */
        c->last_tip_m[i] = tip_m[i];

    /* Observer: since the last tick the hand moved by `moved` against the force held; that energy is in the store. */
    c->energy_J -= real_dot(c->force_N, moved);

    c->contact_share += (1.0f - c->contact_share) * real_clamp(TICK_S / limits->decay_s, 0.0f, 1.0f);
    if (c->contact_share > 0.999f)
        c->contact_share = 1.0f;
    for (int i = 0; i < 3; i++) /* bound: 3 */
        wanted[i] =
            c->contact_share * contact_force_N[i] - (touching ? limits->coupling_damping_Ns_m * velocity_m_s[i] : 0.0f);

    /* Controller: a negative store means that the loop gave more than it took. Brake along the motion so that the next
     * such step takes it back. A spring k sampled at T creates at most k (v T)^2 / 2 a tick, which a damper k T / 2 takes:
     * twice that is enough, and keeps a store of microjoules from being paid back in one kick at low speed. */
    float distance2 = real_dot(moved, moved);
    if (c->energy_J < 0.0f && distance2 > 0.0f) {
        float stiffness = -c->energy_J / distance2;
        if (stiffness > limits->coupling_stiffness_N_m)
            stiffness = limits->coupling_stiffness_N_m;
        for (int i = 0; i < 3; i++)            /* bound: 3 */
            wanted[i] -= stiffness * moved[i]; /* moved = v T */
        c->passivity_interventions++;
    }

    c->clamps += limit_length(wanted, limits->force_limit_N);
    float change[3];
    real_subtract(wanted, c->force_N, change);
    c->rate_limits += limit_length(change, limits->force_rate_N_s * TICK_S);
    for (int i = 0; i < 3; i++) /* bound: 3 */
        c->force_N[i] += change[i];

    c->gravity_share += (1.0f - c->gravity_share) * real_clamp(TICK_S / limits->decay_s, 0.0f, 1.0f);

    /* Free and without force: nothing is owed to the next contact. */
    if (!touching && real_dot(c->force_N, c->force_N) == 0.0f)
        c->energy_J = 0.0f;
}

void coupling_decay(struct coupling *c, const struct bank_view *bank)
{
    float keep = 1.0f - TICK_S / bank->contact->decay_s;
    keep = real_clamp(keep, 0.0f, 1.0f);
    for (int i = 0; i < 3; i++) /* bound: 3 */
        c->force_N[i] *= keep;
    if (real_dot(c->force_N, c->force_N) < 1e-6f)
        c->force_N[0] = c->force_N[1] = c->force_N[2] = 0.0f;
    c->gravity_share = c->gravity_share < 1e-3f ? 0.0f : keep * c->gravity_share;
    c->energy_J = 0.0f;
    c->started = false;
}

void coupling_silence(struct coupling *c)
{
    c->force_N[0] = c->force_N[1] = c->force_N[2] = c->gravity_share = c->contact_share = 0.0f;
    c->energy_J = 0.0f;
    c->started = false;
}

bool coupling_settled(const struct coupling *c)
{
    return real_dot(c->force_N, c->force_N) == 0.0f && c->gravity_share == 0.0f;
}
