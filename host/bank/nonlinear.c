#include "nonlinear.h"

#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model_state.h"
#include "neo_hookean.h"

enum {
    ITERATIONS_MAX = 40, /* of one load step: Newton takes 6 to 10; more means that the step is too long */
    HALVINGS_MAX = 30,   /* of a line search */
    PARTS_MAX = 64       /* a load step is not cut finer than this part of the way */
};
static const double DECREMENT = 1e-18; /* energy that a step still gains, of all: forces to 1e-9 of themselves */
static const double ROUNDING = 1e-10;  /* gains below this part of the energy are rounding error of its sum */
static const double ARMIJO = 1e-4;

struct nonlinear {
    struct model *model;
    struct element *element;
    cholmod_sparse *tangent;
    cholmod_factor *factor;
    double *gradient, *trial;
};

void nonlinear_free(struct nonlinear *n)
{
    if (!n)
        return;
    cholmod_free_sparse(&n->tangent, &n->model->common);
    cholmod_free_factor(&n->factor, &n->model->common);
    free(n->element);
    free(n->gradient);
    free(n->trial);
    free(n);
}

int nonlinear_create(struct model *model, struct nonlinear **out, struct failure *why)
{
    const struct mesh *mesh = model->mesh;
    *out = NULL;
    for (size_t t = 0; t < mesh->tetrahedron_count; t++)
        if (!model->materials.hooke[model->materials.of[t]].isotropic)
            return failure_set(why, STATUS_MODEL_MATERIAL, model->place, "give E and nu",
                               "a neo-Hookean material is isotropic");
    int status = model_order(model, why);
    if (status)
        return status;
    struct nonlinear *n = calloc(1, sizeof *n);
    if (!n)
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the non-linear body");
    n->model = model;
    n->element = malloc((mesh->tetrahedron_count + 1) * sizeof *n->element);
    n->gradient = malloc((model->unknowns + 1) * sizeof *n->gradient);
    n->trial = malloc((model->unknowns + 1) * sizeof *n->trial);
    n->tangent = cholmod_copy_sparse(model->K, &model->common);
    n->factor = cholmod_copy_factor(model->pattern, &model->common);
    if (!n->element || !n->gradient || !n->trial || !n->tangent || !n->factor) {
        nonlinear_free(n);
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the non-linear body");
    }
    for (size_t t = 0; t < mesh->tetrahedron_count; t++)
        n->element[t] = element_geometry(mesh->nodes, mesh->tetrahedra + 4 * t);
    *out = n;
    return STATUS_OK;
}

/* ---- the body ---- */

static const unsigned char at_6[9] = {0, 3, 4, 3, 1, 5, 4, 5, 2}; /* of a spring's tensor */

/* += the energy of the springs, their forces and tangent. */
static double add_springs(const struct nonlinear *n, const double *u, double *force, double *tangent)
{
    const struct model *m = n->model;
    const int32_t *start = m->K->p, *row = m->K->i;
    double energy = 0;
    for (size_t i = 0; m->spring && i < m->unknowns; i++) {
        const int32_t *own = m->unknown + 3 * (size_t)m->node[i];
        int a = own[0] == (int32_t)i ? 0 : own[1] == (int32_t)i ? 1 : 2;
        for (int b = 0; b < 3; b++) {
            if (own[b] < 0)
                continue;
            double k = m->spring[m->node[i]][at_6[3 * a + b]];
            energy += k * u[i] * u[own[b]] / 2;
            if (force)
                force[i] += k * u[own[b]];
            for (int32_t e = start[i]; tangent && b >= a && e < start[i + 1] && row[e] <= own[b]; e++)
                tangent[e] += row[e] == own[b] ? k : 0;
        }
    }
    return energy;
}

