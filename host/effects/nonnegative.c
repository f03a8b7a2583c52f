#include "nonnegative.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* The free problem on the columns of the set. */
static bool solve_set(size_t rows, size_t columns, const double *A, const double *b, const bool *in, double *s)
{
    size_t count = 0;
    for (size_t c = 0; c < columns; c++)
        count += in[c];
    memset(s, 0, columns * sizeof *s);
    if (count == 0)
        return true;
    gsl_matrix *M = gsl_matrix_alloc(rows, count), *covariance = gsl_matrix_alloc(count, count);
    gsl_vector *right = gsl_vector_alloc(rows), *answer = gsl_vector_alloc(count);
    gsl_multifit_linear_workspace *work = gsl_multifit_linear_alloc(rows, count);
    bool good = M && covariance && right && answer && work;
    if (good) {
        for (size_t r = 0; r < rows; r++) {
            gsl_vector_set(right, r, b[r]);
            for (size_t c = 0, k = 0; c < columns; c++)
                if (in[c])
                    gsl_matrix_set(M, r, k++, A[r * columns + c]);
        }
        double square;
        good = gsl_multifit_linear(M, right, answer, covariance, &square, work) == GSL_SUCCESS;
        for (size_t c = 0, k = 0; c < columns && good; c++)
            if (in[c])
                s[c] = gsl_vector_get(answer, k++);
    }
    gsl_matrix_free(M);
    gsl_matrix_free(covariance);
    gsl_vector_free(right);
    gsl_vector_free(answer);
    if (work)
        gsl_multifit_linear_free(work);
    return good;
}

/* The column outside the set along which the square of the residual falls most steeply, relative to its length. */
static size_t steepest(size_t rows, size_t columns, const double *A, const double *b, const double *x, const bool *in)
{
    size_t best = columns;
    double most = 1e-10;
    for (size_t c = 0; c < columns; c++) {
        double slope = 0, length = 0, size = 0;
        for (size_t r = 0; r < rows && !in[c]; r++) {
            double residual = b[r];
            for (size_t k = 0; k < columns; k++)
                residual -= A[r * columns + k] * x[k];
            slope += A[r * columns + c] * residual;
            length += A[r * columns + c] * A[r * columns + c];
            size += b[r] * b[r];
        }
        if (length > 0 && slope / sqrt(length * size) > most) {
            most = slope / sqrt(length * size);
            best = c;
        }
    }
    return best;
}

int nonnegative_solve(size_t rows, size_t columns, const double *A, const double *b, double *x)
{
    bool *in = calloc(columns + 1, sizeof *in);
    double *s = calloc(columns + 1, sizeof *s);
    bool good = in && s, optimal = false;
    gsl_error_handler_t *handler = gsl_set_error_handler_off(); /* its default ends the process */
    memset(x, 0, columns * sizeof *x);
    for (size_t step = 0; good && !optimal && step < 10 * columns; step++) {
        size_t entering = steepest(rows, columns, A, b, x, in);
        optimal = entering == columns;
        if (optimal)
            break;
        in[entering] = true;
        for (bool inside = false; good && !inside;) { /* each turn takes a column out of the set, or is the last */
            good = solve_set(rows, columns, A, b, in, s);
            double part = 1;
            for (size_t c = 0; c < columns; c++)
                if (in[c] && s[c] <= 0)
                    part = fmin(part, x[c] / (x[c] - s[c]));
            inside = true;
            for (size_t c = 0; c < columns && good; c++) {
                if (!in[c])
                    continue;
                if (s[c] <= 0 && x[c] / (x[c] - s[c]) <= part) {
                    in[c] = inside = false;
                    x[c] = 0;
                } else {
                    x[c] += part * (s[c] - x[c]);
                }
            }
        }
    }
    gsl_set_error_handler(handler);
    free(in);
    free(s);
    return good && optimal ? 0 : -1;
}
