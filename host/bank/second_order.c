#include "second_order.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model_state.h"
#include "neo_hookean.h"
#include "progress.h"

_Static_assert((int)SECOND_ORDER_TERMS == (int)NEO_HOOKEAN_CUBIC, "one order of the monomials");

static const unsigned char power[SECOND_ORDER_TERMS][3] = {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}, {2, 1, 0}, {2, 0, 1},
                                                           {1, 2, 0}, {0, 2, 1}, {1, 0, 2}, {0, 1, 2}, {1, 1, 1}};

/* Coefficients from the values at these directions. */
enum { X, Y, Z, XpY, XmY, XpZ, XmZ, YpZ, YmZ, XYZ };
static const double probe[SECOND_ORDER_TERMS][3] = {{1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, -1, 0},
                                                    {1, 0, 1}, {1, 0, -1}, {0, 1, 1}, {0, 1, -1}, {1, 1, 1}};

static void coefficients(const double T[SECOND_ORDER_TERMS], double c[SECOND_ORDER_TERMS])
{
    c[0] = T[X];
    c[1] = T[Y];
    c[2] = T[Z];
    /* T(x + y) = xxx + yyy + xxy + xyy, T(x - y) = xxx - yyy - xxy + xyy */
    c[3] = (T[XpY] - T[XmY]) / 2 - T[Y];
    c[5] = (T[XpY] + T[XmY]) / 2 - T[X];
    c[4] = (T[XpZ] - T[XmZ]) / 2 - T[Z];
    c[7] = (T[XpZ] + T[XmZ]) / 2 - T[X];
    c[6] = (T[YpZ] - T[YmZ]) / 2 - T[Z];
    c[8] = (T[YpZ] + T[YmZ]) / 2 - T[Y];
    c[9] = T[XYZ];
    for (int k = 0; k < 9; k++)
        c[9] -= c[k];
}

enum { BATCH = 21 }; /* tools per solve: 63 right-hand sides */

struct work {
    struct model *model;
    struct element *element;
    double *columns, *fields; /* 3 BATCH of each */
};

static void work_free(struct work *w)
{
    free(w->element);
    free(w->columns);
    free(w->fields);
}

static int work_create(struct model *model, struct work *w, struct failure *why)
{
    const struct mesh *mesh = model->mesh;
    for (size_t t = 0; t < mesh->tetrahedron_count; t++)
        if (!model->materials.hooke[model->materials.of[t]].isotropic)
            return failure_set(why, STATUS_MODEL_MATERIAL, model->place, "give E and nu",
                               "a neo-Hookean material is isotropic");
    *w = (struct work){.model = model,
                       .element = malloc((mesh->tetrahedron_count + 1) * sizeof *w->element),
                       .columns = malloc(3 * BATCH * model->unknowns * sizeof(double)),
                       .fields = malloc(3 * BATCH * model->unknowns * sizeof(double))};
    if (!w->element || !w->columns || !w->fields) {
        work_free(w);
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the fields of %d tools", BATCH);
    }
    for (size_t t = 0; t < mesh->tetrahedron_count; t++)
        w->element[t] = element_geometry(mesh->nodes, mesh->tetrahedra + 4 * t);
    return STATUS_OK;
}