/* Add an element's tangent into the lower half. */
static void scatter(const struct nonlinear *n, const uint32_t *node, size_t nodes, const double *block)
{
    const int32_t *start = n->tangent->p, *row = n->tangent->i, *unknown = n->model->unknown;
    double *value = n->tangent->x;
    for (size_t k = 0; k < nodes; k++)
        for (int b = 0; b < 3; b++) {
            int32_t column = unknown[3 * (size_t)node[k] + (size_t)b];
            for (size_t j = 0; column >= 0 && j < nodes; j++)
                for (int a = 0; a < 3; a++) {
                    int32_t r = unknown[3 * (size_t)node[j] + (size_t)a];
                    if (r < column)
                        continue;
                    int32_t low = start[column], high = start[column + 1] - 1;
                    while (low < high) {
                        int32_t middle = (low + high) / 2;
                        if (row[middle] < r)
                            low = middle + 1;
                        else
                            high = middle;
                    }
                    value[low] += block[9 * (nodes * j + k) + (size_t)(3 * a + b)];
                }
        }
}

/* An element's displacements. */
static void gather(const struct model *m, const uint32_t *node, size_t nodes, const double *u, double *own)
{
    for (size_t i = 0; i < 3 * nodes; i++) {
        int32_t unknown = m->unknown[3 * (size_t)node[i / 3] + i % 3];
        own[i] = unknown >= 0 ? u[unknown] : 0;
    }
}

/* The energy, INFINITY when an element is inverted; `force` and the tangent on demand. */
static double evaluate(const struct nonlinear *n, const double *u, double *force, bool tangent, double *least_volume)
{
    const struct model *m = n->model;
    enum element_order order = m->space.order;
    size_t nodes = element_nodes(order);
    double energy = 0, own[3 * NEO_HOOKEAN_NODES], f[3 * NEO_HOOKEAN_NODES] = {0}, least = INFINITY;
    double block[9 * NEO_HOOKEAN_NODES * NEO_HOOKEAN_NODES];
    if (force)
        memset(force, 0, m->unknowns * sizeof *force);
    if (tangent)
        memset(n->tangent->x, 0, (size_t)((int32_t *)n->tangent->p)[m->unknowns] * sizeof(double));
    for (size_t t = 0; t < m->mesh->tetrahedron_count && isfinite(energy); t++) {
        const uint32_t *node = m->space.nodes + nodes * t;
        gather(m, node, nodes, u, own);
        double volume = 0;
        energy += neo_hookean_element(&n->element[t], m->materials.hooke[m->materials.of[t]].lame, order, own,
                                      force ? f : NULL, tangent ? block : NULL, &volume);
        least = fmin(least, volume);
        for (size_t i = 0; force && i < 3 * nodes; i++) {
            int32_t unknown = m->unknown[3 * (size_t)node[i / 3] + i % 3];
            if (unknown >= 0)
                force[unknown] += f[i];
        }
        if (tangent)
            scatter(n, node, nodes, block);
    }
    if (least_volume)
        *least_volume = least;
    return isfinite(energy) ? energy + add_springs(n, u, force, tangent ? n->tangent->x : NULL) : INFINITY;
}

bool nonlinear_force(const struct nonlinear *n, const double *u, double *force)
{
    return isfinite(evaluate(n, u, force, false, NULL));
}

/* ---- the tools ---- */

struct press {
    const struct nonlinear_rows *rows;
    double epsilon, *d; /* d of this load step */
    double *columns;    /* right-hand sides and solutions: the gradient's, then B^t, one after the other */
    double *solved;
    double *C, *q; /* rows^2, rows */
};

static void load(const struct model *m, const struct nonlinear_rows *rows, size_t r, double force_N, double *f)
{
    for (size_t k = rows->start[r]; k < rows->start[r + 1]; k++)
        for (int a = 0; a < 3; a++)
            model_load(m, rows->vertex[k], a, force_N * rows->weight[k] * rows->direction[3 * r + (size_t)a], f);
}

static double value(const struct model *m, const struct nonlinear_rows *rows, size_t r, const double *u)
{
    double sum = 0;
    for (size_t k = rows->start[r]; k < rows->start[r + 1]; k++)
        for (int a = 0; a < 3; a++)
            sum += rows->weight[k] * rows->direction[3 * r + (size_t)a] * model_displacement(m, rows->vertex[k], a, u);
    return sum;
}

