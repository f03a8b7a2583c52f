/* Least squares with unknowns that may not be negative: minimise |A x - b| over x >= 0 (Lawson and Hanson, Solving Least
 * Squares Problems, ch. 23), the inner problems by GSL's singular value decomposition. */
#ifndef TROCAR_NONNEGATIVE_H
#define TROCAR_NONNEGATIVE_H

#include <stddef.h>

/* A: rows by columns, row-major. 0, or -1 without memory (or should the inner problems not end: after 10 columns steps). */
int nonnegative_solve(size_t rows, size_t columns, const double *A, const double *b, double *x);

#endif
