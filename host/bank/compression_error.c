#include "compression_error.h"

#include <lapacke.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "progress.h"

enum { MAX_PATCH = 10, MAX_ROWS = 3 * MAX_PATCH };

const char *const compression_error_kind[COMPRESSION_ERROR_KINDS] = {"one", "patch", "two", "field"};

static const double travel_m = 0.010, tilt_rad = 30 * 3.14159265358979 / 180, turn_rad = 10 * 3.14159265358979 / 180;

void compression_error_print(const struct compression_error *error, char *text, size_t room)
{
    size_t used = 0;
    *text = 0;
    for (int k = 0; k < COMPRESSION_ERROR_KINDS && used < room; k++)
        used += (size_t)snprintf(text + used, room - used, "%s%s %.3g %.3g", k ? ", " : "", compression_error_kind[k],
                                 100 * error->of[k].p95, 100 * error->of[k].max);
}

static double uniform(uint64_t *state) /* splitmix64, to [0, 1) */
{
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

struct contacts {
    size_t count;
    uint32_t vertex[3 * MAX_PATCH];
    double weight[3 * MAX_PATCH], displacement[3 * MAX_PATCH];
};

struct measurement {
    const struct contact_surface *surface;
    const struct compliance *G;
    const uint32_t *at;
    const struct factor *factor;
    uint64_t state;
    double *field, *exact; /* displacement of every row: the bank's, the reference's */
    size_t rows;
};

static bool free_triangle(const struct contact_surface *s, size_t t)
{
    const uint16_t *v = s->triangle[t].vertex;
    return s->row_of[v[0]] != BANK_NONE && s->row_of[v[1]] != BANK_NONE && s->row_of[v[2]] != BANK_NONE;
}

static void unit(double v[3])
{
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int k = 0; k < 3; k++)
        v[k] /= length;
}

/* A unit vector within `angle` of `axis`, or of any direction when axis is NULL: rejection from the cube. */
static void direction(uint64_t *state, const double *axis, double angle, double out[3])
{
    for (;;) { /* ends: a cap of 30 degrees is 3 % of the cube's directions */
        double length2 = 0, along = 0;
        for (int k = 0; k < 3; k++) {
            out[k] = 2 * uniform(state) - 1;
            length2 += out[k] * out[k];
        }
        if (length2 > 1 || length2 < 1e-4)
            continue;
        unit(out);
        for (int k = 0; k < 3 && axis; k++)
            along += axis[k] * out[k];
        if (!axis || along >= cos(angle))
            return;
    }
}

/* The `wanted` free triangles whose centroids are nearest to `spot`. */
static size_t neighbours(const struct contact_surface *s, const double spot[3], size_t wanted, uint32_t *near)
{
    double distance[MAX_PATCH];
    size_t found = 0;
    for (size_t t = 0; t < s->triangles; t++) {
        double d = 0;
        for (int k = 0; k < 3; k++) {
            double centre = 0;
            for (int i = 0; i < 3; i++)
                centre += (double)s->positions[3 * s->triangle[t].vertex[i] + k] / 3;
            d += (centre - spot[k]) * (centre - spot[k]);
        }
        if (!free_triangle(s, t) || (found == wanted && d >= distance[found - 1]))
            continue;
        size_t k = found < wanted ? found++ : wanted - 1;
        for (; k > 0 && distance[k - 1] > d; k--) {
            near[k] = near[k - 1];
            distance[k] = distance[k - 1];
        }
        near[k] = (uint32_t)t;
        distance[k] = d;
    }
    return found;
}

