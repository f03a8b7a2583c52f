/* Prescribed displacements as Lagrange multipliers on the whole model: the reference for every force that the bank
 * gives. Each constraint row touches the vertices of one triangle; the body answers through sparse solves. */
#include <lapacke.h>
#include <stdlib.h>
#include <string.h>

#include "model_state.h"

enum { BLOCK = 64 }; /* constraint columns solved at once: 2 x 64 vectors of workspace, whatever m is */

/* One row of B: surface vertices, barycentric weights, direction. A fixed component does not move: nothing to constrain. */
struct constraint {
    const uint32_t *vertex;
    const double *weight, *direction;
};

static void load(const struct model *model, const struct constraint *row, double *f)
{
    for (size_t k = 0; k < 3; k++)
        for (int a = 0; a < 3; a++)
            model_load(model, row->vertex[k], a, row->weight[k] * row->direction[a], f);
}

static double displacement(const struct model *model, const struct constraint *row, const double *u)
{
    double sum = 0;
    for (size_t k = 0; k < 3; k++)
        for (int a = 0; a < 3; a++)
            sum += row->weight[k] * row->direction[a] * model_displacement(model, row->vertex[k], a, u);
    return sum;
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
            load(model, &row[first + s], f + s * n);
        status = model_solve(model, width, f, u, why);
        for (size_t s = 0; s < width && status == STATUS_OK; s++)
            for (size_t r = 0; r < m; r++)
                C[r * m + first + s] = displacement(model, &row[r], u + s * n);
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
        row[r] = (struct constraint){vertex + 3 * r, weight + 3 * r, direction + 3 * r};
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
