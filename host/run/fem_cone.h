/* Contact forces under Coulomb's law in double precision, by a method that shares nothing with the controller's: ADMM (Boyd et
 * al. 2011, Foundations and Trends in Machine Learning 3) on a convex problem over the cones, inside the fixed point on the
 * sliding that makes it Coulomb's and not the associated law (Cadoux 2009):
 *
 *   f = argmin 1/2 f.A f - f.(d - mu |r_t| n)  over |f_t| <= mu f_n at every contact,   r = A f - d
 *
 * Names as in firmware/effects/cone.h. */
#ifndef TROCAR_FEM_CONE_H
#define TROCAR_FEM_CONE_H

#include <stdint.h>

#include "failure.h"

/* m <= CONTACT_MAX contacts; A: 3m x 3m, row-major, symmetric positive definite; d: 3m; n: 3 per contact, unit; mu: per contact, below 0
 * for one that is held from both sides; f: 3m, out.
 * MODEL_FACTOR when A is not definite, CHECK_FAILED when the fixed point does not come to rest. */
int fem_cone(uint32_t m, const double *A, const double *d, const double *n, const double *mu, double *f,
             struct failure *why);

/* By how much forces fail Coulomb's law, m: |f - P(f - rho (r + mu |r_t| n))| / rho with P the nearest point of the cone and
 * rho = 1 / A_00; largest over the contacts; 0 when they solve it. */
double fem_cone_failure(uint32_t m, const double *A, const double *d, const double *n, const double *mu,
                        const double *f);

#endif