/* Add one tool of `wanted` contacts. */
static void add_tool(struct measurement *m, size_t wanted, struct contacts *c)
{
    const struct contact_surface *s = m->surface;
    uint32_t near[MAX_PATCH];
    size_t start = (size_t)(uniform(&m->state) * (double)s->triangles), first = c->count;
    while (!free_triangle(s, start))
        start = (start + 1) % s->triangles;
    double spot[3] = {0}, inward[3] = {0}, travel[3], axis[3], turn = turn_rad * (2 * uniform(&m->state) - 1);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++) {
            spot[k] += (double)s->positions[3 * s->triangle[start].vertex[i] + k] / 3;
            inward[k] -= (double)s->normals[3 * s->triangle[start].vertex[i] + k];
        }
    unit(inward);
    direction(&m->state, inward, tilt_rad, travel);
    direction(&m->state, NULL, 0, axis);
    c->count += neighbours(s, spot, wanted, near);
    for (size_t e = first; e < c->count; e++) {
        double a = uniform(&m->state), b = uniform(&m->state), arm[3] = {-spot[0], -spot[1], -spot[2]};
        if (a + b > 1) {
            a = 1 - a;
            b = 1 - b;
        }
        double w[3] = {1 - a - b, a, b};
        for (int i = 0; i < 3; i++) {
            uint32_t v = c->vertex[3 * e + i] = s->triangle[near[e - first]].vertex[i];
            c->weight[3 * e + i] = w[i];
            for (int k = 0; k < 3; k++)
                arm[k] += w[i] * (double)s->positions[3 * v + k];
        }
        for (int k = 0; k < 3; k++) {
            int p = (k + 1) % 3, q = (k + 2) % 3;
            c->displacement[3 * e + k] = travel_m * travel[k] + turn * (axis[p] * arm[q] - axis[q] * arm[p]);
        }
    }
}

/* Block (i, j), rows of the bank: exact and as the bank has it. */
static void blocks(const struct measurement *m, uint32_t i, uint32_t j, double exact[9], double held[9])
{
    size_t ld = 3 * m->G->rows, r = m->at ? m->at[i] : i, c = m->at ? m->at[j] : j;
    for (int k = 0; k < 9; k++) {
        size_t row = 3 * r + k / 3, column = 3 * c + k % 3;
        exact[k] = row >= column ? m->G->G[ld * column + row] : m->G->G[ld * row + column];
        held[k] = (double)(float)exact[k];
    }
    const struct factor *f = m->factor;
    if (!f)
        return;
    int32_t sum[9];
    row_dot(f->block + f->start[i], (uint32_t)(f->start[i + 1] - f->start[i]), f->block + f->start[j],
            (uint32_t)(f->start[j + 1] - f->start[j]), sum);
    for (int k = 0; k < 9; k++)
        held[k] = f->rounding.step * f->rounding.step * sum[k];
}

static int solve(size_t n, double *A, const double *d, double *p, struct failure *why)
{
    memcpy(p, d, n * sizeof *p);
    if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', (int)n, 1, A, (int)n, p, (int)n) != 0)
        return failure_set(why, STATUS_CHECK_FAILED, NULL, NULL,
                           "a contact system of the bank is not positive definite");
    return STATUS_OK;
}

/* Forces of the set, exact and by the bank. */
static int forces(const struct measurement *m, const struct contacts *c, double *exact, double *held,
                  struct failure *why)
{
    size_t n = 3 * c->count;
    double A[MAX_ROWS * MAX_ROWS] = {0}, B[MAX_ROWS * MAX_ROWS] = {0};
    for (size_t p = 0; p < n; p++) /* p, q: contact times 3 plus corner */
        for (size_t q = 0; q <= p; q++) {
            double g[9], h[9], w = c->weight[p] * c->weight[q];
            blocks(m, m->surface->row_of[c->vertex[p]], m->surface->row_of[c->vertex[q]], g, h);
            for (int k = 0; k < 9; k++) {
                size_t row = p / 3 * 3 + k / 3, column = q / 3 * 3 + k % 3;
                A[n * column + row] += w * g[k];
                B[n * column + row] += w * h[k];
                if (p / 3 == q / 3 && p != q) { /* the same contact: the transposed pair too */
                    A[n * (p / 3 * 3 + k / 3) + q / 3 * 3 + k % 3] += w * g[k];
                    B[n * (p / 3 * 3 + k / 3) + q / 3 * 3 + k % 3] += w * h[k];
                }
            }
        }
    for (size_t k = 0; k < n; k++) {
        A[(n + 1) * k] += m->surface->regularisation_m_N;
        B[(n + 1) * k] += m->surface->regularisation_m_N;
    }
    int status = solve(n, A, c->displacement, exact, why);
    return status ? status : solve(n, B, c->displacement, held, why);
}

