/* Where the effects of this image act in a tick, stage by stage in the order of tick.c. Without an effect a stage is nothing.
 * An effect acts when the bank names it: bank->NAME is then its section. */
#ifndef TROCAR_EFFECTS_HOOKS_H
#define TROCAR_EFFECTS_HOOKS_H

#include "tick.h"

/* After the touching points are known, before the rows of their triangles are asked for: where on the surface each contact
 * acts, and which contacts there are. c->contact holds them as the collision found them; `in` has roll and grip. */
static inline void effects_place(struct controller *c, const struct bank_view *bank, const struct tick_input *in)
{
    (void)c, (void)bank, (void)in;
    IF_FRICTION(if (bank->friction) friction_place(&c->friction, bank, &c->contact, &c->collide);)
}

/* In place of contact_push: forces that are more than a push along the normal. True when they are done. */
static inline bool effects_push(struct controller *c, const struct bank_view *bank)
{
    (void)c, (void)bank;
    IF_FRICTION(if (bank->friction) {
        friction_push(&c->friction, bank, &c->contact, &c->rows);
        return true;
    })
    return false;
}

/* After the forces of this tick are known: what an effect remembers of them. */
static inline void effects_follow(struct controller *c, const struct bank_view *bank)
{
    (void)c, (void)bank;
    IF_FRICTION(if (bank->friction) friction_follow(&c->friction, &c->contact);)
}

/* The way between two ticks is not known, or a force was not finite: nothing remembered of contact is true any more. */
static inline void effects_forget(struct controller *c)
{
    (void)c;
    IF_FRICTION(friction_forget(&c->friction);)
}

#endif
