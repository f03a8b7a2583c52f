#include "modes.h"

#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "model_state.h"
#include "progress.h"

enum { GUARD = 8, MOST_ROUNDS = 300 };
static const double STANDS = 1e-9; /* relative change of omega^2 in a round */

/* Numbers in -1 .. 1 that repeat. */
static double spread(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) / 4503599627370496.0 - 1;
}

/* n x p, column after column. */
struct subspace {
    const struct model *model;
    size_t n, p;
    double *X, *Y; /* the space, M-orthonormal; K^-1 M of it */
    double *A, *B; /* p x p: Y' K Y = Y' M X and Y' M Y */
    double *value;
};

static void times_mass(const struct subspace *s, const double *from, double *to)
{
    for (size_t c = 0; c < s->p; c++)
        for (size_t i = 0; i < s->n; i++)
            to[c * s->n + i] = s->model->mass_kg[i] * from[c * s->n + i];
}

static void products(const struct subspace *s, const double *right, double *out)
{
    int n = (int)s->n, p = (int)s->p;
    cblas_dgemm(CblasColMajor, CblasTrans, CblasNoTrans, p, p, n, 1, s->Y, n, right, n, 0, out, p);
}

/* One round: Y = K^-1 M X, then X = Y Q with Q from the small eigenproblem A q = omega^2 B q. */
static int turn(struct subspace *s, struct model *model, struct failure *why)
{
    int n = (int)s->n, p = (int)s->p;
    times_mass(s, s->X, s->X); /* X <- M X */
    int status = model_solve(model, s->p, s->X, s->Y, why);
    if (status)
        return status;
    products(s, s->X, s->A);
    times_mass(s, s->Y, s->X);
    products(s, s->X, s->B);
    if (LAPACKE_dsygv(LAPACK_COL_MAJOR, 1, 'V', 'L', p, s->A, p, s->B, p, s->value) != 0)
        return failure_set(why, STATUS_MODEL_FACTOR, model->place, "ask for fewer modes",
                           "the modes could not be told apart");
    cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, n, p, p, 1, s->Y, n, s->A, p, 0, s->X, n);
    return STATUS_OK;
}

static int iterate(struct subspace *s, struct model *model, size_t wanted, struct failure *why)
{
    uint64_t state = 1;
    for (size_t i = 0; i < s->n * s->p; i++)
        s->X[i] = spread(&state);
    double last[MODES_MAX] = {0};
    for (int round = 0; round < MOST_ROUNDS; round++) {
        if (interrupted())
            return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while looking for modes");
        int status = turn(s, model, why);
        if (status)
            return status;
        bool stands = true;
        for (size_t k = 0; k < wanted; k++) {
            stands = stands && fabs(s->value[k] - last[k]) <= STANDS * s->value[k];
            last[k] = s->value[k];
        }
        if (stands)
            return STATUS_OK;
    }
    return failure_set(why, STATUS_MODEL_FACTOR, model->place, "ask for fewer modes",
                       "the %zu slowest modes did not converge in %d rounds", wanted, (int)MOST_ROUNDS);
}

static int keep(const struct subspace *s, const struct model *model, struct modes *modes, struct failure *why)
{
    size_t vertices = model->surface->vertex_count;
    modes->share = malloc((modes->count * 3 * vertices + 1) * sizeof *modes->share);
    if (!modes->share)
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the modes");
    for (size_t k = 0; k < modes->count; k++) {
        modes->omega_rad_s[k] = sqrt(s->value[k]);
        for (size_t v = 0; v < vertices; v++)
            for (int c = 0; c < 3; c++)
                modes->share[3 * (k * vertices + v) + (size_t)c] =
                    model_displacement(model, (uint32_t)v, c, s->X + k * s->n) / modes->omega_rad_s[k];
    }
    return STATUS_OK;
}

int modes_find(struct model *model, size_t count, struct modes *modes, struct failure *why)
{
    *modes = (struct modes){.count = count};
    size_t n = model->unknowns, p = count + GUARD;
    if (count < 1 || count > MODES_MAX)
        return failure_set(why, STATUS_SCENE_VALUE, model->place, NULL, "%zu modes: 1 to %d are possible", count,
                           (int)MODES_MAX);
    if (p > n)
        p = n;
    if (count > n || !(model->total_mass_kg > 0))
        return failure_set(why, STATUS_SCENE_VALUE, model->place, "give rho > 0",
                           "a body of %zu unknowns and %g kg has no %zu modes", n, model->total_mass_kg, count);
    struct subspace s = {.model = model, .n = n, .p = p};
    s.X = malloc((n * p + 1) * sizeof(double));
    s.Y = malloc((n * p + 1) * sizeof(double));
    s.A = malloc((p * p + 1) * sizeof(double));
    s.B = malloc((p * p + 1) * sizeof(double));
    s.value = malloc((p + 1) * sizeof(double));
    int status = STATUS_OK;
    if (!s.X || !s.Y || !s.A || !s.B || !s.value)
        status = failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for %zu modes", count);
    if (!status)
        status = iterate(&s, model, count, why);
    if (!status)
        status = keep(&s, model, modes, why);
    free(s.X);
    free(s.Y);
    free(s.A);
    free(s.B);
    free(s.value);
    return status;
}

void modes_free(struct modes *modes)
{
    free(modes->share);
    *modes = (struct modes){0};
}
