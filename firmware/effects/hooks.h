/* Where the effects of this image act in a tick, stage by stage in the order of tick.c. Without an effect a stage is nothing.
 * An effect acts when the bank names it: bank->NAME is then its section. */
#ifndef TROCAR_EFFECTS_HOOKS_H
#define TROCAR_EFFECTS_HOOKS_H

#include "tick.h"

/* An instrument has a sample: what else than the pose an effect takes from it. */
static inline void effects_sense(struct controller *c, uint32_t tool, const struct tick_input *in)
{
    (void)c, (void)tool, (void)in;
    IF_GRASP(c->grasp.jaws[tool].grip = in->grip;)
    IF_SHAPE(shape_sense(&c->shape, tool, in->roll, in->grip);)
}

/* Before the collision: where the tool's points are as the body sees them, which may have moved itself. */
static inline void effects_move(struct controller *c, const struct bank_view *bank, float (*points_m)[3],
                                uint32_t count)
{
    (void)c, (void)bank, (void)points_m, (void)count;
    IF_SHAPE(if (bank->shape) {
        for (uint32_t t = 0; t < tick_instruments(c); t++) /* bound: TICK_INSTRUMENTS */
            shape_move(&c->shape, bank, t, c->collide.tool[t].first, c->collide.tool[t].count,
                       &c->instrument[t].kinematics, points_m);
        shape_hide(&c->shape, &c->collide);
    })
    IF_SWING(if (bank->swing) swing_move(&c->swing, bank, points_m, count);)
}

/* After the collision of points: what touches that is more than a point. */
static inline void effects_touch(struct controller *c, const struct bank_view *bank)
{
    (void)c, (void)bank;
    IF_SHAPE(if (bank->shape) shape_touch(&c->shape, bank, &c->collide);)
}

/* After the touching points are known, before the rows of their triangles are asked for: where on the surface each contact
 * acts, and which contacts there are. c->contact holds them as the collision found them. */
static inline void effects_place(struct controller *c, const struct bank_view *bank)
{
    (void)c, (void)bank;
    IF_FRICTION(if (bank->friction) friction_place(&c->friction, bank, &c->contact, &c->collide);)
    IF_GRASP(if (bank->grasp) grasp_place(&c->grasp, bank, &c->contact, &c->collide);)
    IF_SWING(if (bank->swing) swing_place(&c->swing, bank, &c->contact);)
    IF_SHAPE(for (uint32_t t = 0; t < tick_instruments(c) && bank->shape; t++) /* bound: TICK_INSTRUMENTS */
             shape_place(bank, &c->contact, &c->collide, t, &c->instrument[t].kinematics);)
}

/* Of the instruments that take part; NULL for those that do not. */
IF_RIGID(static inline void effects_poses(const struct controller *c, const struct kinematics *pose[TICK_INSTRUMENTS]) {
    for (uint32_t t = 0; t < TICK_INSTRUMENTS; t++) /* bound: TICK_INSTRUMENTS */
        pose[t] = c->instrument[t].present ? &c->instrument[t].kinematics : NULL;
})

/* After contact_assemble: what else than the bank's compliance decides how contacts respond to each other. */
static inline void effects_respond(struct controller *c, const struct bank_view *bank)
{
    (void)c, (void)bank;
    IF_SWING(if (bank->swing) swing_respond(&c->swing, bank, &c->contact);)
    IF_RIGID(if (bank->rigid) {
        const struct kinematics *pose[TICK_INSTRUMENTS];
        effects_poses(c, pose);
        rigid_respond(&c->rigid, bank, &c->contact, pose);
    })
}

/* How much stiffer tissue is in this tick than at rest: 1, unless it is visco-elastic. */
static inline float effects_stiffening(const struct controller *c, const struct bank_view *bank)
{
    float stiffening = 1.0f;
    (void)c, (void)bank;
    IF_VISCOELASTIC(stiffening = bank->viscoelastic ? c->viscoelastic.step.total : 1.0f;)
    return stiffening;
}

/* Forces of three components per contact (cone.h): what friction and jaws ask, of tissue that may remember. False when neither is
 * named. */