/* E and p at u. */
static double energy(const struct nonlinear *n, const struct press *press, const double *u, double *p)
{
    double sum = evaluate(n, u, NULL, false, NULL);
    for (size_t r = 0; r < press->rows->count && isfinite(sum); r++) {
        p[r] = (press->d[r] - value(n->model, press->rows, r, u)) / press->epsilon;
        sum += press->epsilon * p[r] * p[r] / 2;
    }
    return sum;
}

/* Factor the tangent, stiffened by ever more of the linear one until it is positive definite. *good false: nothing helps,
 * elements are all but inverted. */
static int factor(struct nonlinear *n, bool *good, struct failure *why)
{
    cholmod_common *common = &n->model->common;
    size_t entries = (size_t)((int32_t *)n->tangent->p)[n->model->unknowns];
    double *x = n->tangent->x;
    const double *linear = n->model->K->x;
    for (double share = 0; share<100; share = share> 0 ? 10 * share : 0.1) {
        for (size_t e = 0; e < entries && share > 0; e++)
            x[e] += share * linear[e];
        cholmod_factorize(n->tangent, n->factor, common);
        *good = common->status == CHOLMOD_OK && n->factor->minor == n->model->unknowns;
        if (*good)
            return STATUS_OK;
        if (common->status < CHOLMOD_OK)
            return model_cholmod_failure(n->model, "factor", why);
    }
    return STATUS_OK;
}

/* The step du = -(T + B^t B / epsilon)^-1 gradient, by the tools' compliance, into solved[0 .. unknowns - 1]. *good false:
 * there is none. */
static int direction(struct nonlinear *n, const struct press *press, bool *good, struct failure *why)
{
    size_t m = press->rows->count, unknowns = n->model->unknowns;
    int status = factor(n, good, why);
    if (status || !*good)
        return status;
    memset(press->columns, 0, (m + 1) * unknowns * sizeof(double));
    cblas_daxpy((int)unknowns, -1, n->gradient, 1, press->columns, 1);
    for (size_t r = 0; r < m; r++)
        load(n->model, press->rows, r, 1, press->columns + (r + 1) * unknowns);
    status = model_solve_with(n->model, n->factor, m + 1, press->columns, press->solved, why);
    if (status)
        return status;
    for (size_t r = 0; r < m; r++) {
        press->q[r] = -value(n->model, press->rows, r, press->solved);
        for (size_t s = 0; s < m; s++)
            press->C[r * m + s] = value(n->model, press->rows, r, press->solved + (s + 1) * unknowns);
        press->C[r * m + r] += press->epsilon;
    }
    *good =
        !m || !LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', (lapack_int)m, 1, press->C, (lapack_int)m, press->q, (lapack_int)m);
    for (size_t r = 0; r < m; r++)
        cblas_daxpy((int)unknowns, press->q[r], press->solved + (r + 1) * unknowns, 1, press->solved, 1);
    return STATUS_OK;
}

