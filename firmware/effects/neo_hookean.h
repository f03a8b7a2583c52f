/* Large displacements: the force of a neo-Hookean body to second order, in every direction (shared/effects/neo_hookean.md).
 *
 * The energy of the tissue under a tool is E = Q/2 + T + O(4): Q the quadratic one of the bank's compliance, T cubic. By the 2n + 1
 * theorem T is the cubic part of the neo-Hookean energy at the linear answer, hence a cubic form of the linear force F with which
 * the tool pushes: ten numbers per vertex (host/bank/second_order.h). Here, with the linear answer p of contact_push, per tool,
 *
 *   F = -sum p_c n_c,  P = sum p_c,  Q = p . C p,  T(p) = sum (p_c / P) T_c(F)       T_c from the corners of its triangle
 *   g_e = dT/dp_e = -n_e . grad T(F) + (T_e(F) - T) / P
 *
 * and the forces are those of contact.h's problem with depths raised by l^2 g: A p' - (d + l^2 g) >= 0, p' >= 0, complementary. As
 * dT/d(depth) = C^-1 g, p' is the gradient of E: a potential, homogeneous of degree 2 and 3.
 *
 * l < 1 is what the virtual coupling takes: stiffer tissue moves the proxy back, and T falls with the cube of what is left. Along
 * the answer's own ray the tissue's displacement l and the forces l + h l^2 with h = 3 T / Q balance the coupling's share
 * z = Z / (Q + Z), Z = |F|^2 / k:
 *   l (1 - z) + z (l + h l^2) = 1,    l = 2 / (1 + sqrt(1 + 4 h z))
 * in closed form, so no Newton step over the contacts is needed.
 *
 * Up to the range R of its vertex, Q <= R, the corrected energy is convex (second_order_range_J). Beyond it T goes on along its
 * tangent on every ray, T (3 s - 3 s^2 + s^3) with s^2 = R/Q: force grows linearly there, with a continuous slope, and has a potential
 * still.
 *
 * Work: m^2 products, m forms, and one more contact_push that starts from the answer's own set. */
#ifndef TROCAR_EFFECT_NEO_HOOKEAN_H
#define TROCAR_EFFECT_NEO_HOOKEAN_H

#include "contact.h"

struct neo_hookean {
    float linear_N[CONTACT_TOOLS][3]; /* per tool: the force before the correction, what linear elasticity says */
    float share[CONTACT_TOOLS];       /* h of this tick: the correction over the linear force, along its own ray */
    uint32_t beyond;                  /* counter: tools in a tick with more energy than the range */
};

/* STATUS_BANK_SECTION in a bank that names an effect with contacts of its own: they do not go together yet. */
int neo_hookean_open(struct bank_view *view);

/* The stage after contact_push. */
void neo_hookean_correct(struct neo_hookean *n, const struct bank_view *bank, struct contact_set *set);

#endif
