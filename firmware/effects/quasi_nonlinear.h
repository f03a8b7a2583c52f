/* The quasi-non-linear correction of [C97 3.4.2] (shared/effects/quasi_nonlinear.md): the amplitude x of the linear force of a tool becomes
 * Q(x), in the direction that the force has, with a curve Q fitted to compressions of a sample. Q rises (bank_curve); beyond its range it
 * goes on along its tangent. The curve P for the displacement across is the host's, for the field that is shown.
 *
 * With l the tissue's displacement as a share of that of the linear answer, on a coupling that takes the share z = Z / (W + Z) of the
 * depth, W the work of the linear force on the tissue and Z = x^2 / k that on the coupling:
 *   l (1 - z) + z Q(a l x) / (a x) = 1,     force x -> Q(a l x) / a,     a: newtons of the sample to one of the tool
 * one rising equation for each tool, solved by Newton's method inside a bracket. Along any way into the tissue from rest the force
 * rises with depth; it has no potential for the rest, as Q knows nothing of directions. All pressures of a tool keep
 * their proportion, so what the contact problem says of them holds on. */
#ifndef TROCAR_EFFECT_QUASI_NONLINEAR_H
#define TROCAR_EFFECT_QUASI_NONLINEAR_H

#include "contact.h"

enum {
    QUASI_NONLINEAR_STEPS = 8
}; /* of Newton's method: a bracket of 1 falls below 2^-8 by bisection, Newton squares it */

struct quasi_nonlinear {
    float linear_N[CONTACT_TOOLS][3]; /* per tool: the force before the correction */
    uint32_t beyond;                  /* counter: tools in a tick with more force than the range */
};

/* STATUS_BANK_SECTION in a bank that names an effect with contacts of its own. */
int quasi_nonlinear_open(struct bank_view *view);

/* The stage after contact_push. */
void quasi_nonlinear_correct(struct quasi_nonlinear *q, const struct bank_view *bank, struct contact_set *set);

/* y(x) and its slope, x >= 0. */
float quasi_nonlinear_value(const struct bank_curve *curve, float x, float *slope);

#endif
