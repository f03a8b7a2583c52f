#include "tick.h"

#include "effects/hooks.h"
#include "real.h"

int controller_start(struct controller *c, const struct bank_view *bank, uint32_t instrument, void *memory,
                     size_t bytes)
{
    *c = (struct controller){.instrument = instrument};
    return row_cache_start(&c->rows, bank, memory, bytes) ? STATUS_OK : STATUS_BANK_MEMORY;
}

/* Nothing of the contact may reach the next tick. */
static void forget_contact(struct controller *c)
{
    collide_forget(&c->collide);
    contact_clear(&c->contact);
    effects_forget(c);
}

/* Encoder counts -> pose. True when this tick has a sample to act on; otherwise the safety state has counted why not. */
static bool sense(struct controller *c, const struct bank_tool *tool, const struct tick_input *in)
{
    bool fresh = in->fresh && safety_sequence(&c->safety, in->sequence);
    bool plausible = fresh && kinematics_update(&c->kinematics, tool, in->counts, c->safety.since_sample + 1u);
    safety_update(&c->safety, fresh, plausible, in->overrun);
    if (in->stop)
        safety_doubt(&c->safety, STATUS_LOOP_HOST);
    if (in->acknowledge)
        safety_acknowledge(&c->safety, coupling_settled(&c->coupling));
    if (c->safety.stale_run >= SAFETY_STALE_TICKS || c->safety.implausible_run >= SAFETY_IMPLAUSIBLE_TICKS) {
        /* The way between is not known: find wrap and contact anew. */
        c->kinematics.started = false;
        forget_contact(c);
    }
    return plausible;
}

/* Pose -> contact points -> contact forces. */
static void touch(struct controller *c, const struct bank_view *bank, const struct bank_tool *tool,
                  const struct tick_input *in)
{
    float points_m[BANK_MAX_TOOL_POINTS][3];
    for (uint32_t i = 0; i < tool->point_count; i++) /* bound: BANK_MAX_TOOL_POINTS */
        kinematics_point(&c->kinematics, tool->point_m[i], points_m[i]);
    effects_sense(c, 0, in);
    effects_move(c, bank, points_m, tool->point_count);
    collide_update(&c->collide, bank, tool->trocar_m, (const float(*)[3])points_m, tool->point_count);
    effects_touch(c, bank);
    contact_gather(&c->contact, &c->collide);
    effects_place(c, bank, in);
    contact_admit(&c->contact, &c->rows, bank);
    if (!effects_push(c, bank)) {
        contact_respond(&c->contact, &c->rows, bank);
        effects_respond(c, bank);
        contact_push(&c->contact, bank);
    }
    effects_follow(c, bank);
    contact_expect(&c->contact, &c->rows, bank, &c->collide, c->kinematics.velocity_m_s);
    const float *f = c->contact.force_N;
    if (!real_finite(f[0]) || !real_finite(f[1]) || !real_finite(f[2])) {
        c->safety.nonfinite++;
        safety_doubt(&c->safety, STATUS_LOOP_NONFINITE);
        forget_contact(c);
    }
}

/* Contact force -> force for the hand, within its limits; without a sample or in SAFE it decays, else it is silent. */
static void render(struct controller *c, const struct bank_view *bank, bool sample)
{
    if (c->safety.state == SAFETY_RUN && sample)
        coupling_update(&c->coupling, bank, c->contact.force_N, c->kinematics.tip_m, c->kinematics.velocity_m_s,
                        c->contact.count > 0);
    else if (safety_torque(&c->safety))
        coupling_decay(&c->coupling, bank);
    else
        coupling_silence(&c->coupling);
}

/* Force -> joint efforts by virtual work, plus the motor's weight, each clamped to what its motor gives. */
static void actuate(struct controller *c, const struct bank_tool *tool, struct tick_output *out)
{
    float effort[3], gravity[3];
    kinematics_efforts(&c->kinematics, tool, c->coupling.force_N, effort);
    kinematics_gravity(&c->kinematics, tool, gravity);
    out->enable = c->safety.state == SAFETY_RUN || (safety_torque(&c->safety) && !coupling_settled(&c->coupling));
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        float limit = tool->axis[i].effort_limit;
        float wanted = effort[i] + c->coupling.gravity_share * gravity[i];
        out->torque[i] = out->enable ? real_clamp(wanted, -limit, limit) : 0.0f;
    }
    out->sequence = c->safety.sequence;
}

void tick(struct controller *c, const struct bank_view *bank, const struct tick_input *in, struct tick_output *out)
{
    const struct bank_tool *tool = &bank->tools[c->instrument];
    c->tick_count++;
    bool sample = sense(c, tool, in);
    if (sample)
        touch(c, bank, tool, in);
    render(c, bank, sample);
    actuate(c, tool, out);
}
