/* The second-order answer of a neo-Hookean body to a tool: what linear elasticity leaves out first, in every direction, from
 * linear solutions alone.
 *
 * The energy of the body under a tool that is moved by d is E(d) = d.A d / 2 + T(d) + O(|d|^4) with T cubic, and the force
 * of the tool on the tissue p = dE/dd = A d + grad T(d). By the 2n + 1 theorem of perturbation theory T needs the first-order
 * field only: T(d) is the cubic part of the neo-Hookean energy (neo_hookean.h) at the linear solution u(d), 10 numbers per
 * site. The linear solution is K^-1 B^t A d with A = (B K^-1 B^t + epsilon I)^-1: three solves per site.
 *
 * Range: the next term grows with the square of depth over the tool's size. Pushing stiffens and pulling softens; where the
 * series would soften to nothing it is refused (second_order_range). */
#ifndef TROCAR_SECOND_ORDER_H
#define TROCAR_SECOND_ORDER_H

#include "nonlinear.h"

/* Monomials of T in the order xxx yyy zzz xxy xxz yyx yyz zzx zzy xyz. */
enum { SECOND_ORDER_TERMS = 10 };

struct second_order {
    double A[3][3];                   /* N/m, symmetric */
    double cubic[SECOND_ORDER_TERMS]; /* coefficients of T, N/m2 */
};

/* Of tools that act one at a time: the rows 3 s, 3 s + 1, 3 s + 2 (nonlinear.h) are the components of tool s, along x, y, z. Three
 * solves each, and one pass over the elements. MODEL_MATERIAL, MODEL_FACTOR, MEMORY, INTERRUPTED. */
int second_order_find(struct model *model, size_t sites, const struct nonlinear_rows *rows, double epsilon_m_N,
                      struct second_order *site, bool quiet, struct failure *why);

double second_order_energy(const struct second_order *site, const double d[3]); /* T(d), J */

/* grad T(d), N: to be added to A d. */
void second_order_force(const struct second_order *site, const double d[3], double force[3]);

/* The same form of another argument: T'(d) = T(M d), M row-major. With M = A^-1 it is T as a form of the linear force. */
void second_order_map(const struct second_order *site, const double M[9], double cubic[SECOND_ORDER_TERMS]);

/* How far the tool may go along a unit direction before the force along it, A d + grad T, stops growing: m, INFINITY when it
 * never does. */
double second_order_range(const struct second_order *site, const double direction[3]);

/* Up to this d.A d, J, the corrected energy is convex, so that force grows with depth in every direction, with half of the linear
 * stiffness or more: the largest |3 T| is a quarter of (d.A d) there. A cubic form is largest along one direction, not between
 * two (Banach 1938), so directions decide. */
double second_order_range_J(const struct second_order *site);

#endif
