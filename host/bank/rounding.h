/* The factor of the compliance, rounded: G = L L^t in double, then integers Q with step^2 Q Q^t close to G.
 *
 * Rounding L entry by entry would leave in G_ij the rounding of two whole rows. Between near points, where contact forces
 * depend on small differences, the entry (i, j) is chosen instead so that the product of the integer rows, as far as column
 * j, meets G_ij (feedback): what earlier columns lost is made good, and what remains is the rounding of one entry. */
#ifndef TROCAR_ROUNDING_H
#define TROCAR_ROUNDING_H

#include <stddef.h>
#include <stdint.h>

#include "failure.h"
#include "model.h"
#include "order.h"
#include "row.h"

/* Lower Cholesky factor in the order of the rows: 3n x 3n column-major doubles. Components that are fixed (zero rows of G)
 * have zero rows. */
struct cholesky {
    size_t rows;
    double *L;
    double median_diagonal; /* of the entries L_kk that are not zero; (m/N)^(1/2) */
    double smallest_step;   /* for which the integers fit their 16 and 31 bits, with a tenth to spare */
};
int cholesky_build(const struct compliance *compliance, const struct order *order, struct cholesky *cholesky,
                   struct failure *why);
void cholesky_free(struct cholesky *cholesky);

/* How finely each block is kept: multiples of the step, row_multiple(level_unit[level of j], distance_unit[log]) for (i, j)
 * (section FACT). Feedback leaves in G_ij the rounding of block (i, j) alone, times L_jj. Contact forces depend on the
 * differences between near points, so the multiple grows with the distance, and as a power of 1 / L_jj. */
struct rounding {
    double step;                        /* absolute, (m/N)^(1/2) */
    uint32_t classes, feedback_classes; /* of columns that may hold a block, that use feedback */
    uint16_t level_unit[BANK_FACTOR_LEVELS], distance_unit[64], diagonal_unit;
};
/* The rounding that has been found best on livers (numbers in DESIGN.md), `relative` being the rounding of neighbouring
 * blocks as a part of the median diagonal of L. */
void rounding_choose(const struct order *order, const struct cholesky *cholesky, double relative,
                     struct rounding *rounding);

struct factor {
    size_t rows;
    struct rounding rounding;
    size_t *start; /* rows + 1 */
    struct row_block *block;
    uint32_t max_blocks;
};
/* STATUS_INTERRUPTED, STATUS_MEMORY; STATUS_CHECK_FAILED when the step is so small that an entry leaves int16 or a sum of
 * squares 2^31. */
int rounding_run(const struct compliance *compliance, const struct order *order, const struct cholesky *cholesky,
                 const struct rounding *rounding, struct factor *factor, struct failure *why);
void factor_free(struct factor *factor);

#endif
