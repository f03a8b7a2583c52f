#include "dense_inverse.h"

#include <cblas.h>
#include <lapacke.h>

enum { PANEL = 384 }; /* columns: large enough for BLAS to run at full speed, small enough to stop within a second */

double dense_inverse_operations(size_t n)
{
    double order = (double)n;
    return order * order * order; /* a third each: factor, invert the factor, multiply with its transpose */
}

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* A = L L^t, left-looking: a panel takes all earlier columns at once. */
static int factor(size_t n, double *A, size_t ld, const double *pivot_min, struct effort *effort, size_t *pivot)
{
    for (size_t j = 0; j < n; j += PANEL) {
        int width = (int)least(PANEL, n - j), below = (int)(n - j) - width, done = (int)j, lead = (int)ld;
        double *corner = A + j + j * ld;
        if (j > 0) {
            cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, width, done, -1, A + j, lead, 1, corner, lead);
            if (below > 0)
                cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, below, width, done, -1, A + j + width, lead, A + j,
                            lead, 1, corner + width, lead);
        }
        lapack_int info = LAPACKE_dpotrf_work(LAPACK_COL_MAJOR, 'L', width, corner, lead);
        if (info != 0) {
            *pivot = j + (info > 0 ? (size_t)info - 1 : 0);
            return STATUS_MODEL_FACTOR;
        }
        for (size_t k = 0; k < (size_t)width; k++)
            if (!(corner[k * (ld + 1)] * corner[k * (ld + 1)] > pivot_min[j + k])) {
                *pivot = j + k;
                return STATUS_MODEL_FACTOR;
            }
        if (below > 0)
            cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, below, width, 1, corner, lead,
                        corner + width, lead);
        double operations = (double)width * ((double)j * (width + 2.0 * below) + (double)width * below);
        if (effort_spent(effort, operations + (double)width * width * width / 3))
            return STATUS_INTERRUPTED;
    }
    return STATUS_OK;
}

/* L := L^-1, from the last panel up: the part below is inverted already. */
static int invert(size_t n, double *L, size_t ld, struct effort *effort, size_t *pivot)
{
    size_t panels = (n + PANEL - 1) / PANEL;
    for (size_t p = panels; p-- > 0;) {
        size_t j = p * PANEL;
        int width = (int)least(PANEL, n - j), below = (int)(n - j) - width, lead = (int)ld;
        double *corner = L + j + j * ld;
        if (below > 0) {
            cblas_dtrmm(CblasColMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, below, width, 1,
                        L + (j + (size_t)width) * (ld + 1), lead, corner + width, lead);
            cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasNoTrans, CblasNonUnit, below, width, -1, corner,
                        lead, corner + width, lead);
        }
        lapack_int info = LAPACKE_dtrtri_work(LAPACK_COL_MAJOR, 'L', 'N', width, corner, lead);
        if (info != 0) {
            *pivot = j + (info > 0 ? (size_t)info - 1 : 0);
            return STATUS_MODEL_FACTOR;
        }
        if (effort_spent(effort, (double)width * below * ((double)below + width) + (double)width * width * width / 3))
            return STATUS_INTERRUPTED;
    }
    return STATUS_OK;
}

/* M := M^t M for the lower triangular M = L^-1, from the first panel down: rows above are final. */
static int square(size_t n, double *M, size_t ld, struct effort *effort)
{
    for (size_t j = 0; j < n; j += PANEL) {
        int width = (int)least(PANEL, n - j), below = (int)(n - j) - width, before = (int)j, lead = (int)ld;
        double *corner = M + j + j * ld;
        if (before > 0) {
            cblas_dtrmm(CblasColMajor, CblasLeft, CblasLower, CblasTrans, CblasNonUnit, width, before, 1, corner, lead,
                        M + j, lead);
            if (below > 0)
                cblas_dgemm(CblasColMajor, CblasTrans, CblasNoTrans, width, before, below, 1, corner + width, lead,
                            M + j + width, lead, 1, M + j, lead);
        }
        LAPACKE_dlauum_work(LAPACK_COL_MAJOR, 'L', width, corner, lead);
        if (below > 0)
            cblas_dsyrk(CblasColMajor, CblasLower, CblasTrans, width, below, 1, corner + width, lead, 1, corner, lead);
        double operations = (double)width * ((double)width * before + 2.0 * before * below + (double)width * below);
        if (effort_spent(effort, operations + (double)width * width * width / 3))
            return STATUS_INTERRUPTED;
    }
    return STATUS_OK;
}

int dense_inverse(size_t n, double *A, size_t ld, const double *pivot_min, struct effort *effort, size_t *pivot)
{
    int status = factor(n, A, ld, pivot_min, effort, pivot);
    if (status == STATUS_OK)
        status = invert(n, A, ld, effort, pivot);
    if (status == STATUS_OK)
        status = square(n, A, ld, effort);
    return status;
}
