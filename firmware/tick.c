#include "tick.h"

#include "effects/hooks.h"
#include "real.h"

int controller_start(struct controller *c, const struct bank_view *bank, void *memory, size_t bytes)
{
    *c = (struct controller){.tick_count = 0};
    IF_SECOND(c->instrument_count = bank->tool_count;)
    collide_start(&c->collide, bank);
    return row_cache_start(&c->rows, bank, memory, bytes) ? STATUS_OK : STATUS_BANK_MEMORY;
}

/* Nothing of an instrument's contact may reach the next tick. */
static void forget_contact(struct controller *c, uint32_t t)
{
    c->instrument[t].present = false;
    collide_forget(&c->collide, t);
    contact_forget(&c->contact, &c->collide, t);
    effects_forget(c, t);
}

/* Encoder counts -> pose. True when this tick has a sample to act on; otherwise the safety state has counted why not. */
static bool sense(struct controller *c, uint32_t t, const struct bank_tool *tool, const struct tick_input *in)
{
    struct instrument *own = &c->instrument[t];
    bool fresh = in->fresh && safety_sequence(&own->safety, in->sequence);
    bool plausible = fresh && kinematics_update(&own->kinematics, tool, in->counts, own->safety.since_sample + 1u);
    safety_update(&own->safety, fresh, plausible, in->overrun);
    if (in->stop)
        safety_doubt(&own->safety, STATUS_LOOP_HOST);
    if (in->acknowledge)
        safety_acknowledge(&own->safety, coupling_settled(&own->coupling));
    if (own->safety.stale_run >= SAFETY_STALE_TICKS || own->safety.implausible_run >= SAFETY_IMPLAUSIBLE_TICKS) {
        /* The way between is not known: find wrap and contact anew. */
        own->kinematics.started = false;
        forget_contact(c, t);
    }
    if (plausible) {
        own->present = true;
        effects_sense(c, t, in);
    }
    return plausible;
}

/* Poses -> points that touch. A tool that has no sample in this tick is where it was. */
static void find_contacts(struct controller *c, const struct bank_view *bank)
{
    float points_m[BANK_MAX_TOOL_POINTS][3];
    for (uint32_t t = 0; t < tick_instruments(c); t++) { /* bound: TICK_INSTRUMENTS */
        const struct bank_tool *tool = &bank->tools[t];
        uint32_t first = c->collide.tool[t].first;
        for (uint32_t i = 0; i < tool->point_count; i++) /* bound: BANK_MAX_TOOL_POINTS */
            kinematics_point(&c->instrument[t].kinematics, tool->point_m[i], points_m[first + i]);
    }
    effects_move(c, bank, points_m, c->collide.count);
    collide_begin(&c->collide);
    for (uint32_t t = 0; t < tick_instruments(c); t++) /* bound: TICK_INSTRUMENTS */
        if (c->instrument[t].present)
            collide_update(&c->collide, bank, t, bank->tools[t].trocar_m,
                           (const float(*)[3])(points_m + c->collide.tool[t].first));
    effects_touch(c, bank);
}

/* Contact points -> contact forces, of all tools at once. */
static void touch(struct controller *c, const struct bank_view *bank)
{
    float velocity_m_s[TICK_INSTRUMENTS][3];
    bool finite = true;
    find_contacts(c, bank);
    contact_gather(&c->contact, &c->collide);
    effects_place(c, bank);
    contact_admit(&c->contact, &c->rows, bank);
    contact_assemble(&c->contact, &c->rows, bank);
    effects_respond(c, bank);
    if (!effects_push(c, bank))
        contact_push(&c->contact, bank->contact);
    effects_correct(c, bank);
    effects_follow(c, bank);
    for (uint32_t t = 0; t < TICK_INSTRUMENTS; t++) { /* bound: TICK_INSTRUMENTS */
        const float *f = c->contact.force_N[t];
        finite = finite && real_finite(f[0]) && real_finite(f[1]) && real_finite(f[2]);
        for (int a = 0; a < 3; a++) /* bound: 3 */
            velocity_m_s[t][a] = c->instrument[t].kinematics.velocity_m_s[a];
    }
    contact_expect(&c->contact, &c->rows, bank, &c->collide, (const float(*)[3])velocity_m_s);
    for (uint32_t t = 0; t < tick_instruments(c) && !finite; t++) { /* bound: TICK_INSTRUMENTS */
        c->instrument[t].safety.nonfinite++;
        safety_doubt(&c->instrument[t].safety, STATUS_LOOP_NONFINITE);
        forget_contact(c, t);
    }
}

/* Contact force -> force for the hand, within its limits; without a sample or in SAFE it decays, else it is silent. */
static void render(struct controller *c, uint32_t t, const struct bank_view *bank, bool sample)
{
    struct instrument *own = &c->instrument[t];
    if (own->safety.state == SAFETY_RUN && sample)
        coupling_update(&own->coupling, bank, c->contact.force_N[t], own->kinematics.tip_m,
                        own->kinematics.velocity_m_s, contact_touches(&c->contact, t));
    else if (safety_torque(&own->safety))
        coupling_decay(&own->coupling, bank);
    else
        coupling_silence(&own->coupling);
}

/* Force -> joint efforts by virtual work, plus the motor's weight, each clamped to what its motor gives. */
static void actuate(const struct instrument *own, const struct bank_tool *tool, struct tick_output *out)
{
    float effort[3], gravity[3];
    kinematics_efforts(&own->kinematics, tool, own->coupling.force_N, effort);
    kinematics_gravity(&own->kinematics, tool, gravity);
    out->enable = own->safety.state == SAFETY_RUN || (safety_torque(&own->safety) && !coupling_settled(&own->coupling));
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        float limit = tool->axis[i].effort_limit;
        float wanted = effort[i] + own->coupling.gravity_share * gravity[i];
        out->torque[i] = out->enable ? real_clamp(wanted, -limit, limit) : 0.0f;
    }
    out->sequence = own->safety.sequence;
}

void tick(struct controller *c, const struct bank_view *bank, const struct tick_input in[TICK_INSTRUMENTS],
          struct tick_output out[TICK_INSTRUMENTS])
{
    bool sample[TICK_INSTRUMENTS] = {false}, any = false;
    c->tick_count++;
    for (uint32_t t = 0; t < tick_instruments(c); t++) { /* bound: TICK_INSTRUMENTS */
        sample[t] = sense(c, t, &bank->tools[t], &in[t]);
        any = any || sample[t];
    }
    IF_SECOND(c->second.alone += bank->second && sample[0] != sample[1];)
    if (any)
        touch(c, bank);
    for (uint32_t t = 0; t < tick_instruments(c); t++) { /* bound: TICK_INSTRUMENTS */
        render(c, t, bank, sample[t]);
        actuate(&c->instrument[t], &bank->tools[t], &out[t]);
    }
}
