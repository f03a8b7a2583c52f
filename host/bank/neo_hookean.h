/* The compressible neo-Hookean solid, the reference for claims about depth: it is linear elasticity at small strain, is
 * blind to rotations, and resists compression without bound, so that an element cannot be inverted (St Venant-Kirchhoff
 * softens in compression and inverts: numerics.md).
 *
 *   W = int [ mu/2 (F:F - 3) - mu ln J ] dV + V lambda/2 (ln Jm)^2      F = I + grad u,  J = det F,  Jm = its mean
 *
 * [Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, 2nd ed., 6.4.3, with the volume term of the
 * element's mean J, so that near incompressibility does not lock]. The first Piola-Kirchhoff stress is
 * P = mu (F - F^-t) + lambda ln J F^-t. Quadratic elements are integrated at the 4 points of degree 2. */
#ifndef TROCAR_NEO_HOOKEAN_H
#define TROCAR_NEO_HOOKEAN_H

#include "element.h"

enum { NEO_HOOKEAN_NODES = 10 };

/* Energy of one element under the displacements u (3 per node, m), J; INFINITY when it is inverted at a point. Unless NULL:
 * `force` (3 per node) takes dW/du, N, what the body needs to be held like that; `tangent` (9 per pair of nodes j, k,
 * row-major blocks at 9 (nodes j + k)) takes d2W/du2, N/m, symmetric; `least_volume` the smallest J. */
double neo_hookean_element(const struct element *element, struct lame material, enum element_order order,
                           const double *u, double *force, double *tangent, double *least_volume);

/* The part of the energy that is cubic in u, J, of what `neo_hookean_element` says: with H = grad u and means over the element
 *   V { -mu/3 mean tr H^3 + lambda (g h - g^3 / 2) },   g = mean tr H,  h = mean ((tr H)^2 - tr H^2)/2,
 * as a form in (x, y, z) of u = x X + y Y + z Z: `u` holds the fields X, Y, Z one after the other, 3 per node each. The coefficients
 * of xxx yyy zzz xxy xxz yyx yyz zzx zzy xyz are added to `cubic`. */
enum { NEO_HOOKEAN_CUBIC = 10 };
void neo_hookean_cubic(const struct element *element, struct lame material, enum element_order order, const double *u,
                       double cubic[NEO_HOOKEAN_CUBIC]);

#endif