static double relative(size_t n, const double *exact, const double *held)
{
    double difference = 0, size = 0;
    for (size_t k = 0; k < n; k++) {
        difference += (held[k] - exact[k]) * (held[k] - exact[k]);
        size += exact[k] * exact[k];
    }
    return sqrt(difference / size);
}

/* Displacement of every row under the set's forces. */
static double field_error(struct measurement *m, const struct contacts *c, const double *exact, const double *held)
{
    memset(m->field, 0, 3 * m->rows * sizeof *m->field);
    memset(m->exact, 0, 3 * m->rows * sizeof *m->exact);
    for (uint32_t i = 0; i < m->rows; i++)
        for (size_t q = 0; q < 3 * c->count; q++) {
            double g[9], h[9];
            blocks(m, i, m->surface->row_of[c->vertex[q]], g, h);
            for (int k = 0; k < 9; k++) {
                m->exact[3 * i + k / 3] += g[k] * c->weight[q] * exact[q / 3 * 3 + k % 3];
                m->field[3 * i + k / 3] += h[k] * c->weight[q] * held[q / 3 * 3 + k % 3];
            }
        }
    return relative(3 * m->rows, m->exact, m->field);
}

static int rising(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* One kind: `trials` sets. Every kind draws from a seed of its own, so that it does not depend on which others are asked. */
static int run(struct measurement *m, int kind, size_t trials, double *found, struct failure *why)
{
    for (size_t t = 0; t < trials; t++) {
        if (interrupted())
            return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while measuring the compression");
        struct contacts c = {0};
        double exact[MAX_ROWS], held[MAX_ROWS];
        size_t more = (size_t)(8 * uniform(&m->state));
        add_tool(m, kind == COMPRESSION_ERROR_ONE ? 1 : kind == COMPRESSION_ERROR_TWO ? 3 + more % 3 : 3 + more, &c);
        if (kind == COMPRESSION_ERROR_TWO)
            add_tool(m, 3 + more / 3, &c);
        int status = forces(m, &c, exact, held, why);
        if (status)
            return status;
        found[t] =
            kind == COMPRESSION_ERROR_FIELD ? field_error(m, &c, exact, held) : relative(3 * c.count, exact, held);
    }
    qsort(found, trials, sizeof *found, rising);
    return STATUS_OK;
}

int compression_error_measure(const struct contact_surface *surface, const struct compliance *G, const uint32_t *at,
                              const struct factor *factor, unsigned kinds, size_t trials, uint64_t seed,
                              struct compression_error *error, struct failure *why)
{
    *error = (struct compression_error){.trials = trials};
    bool any = false;
    for (size_t t = 0; t < surface->triangles && !any; t++)
        any = free_triangle(surface, t);
    if (!any)
        return failure_set(why, STATUS_SCENE_SELECTION, NULL, "fix fewer nodes",
                           "every surface triangle has a fixed vertex");
    struct measurement m = {.surface = surface, .G = G, .at = at, .factor = factor, .rows = G->rows};
    double *found = malloc((trials + 1) * sizeof *found);
    m.field = malloc(3 * m.rows * sizeof *m.field);
    m.exact = malloc(3 * m.rows * sizeof *m.exact);
    int status = STATUS_OK;
    if (!found || !m.field || !m.exact)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to measure the force error");
    for (int kind = 0; kind < COMPRESSION_ERROR_KINDS && !status; kind++) {
        size_t sets = kind == COMPRESSION_ERROR_FIELD ? (trials + 3) / 4 : trials;
        if (!(kinds >> kind & 1) || sets == 0)
            continue;
        m.state = seed + 0x100000000u * (uint64_t)kind;
        status = run(&m, kind, sets, found, why);
        if (!status)
            error->of[kind] = (struct error_figures){found[(size_t)ceil(0.95 * (double)sets) - 1], found[sets - 1]};
    }
    free(found);
    free(m.field);
    free(m.exact);
    return status;
}