/* Newton's method to the equilibrium at press->d. *found false: none near u; u and p are as they were given or later. */
static int equilibrium(struct nonlinear *n, const struct press *press, double *u, double *p,
                       struct nonlinear_report *report, bool *found, struct failure *why)
{
    int unknowns = (int)n->model->unknowns, status = STATUS_OK;
    double now = energy(n, press, u, p), last = INFINITY;
    *found = false;
    for (int k = 0; k < ITERATIONS_MAX; k++) {
        if (interrupted())
            return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while pressing the non-linear body");
        evaluate(n, u, n->gradient, true, &report->least_volume);
        for (size_t r = 0; r < press->rows->count; r++)
            load(n->model, press->rows, r, -p[r], n->gradient);
        bool good;
        status = direction(n, press, &good, why);
        if (status || !good)
            return status;
        report->iterations++;
        double gain = -cblas_ddot(unknowns, n->gradient, 1, press->solved, 1), part = 1, then = INFINITY;
        for (int h = 0; h < HALVINGS_MAX; h++, part /= 2) {
            memcpy(n->trial, u, n->model->unknowns * sizeof *u);
            cblas_daxpy(unknowns, part, press->solved, 1, n->trial, 1);
            then = energy(n, press, n->trial, p);
            if (then <= now - ARMIJO * part * gain || (isfinite(then) && gain <= ROUNDING * fabs(now)))
                break;
            then = INFINITY;
        }
        if (!isfinite(then))
            return STATUS_OK;
        memcpy(u, n->trial, n->model->unknowns * sizeof *u);
        now = then;
        /* converged, or as far as rounding lets it: quadratic convergence more than halves a gain */
        if (gain <= DECREMENT * fabs(now) || (gain <= ROUNDING * fabs(now) && gain > last / 2)) {
            *found = true;
            return STATUS_OK;
        }
        last = gain;
    }
    return STATUS_OK;
}

/* From the values `from` to d, in parts that are halved where no equilibrium is found and doubled where one is. */
static int follow(struct nonlinear *n, struct press *press, const double *from, const double *d, double *u, double *p,
                  double *kept, struct nonlinear_report *report, struct failure *why)
{
    size_t m = press->rows->count, unknowns = n->model->unknowns;
    double reached = 0, part = 1;
    while (reached < 1) {
        bool found;
        double next = fmin(1, reached + part);
        for (size_t r = 0; r < m; r++)
            press->d[r] = from[r] + next * (d[r] - from[r]);
        memcpy(kept, u, unknowns * sizeof *u);
        memcpy(kept + unknowns, p, m * sizeof *p);
        int status = equilibrium(n, press, u, p, report, &found, why);
        if (status)
            return status;
        report->parts++;
        part = found ? 2 * part : part / 2;
        reached = found ? next : reached;
        if (!found) {
            memcpy(u, kept, unknowns * sizeof *u);
            memcpy(p, kept + unknowns, m * sizeof *p);
        }
        if (part * PARTS_MAX < 1)
            return failure_set(why, STATUS_MODEL_NONLINEAR, n->model->place, "press less deep, or use a larger tool",
                               "the non-linear body finds no equilibrium beyond %.0f %% of this step", 100 * reached);
    }
    return STATUS_OK;
}

int nonlinear_press(struct nonlinear *n, const struct nonlinear_rows *rows, double epsilon_m_N, const double *d,
                    double *u, double *p, struct nonlinear_report *report, struct failure *why)
{
    size_t m = rows->count, unknowns = n->model->unknowns;
    struct press press = {.rows = rows,
                          .epsilon = epsilon_m_N,
                          .d = malloc((m + 1) * sizeof(double)),
                          .columns = malloc(((m + 1) * unknowns + 1) * sizeof(double)),
                          .solved = malloc(((m + 1) * unknowns + 1) * sizeof(double)),
                          .C = malloc((m * m + 1) * sizeof(double)),
                          .q = malloc((m + 1) * sizeof(double))};
    double *from = malloc((m + 1) * sizeof *from), *kept = malloc((unknowns + m + 1) * sizeof *kept);
    int status = STATUS_OK;
    *report = (struct nonlinear_report){0};
    if (!press.d || !press.columns || !press.solved || !press.C || !press.q || !from || !kept)
        status = failure_set(why, STATUS_MEMORY, n->model->place, NULL, "no memory for %zu constraints", m);
    for (size_t r = 0; r < m && !status; r++)
        from[r] = value(n->model, rows, r, u) + epsilon_m_N * p[r];
    if (!status)
        status = follow(n, &press, from, d, u, p, kept, report, why);
    if (!status)
        report->energy_J = evaluate(n, u, NULL, false, &report->least_volume);
    free(press.d);
    free(press.columns);
    free(press.solved);
    free(press.C);
    free(press.q);
    free(from);
    free(kept);
    return status;
}
