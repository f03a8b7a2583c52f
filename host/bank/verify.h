/* A bank against the body that it claims to describe: everything in it is derived again from the scene and compared, and
 * random columns of the compliance are recomputed by direct sparse solves, which share nothing with the way in which
 * compliance_build makes them (an elimination of its own). */
#ifndef TROCAR_VERIFY_H
#define TROCAR_VERIFY_H

#include <stddef.h>
#include <stdint.h>

#include "bank.h"

/* An entry g of a column may differ from the direct solution u by
 *   2^-24 |u|        rounding to float32, to nearest
 *   + 256 max|e|     the double-precision error of the two ways, where e = K^-1 (f - K u) is the error of this solution
 *                    estimated by one step of iterative refinement; the other way's is of the same order
 *   + 2^-149         the last bit of float32
 *   + in a compressed bank 6 s, where s^2 = (step M)^2 (|Q_i|^2 + |Q_j|^2) step^2 / 12 per component: the deviation of
 *                    G_ij when every entry of both rows is off by an independent rounding to the coarsest multiple M that
 *                    a row of the bank uses. Feedback makes it smaller. */
#define VERIFY_SOLVE_MARGIN 256

struct verify_result {
    size_t columns;        /* of 3 components each */
    size_t entries, wrong; /* floats compared, floats beyond the tolerance */
    double worst;          /* largest difference, in tolerances */
    double worst_relative; /* largest difference, relative to the largest entry of its column */
    char differs[400];     /* the first thing that is wrong; "" when all agrees */
};

/* Fill `result`; STATUS_OK also when something differs (then *result->differs), an error only when it cannot be told.
 * `columns` rows are drawn from `seed`; more than there are checks every row once. */
int bank_verify(const struct bank_view *bank, struct body *body, size_t columns, uint64_t seed, bool quiet,
                struct verify_result *result, struct failure *why);

#endif
