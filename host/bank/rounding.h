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
};
int cholesky_build(const struct compliance *compliance, const struct order *order, struct cholesky *cholesky,
                   struct failure *why);
void cholesky_free(struct cholesky *cholesky);

struct rounding {
    double step;      /* absolute, (m/N)^(1/2) */
    double feedback;  /* distance between rows up to which feedback is used, in units of order.place */
    uint32_t classes; /* of columns that may hold a block */
    uint16_t multiple[BANK_FACTOR_CLASSES + 1]; /* of the step, by class; the last entry used is the diagonal's */
};

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
