/* Schur complement of a sparse symmetric positive definite matrix on some of its unknowns (the tail: the surface):
 *
 *   K = | K11 K21t |   S = K22 - K21 K11^-1 K21t,   S^-1 = the tail's block of K^-1.
 *       | K21 K22  |
 *
 * The interior is ordered by CHOLMOD (AMD or METIS) and the tail kept last in its own order; CHOLMOD analyses
 * supernodes and row patterns; the numbers are eliminated here, supernode by supernode with BLAS, because CHOLMOD's own
 * numeric phase would factor the tail too, hold it and its update twice (16 bytes per entry of the square) and neither
 * report nor stop. Here the only dense square is the caller's. */
#ifndef TROCAR_SCHUR_H
#define TROCAR_SCHUR_H

#include <cholmod.h>
#include <stddef.h>
#include <stdint.h>

#include "effort.h"

struct schur {
    size_t interior, tail;
    int32_t *rank;       /* unknown -> position in the elimination */
    size_t supernodes;   /* those that begin in the interior; the last may be cut where the tail begins */
    size_t *value_start; /* per supernode: where its dense columns start; supernodes + 1 */
    int32_t *owner;      /* interior position -> supernode */
    size_t rows_max;     /* longest supernode column */
    cholmod_factor *pattern;
    double operations;
    size_t bytes; /* that schur_eliminate takes beside S */
};

/* Plan the elimination. `place`: per unknown its place in the tail, or -1 inside; `tail` of them. Returns 0 or
 * STATUS_MEMORY (also when CHOLMOD reports another failure: it has no other cause here). */
int schur_plan(cholmod_sparse *K, const int32_t *place, size_t tail, cholmod_common *common, struct schur *schur);
void schur_free(struct schur *schur, cholmod_common *common);

/* Fill the lower half of S (column-major, leading dimension ld >= tail, zero on entry). Returns STATUS_OK,
 * STATUS_INTERRUPTED, STATUS_MEMORY, or STATUS_MODEL_FACTOR with the unknown at which K11 is not positive definite in
 * *pivot. */
int schur_eliminate(const struct schur *schur, const cholmod_sparse *K, double *S, size_t ld, struct effort *effort,
                    size_t *pivot);

#endif