/* A = C^-1 from the tool's three solved columns, which become the fields under unit displacements. */
static int answer(const struct work *w, const struct nonlinear_rows *rows, size_t first, double epsilon_m_N,
                  double *columns, struct second_order *site, struct failure *why)
{
    size_t unknowns = w->model->unknowns;
    double *A = &site->A[0][0];
    for (size_t r = 0; r < 3; r++)
        for (size_t s = 0; s < 3; s++) {
            A[3 * r + s] = r == s ? epsilon_m_N : 0;
            for (size_t k = rows->start[first + r]; k < rows->start[first + r + 1]; k++)
                for (int a = 0; a < 3; a++)
                    A[3 * r + s] += rows->weight[k] * rows->direction[3 * (first + r) + (size_t)a] *
                                    model_displacement(w->model, rows->vertex[k], a, columns + s * unknowns);
        }
    if (LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', 3, A, 3) || LAPACKE_dpotri(LAPACK_COL_MAJOR, 'L', 3, A, 3))
        return failure_set(why, STATUS_MODEL_FACTOR, w->model->place, "move the tool off the fixed nodes",
                           "the tool's compliance is not positive definite");
    for (int r = 0; r < 3; r++)
        for (int s = 0; s < r; s++)
            site->A[r][s] = site->A[s][r];
    for (size_t i = 0; i < unknowns; i++) {
        const double f[3] = {columns[i], columns[unknowns + i], columns[2 * unknowns + i]};
        for (size_t s = 0; s < 3; s++)
            columns[s * unknowns + i] = f[0] * site->A[0][s] + f[1] * site->A[1][s] + f[2] * site->A[2][s];
    }
    return STATUS_OK;
}

/* The cubic energy of a batch of tools: element by element, as each element serves all. */
static void add_energies(const struct work *w, size_t tools, const double *fields, struct second_order *site)
{
    const struct model *m = w->model;
    size_t nodes = element_nodes(m->space.order), unknowns = m->unknowns;
    for (size_t t = 0; t < m->mesh->tetrahedron_count; t++) {
        struct lame material = m->materials.hooke[m->materials.of[t]].lame;
        int32_t unknown[3 * NEO_HOOKEAN_NODES];
        for (size_t i = 0; i < 3 * nodes; i++)
            unknown[i] = m->unknown[3 * (size_t)m->space.nodes[nodes * t + i / 3] + i % 3];
        for (size_t s = 0; s < tools; s++) {
            double u[9 * NEO_HOOKEAN_NODES];
            for (size_t k = 0; k < 3; k++)
                for (size_t i = 0; i < 3 * nodes; i++)
                    u[3 * nodes * k + i] = unknown[i] >= 0 ? fields[(3 * s + k) * unknowns + (size_t)unknown[i]] : 0;
            neo_hookean_cubic(&w->element[t], material, m->space.order, u, site[s].cubic);
        }
    }
}

static int find(const struct work *w, size_t sites, const struct nonlinear_rows *rows, double epsilon_m_N,
                struct second_order *site, struct progress *bar, struct failure *why)
{
    size_t unknowns = w->model->unknowns;
    memset(site, 0, sites * sizeof *site);
    for (size_t first = 0; first < sites; first += BATCH) {
        size_t tools = sites - first < BATCH ? sites - first : BATCH;
        if (interrupted())
            return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted after %zu of %zu tools", first, sites);
        memset(w->columns, 0, 3 * tools * unknowns * sizeof(double));
        for (size_t r = 0; r < 3 * tools; r++)
            for (size_t k = rows->start[3 * first + r]; k < rows->start[3 * first + r + 1]; k++)
                for (int a = 0; a < 3; a++)
                    model_load(w->model, rows->vertex[k], a,
                               rows->weight[k] * rows->direction[3 * (3 * first + r) + (size_t)a],
                               w->columns + r * unknowns);
        int status = model_solve(w->model, 3 * tools, w->columns, w->fields, why);
        for (size_t s = 0; s < tools && !status; s++)
            status = answer(w, rows, 3 * (first + s), epsilon_m_N, w->fields + 3 * s * unknowns, &site[first + s], why);
        if (status)
            return status;
        add_energies(w, tools, w->fields, site + first);
        progress_show(bar, (double)(first + tools) / (double)sites);
    }
    return STATUS_OK;
}

int second_order_find(struct model *model, size_t sites, const struct nonlinear_rows *rows, double epsilon_m_N,
                      struct second_order *site, bool quiet, struct failure *why)
{
    struct work work;
    struct progress bar;
    int status = work_create(model, &work, why);
    if (status)
        return status;
    progress_start(&bar, "second-order answer of the body", quiet);
    status = find(&work, sites, rows, epsilon_m_N, site, &bar, why);
    progress_end(&bar);
    work_free(&work);
    return status;
}

double second_order_energy(const struct second_order *site, const double d[3])
{
    double sum = 0;
    for (int k = 0; k < SECOND_ORDER_TERMS; k++) {
        double term = site->cubic[k];
        for (int a = 0; a < 3; a++)
            for (int times = power[k][a]; times > 0; times--)
                term *= d[a];
        sum += term;
    }
    return sum;
}

void second_order_map(const struct second_order *site, const double M[9], double cubic[SECOND_ORDER_TERMS])
{
    double T[SECOND_ORDER_TERMS];
    for (int k = 0; k < SECOND_ORDER_TERMS; k++) {
        double d[3];
        for (int a = 0; a < 3; a++)
            d[a] = M[3 * a] * probe[k][0] + M[3 * a + 1] * probe[k][1] + M[3 * a + 2] * probe[k][2];
        T[k] = second_order_energy(site, d);
    }
    coefficients(T, cubic);
}

void second_order_force(const struct second_order *site, const double d[3], double force[3])
{
    for (int a = 0; a < 3; a++) {
        force[a] = 0;
        for (int k = 0; k < SECOND_ORDER_TERMS; k++) {
            double term = site->cubic[k] * power[k][a];
            for (int b = 0; b < 3; b++)
                for (int times = power[k][b] - (a == b); times > 0; times--)
                    term *= d[b];
            force[a] += term;
        }
    }
}

double second_order_range(const struct second_order *site, const double direction[3])
{
    double g[3], linear = 0, second = 0; /* force along it at depth s: linear s + second s^2 */
    second_order_force(site, direction, g);
    for (int a = 0; a < 3; a++) {
        second += g[a] * direction[a];
        for (int b = 0; b < 3; b++)
            linear += direction[a] * site->A[a][b] * direction[b];
    }
    return second < 0 ? -linear / (2 * second) : INFINITY;
}

/* |3 T| at d.A d = 1. */
static double steepness(const struct second_order *site, const double d[3])
{
    double Q = 0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            Q += d[a] * site->A[a][b] * d[b];
    return fabs(3 * second_order_energy(site, d)) / (Q * sqrt(Q));
}

/* Directions that cover the half sphere (a Fibonacci lattice) in the axes in which A is 1; the best of them is improved by smaller
 * and smaller turns. */
double second_order_range_J(const struct second_order *site)
{
    enum { DIRECTIONS = 256, TURNS = 40 };
    double L[9], best[3] = {0, 0, 1}, most = 0, step = 0.15;
    memcpy(L, site->A, sizeof L);
    LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', 3, L, 3);
    for (int k = 0; k < DIRECTIONS + 6 * TURNS; k++) {
        double y[3], d[3];
        int turn = k - DIRECTIONS;
        if (turn < 0) {
            double z = (k + 0.5) / DIRECTIONS, r = sqrt(1 - z * z), angle = 2.399963229728653 * k;
            memcpy(y, (double[3]){r * cos(angle), r * sin(angle), z}, sizeof y);
        } else {
            memcpy(y, best, sizeof y);
            y[turn % 3] += turn / 3 % 2 ? step : -step;
            step *= turn % 6 == 5 ? 0.75 : 1;
        }
        memcpy(d, y, sizeof d); /* L^t d = y */
        LAPACKE_dtrtrs(LAPACK_ROW_MAJOR, 'L', 'T', 'N', 3, 1, L, 3, d, 1);
        double now = steepness(site, d);
        if (now > most) {
            most = now;
            memcpy(best, y, sizeof best);
        }
    }
    return 1 / (16 * most * most);
}
