/* The reduced compliance G = R^t K^-1 R of a sparse symmetric positive definite K for the columns of a sparse R, as the
 * Schur complement of
 *
 *   | K   R |     eliminating K leaves  -R^t K^-1 R = -X^t X,  X = L^-1 R, K = L L^t.
 *   | R^t 0 |
 *
 * No solve per column, no dense inverse, and L^-1 R only where it is not zero: a column of R takes part from the first
 * supernode that it touches on the way to the root of the elimination tree, so with nested dissection nearly all columns
 * meet nearly only the separators near the root. CHOLMOD gives the order, the supernodes and their row patterns; the
 * numbers are eliminated here, supernode by supernode with BLAS on its threads, because the factor is not kept: a
 * supernode has memory from the first update that reaches it until it is eliminated, and the only dense square is the
 * caller's. Every sum is taken in a fixed order. */
#ifndef TROCAR_SCHUR_H
#define TROCAR_SCHUR_H

#include <cholmod.h>
#include <stddef.h>
#include <stdint.h>

#include "effort.h"

/* R by rows: unknown u holds weight[k] in column[k], rising, start[u] <= k < start[u + 1]. */
struct schur_load {
    size_t columns, *start;
    uint32_t *column;
    double *weight;
};

struct schur {
    const cholmod_factor *pattern; /* of the factor of K, supernodal: the caller's */
    const struct schur_load *R;
    int32_t *rank;     /* unknown -> position in the elimination */
    int32_t *owner;    /* position -> supernode */
    size_t *row_start; /* per supernode: where its rows start in `row`; nsuper + 1 */
    uint32_t *row;     /* positions, rising: its own columns, those below them, then unknowns + columns of R */
    size_t rows_max;   /* longest column of a supernode */
    double operations;
    size_t bytes; /* that schur_eliminate takes at most beside G */
};

/* Plan the elimination. Returns STATUS_OK or STATUS_MEMORY. */
int schur_plan(const cholmod_factor *pattern, const struct schur_load *R, const cholmod_sparse *K, struct schur *schur);
void schur_free(struct schur *schur);

/* Add R^t K^-1 R to the lower half of G (column-major, leading dimension ld >= columns of R). A pivot whose square is below
 * `pivot_min` times the diagonal entry of K is rounding error. Returns STATUS_OK, STATUS_INTERRUPTED, STATUS_MEMORY, or
 * STATUS_MODEL_FACTOR with the unknown at which K is not positive definite in *pivot. */
int schur_eliminate(const struct schur *schur, cholmod_sparse *K, double pivot_min, double *G, size_t ld,
                    cholmod_common *common, struct effort *effort, size_t *pivot);

#endif
