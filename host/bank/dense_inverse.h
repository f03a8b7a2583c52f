/* Inverse of a dense symmetric positive definite matrix, in place and by panels, so that a long one can show its
 * progress and be interrupted. The same operations as LAPACK's dpotrf and dpotri (n^3), through BLAS on its threads. */
#ifndef TROCAR_DENSE_INVERSE_H
#define TROCAR_DENSE_INVERSE_H

#include "effort.h"
#include "failure.h"

/* Operations that dense_inverse reports to `effort`. */
double dense_inverse_operations(size_t n);

/* A: column-major, leading dimension ld >= n, lower half; the upper half is not touched. `pivot_min` (n): the smallest square
 * of each diagonal entry of the factor that is not taken for rounding error. Returns STATUS_OK, STATUS_INTERRUPTED, or
 * STATUS_MODEL_FACTOR with the first row that fails in *pivot. A holds no useful number after a failure. */
int dense_inverse(size_t n, double *A, size_t ld, const double *pivot_min, struct effort *effort, size_t *pivot);

#endif
