/* Prescribed displacements as Lagrange multipliers on the whole model: the reference for every force that the bank
 * gives. Each constraint row touches at most nine unknowns; the body answers through sparse solves. */
#include <lapacke.h>
#include <stdlib.h>
#include <string.h>

#include "model_state.h"

enum { BLOCK = 64 }; /* constraint columns solved at once: 2 x 64 vectors of workspace, whatever m is */

struct constraint {
    int32_t unknown[9]; /* -1: a fixed component, which does not move: nothing to constrain */
    double factor[9];
};

static struct constraint constraint_row(const struct model *model, const uint32_t *vertex, const double *weight,
                                        const double *direction)
{
    struct constraint row;
    for (size_t k = 0; k < 3; k++)
        for (size_t a = 0; a < 3; a++) {
            row.unknown[3 * k + a] = model_unknown(model, model->surface->node[vertex[k]], (int)a);
            row.factor[3 * k + a] = weight[k] * direction[a];
        }
    return row;
}

/* C = B K^-1 B^t, row-major; symmetric to the last bit. */
static int constraint_compliance(struct model *model, size_t m, const struct constraint *row, double *C,
                                 struct failure *why)
{
    size_t n = model->unknowns, width_max = m < BLOCK ? m : BLOCK;
    double *f = malloc((n * width_max + 1) * sizeof *f), *u = malloc((n * width_max + 1) * sizeof *u);
    int status = STATUS_OK;
    if (!f || !u)
        status = failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for %zu constraints", m);
    for (size_t first = 0; first < m && status == STATUS_OK; first += BLOCK) {
        size_t width = m - first < BLOCK ? m - first : BLOCK;
        memset(f, 0, n * width * sizeof *f);
        for (size_t s = 0; s < width; s++)
            for (int k = 0; k < 9; k++)
                if (row[first + s].unknown[k] >= 0)
                    f[s * n + (size_t)row[first + s].unknown[k]] += row[first + s].factor[k];
        status = model_solve(model, width, f, u, why);
        for (size_t s = 0; s < width && status == STATUS_OK; s++)
            for (size_t r = 0; r < m; r++) {
                double sum = 0;
                for (int k = 0; k < 9; k++)
                    if (row[r].unknown[k] >= 0)
                        sum += row[r].factor[k] * u[s * n + (size_t)row[r].unknown[k]];
                C[r * m + first + s] = sum;
            }
    }
    for (size_t r = 0; r < m && status == STATUS_OK; r++)
        for (size_t s = 0; s < r; s++)
            C[r * m + s] = C[s * m + r] = (C[r * m + s] + C[s * m + r]) / 2;
    free(f);
    free(u);
    return status;
}

/* A constraint of which less than this part is independent of the earlier ones is rounding error, not a constraint. */
static const double INDEPENDENT_MIN = 1e-12;

/* p from (C + epsilon I) p = d; C is overwritten by its factor. */
static int multipliers(const struct model *model, size_t m, double *C, double epsilon, const double *d, double *p,
                       struct failure *why)
{
    double *diagonal = malloc(m * sizeof *diagonal);
    if (!diagonal)
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for %zu constraints", m);
    for (size_t r = 0; r < m; r++)
        diagonal[r] = C[r * m + r] += epsilon;
    memcpy(p, d, m * sizeof *p);
    lapack_int info = LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', (lapack_int)m, 1, C, (lapack_int)m, p, (lapack_int)m);
    size_t dependent = info > 0 ? (size_t)info - 1 : 0;
    bool good = info == 0;
    for (size_t r = 0; r < m && good; r++)
        if (!(C[r * m + r] * C[r * m + r] > INDEPENDENT_MIN * diagonal[r])) {
            dependent = r;
            good = false;
        }
    free(diagonal);
    if (good)
        return STATUS_OK;
    return failure_set(why, STATUS_MODEL_FACTOR, model->place,
                       "move the contacts apart and off the fixed nodes, or give epsilon > 0",
                       "constraint %zu depends on the earlier ones or lies on fixed nodes", dependent);
}

int model_constrained(struct model *model, size_t m, const uint32_t *vertex, const double *weight,
                      const double *direction, double epsilon, const double *d, double *p, double *compliance,
                      struct failure *why)
{
    struct constraint *row = malloc((m + 1) * sizeof *row);
    double *C = malloc((m * m + 1) * sizeof *C);
    int status = STATUS_OK;
    if (!row || !C)
        status = failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for %zu constraints", m);
    for (size_t r = 0; r < m && status == STATUS_OK; r++)
        row[r] = constraint_row(model, vertex + 3 * r, weight + 3 * r, direction + 3 * r);
    if (status == STATUS_OK)
        status = constraint_compliance(model, m, row, C, why);
    if (status == STATUS_OK && compliance)
        memcpy(compliance, C, m * m * sizeof *C);
    if (status == STATUS_OK && d && p && m > 0)
        status = multipliers(model, m, C, epsilon, d, p, why);
    free(row);
    free(C);
    return status;
}