static inline bool effects_push_cone(struct controller *c, const struct bank_view *bank,
                                     const struct bank_contact *contact)
{
    uint32_t sweeps = 0;
    (void)c, (void)bank, (void)contact;
    IF_FRICTION(if (bank->friction) sweeps = bank->friction->sweeps;)
    IF_GRASP(if (bank->grasp && bank->grasp->sweeps > sweeps) sweeps = bank->grasp->sweeps;)
    if (sweeps == 0)
        return false;
    IF_CONE(cone_ask(&c->cone, &c->contact, contact);)
    IF_CONE(IF_SHAPE(for (uint32_t t = 0; t < tick_instruments(c) && bank->shape; t++) /* bound: TICK_INSTRUMENTS */
                     shape_levers(bank, &c->contact, &c->collide, t, &c->instrument[t].kinematics, &c->cone.system);))
    IF_FRICTION(if (bank->friction) friction_ask(&c->friction, bank, &c->contact, &c->cone.system);)
    IF_GRASP(if (bank->grasp) grasp_ask(&c->grasp, &c->contact, &c->collide, &c->cone.system);)
    IF_CONE(
        IF_VISCOELASTIC(for (uint32_t i = 0; i < c->contact.count && bank->viscoelastic; i++) /* bound: CONTACT_MAX */
                        viscoelastic_want(&c->viscoelastic, i, c->cone.system.contact[i].wanted_m);))
    IF_CONE(cone_push(&c->cone, &c->contact, contact, sweeps);)
    return true;
}

/* In place of contact_push: forces that are more than an elastic push along the normal. True when they are done. */
static inline bool effects_push(struct controller *c, const struct bank_view *bank)
{
    const struct bank_contact *contact = bank->contact;
    IF_VISCOELASTIC(if (bank->viscoelastic) {
        viscoelastic_ask(&c->viscoelastic, bank, &c->contact, &c->collide, c->tick_count);
        contact = &c->viscoelastic.contact;
        IF_RIGID(rigid_stiffen(&c->contact, c->viscoelastic.step.total);)
    })
    bool done = effects_push_cone(c, bank, contact);
    IF_VISCOELASTIC(if (bank->viscoelastic) {
        if (!done) {
            viscoelastic_deepen(&c->viscoelastic, &c->contact);
            contact_push(&c->contact, contact);
        }
        viscoelastic_follow(&c->viscoelastic, bank, &c->contact);
        done = true;
    })
    return done;
}

/* After the push: what else than linear elasticity decides the forces. */
static inline void effects_correct(struct controller *c, const struct bank_view *bank)
{
    (void)c, (void)bank;
    IF_NEO_HOOKEAN(if (bank->neo_hookean) neo_hookean_correct(&c->neo_hookean, bank, &c->contact);)
    IF_QUASI_NONLINEAR(if (bank->quasi_nonlinear) quasi_nonlinear_correct(&c->quasi_nonlinear, bank, &c->contact);)
}

/* After the forces of this tick are known: what an effect remembers of them. */
static inline void effects_follow(struct controller *c, const struct bank_view *bank)
{
    (void)c, (void)bank;
    IF_FRICTION(if (bank->friction)
                    friction_follow(&c->friction, &c->contact, &c->cone.system, effects_stiffening(c, bank));)
    IF_GRASP(if (bank->grasp)
                 grasp_follow(&c->grasp, bank, &c->contact, &c->cone.system, &c->collide, effects_stiffening(c, bank));)
    IF_SHAPE(if (bank->shape) shape_expect(&c->shape, bank, &c->rows, &c->collide);)
    IF_SWING(if (bank->swing) swing_follow(&c->swing, bank, &c->contact);)
    IF_RIGID(if (bank->rigid) {
        const struct kinematics *pose[TICK_INSTRUMENTS];
        effects_poses(c, pose);
        rigid_follow(&c->rigid, &c->contact, pose);
    })
}

/* The way between two ticks of an instrument is not known, or a force was not finite: nothing remembered of its contact is true
 * any more. */
static inline void effects_forget(struct controller *c, uint32_t tool)
{
    (void)c, (void)tool;
    IF_CONE(cone_forget(&c->cone, &c->collide.tool[tool]);)
    IF_FRICTION(friction_forget(&c->friction, &c->collide.tool[tool]);)
    IF_GRASP(grasp_forget(&c->grasp, &c->collide, tool);)
    IF_SHAPE(shape_forget(&c->shape, tool, c->collide.tool[tool].first, c->collide.tool[tool].count);)
    IF_RIGID(rigid_forget(&c->rigid, tool);)
    IF_SWING(swing_forget(&c->swing);)
    IF_VISCOELASTIC(viscoelastic_forget(&c->viscoelastic, &c->collide.tool[tool]);)
}

#endif
