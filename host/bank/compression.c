#include "compression.h"

#include <math.h>
#include <stdlib.h>

#include "progress.h"
#include "row_encode.h"

enum { MAX_TRIES = 10 };

struct search {
    const struct compliance *G;
    struct contact_surface surface; /* rows in the order of the factor */
    const struct order *order;
    struct cholesky cholesky;
    struct progress bar;
    int tries;
};

/* Round at a relative step, and unless `error` is NULL measure the patch error. */
static int try_step(struct search *s, double step, struct factor *factor, double *error, struct failure *why)
{
    struct rounding rounding;
    rounding_choose(s->order, &s->cholesky, step, &rounding);
    int status = rounding_run(s->G, s->order, &s->cholesky, &rounding, factor, why);
    if (!status && error) {
        struct compression_error measured;
        status = compression_error_measure(&s->surface, s->G, s->order->at, factor, 1u << COMPRESSION_ERROR_PATCH,
                                           COMPRESSION_TRIALS, COMPRESSION_SEED, &measured, why);
        *error = measured.of[COMPRESSION_ERROR_PATCH].p95;
        if (status)
            factor_free(factor);
    }
    progress_show(&s->bar, (double)++s->tries / MAX_TRIES);
    return status;
}

/* The coarsest step found whose error is at most `target`: the error grows about as the step, so each try scales by what
 * is missing, between what was too coarse and what was good. */
static int find_step(struct search *s, double target, double *step, struct factor *factor, struct failure *why)
{
    double next = COMPRESSION_STEP * target / 0.005, good = 0, bad = COMPRESSION_STEP_MAX, least = INFINITY;
    for (int k = 0; k < MAX_TRIES; k++) {
        struct factor found;
        double error, at = fmax(COMPRESSION_STEP_MIN, fmin(COMPRESSION_STEP_MAX, next));
        int status = try_step(s, at, &found, &error, why);
        if (status) {
            factor_free(factor);
            return status;
        }
        least = fmin(least, error);
        if (error <= target && at > good) {
            factor_free(factor);
            *factor = found;
            *step = good = at;
        } else
            factor_free(&found);
        if (error > target && at < bad)
            bad = at;
        if ((error <= target && error >= 0.97 * target) || at == COMPRESSION_STEP_MIN ||
            (good > 0 && bad < 1.02 * good) || good == COMPRESSION_STEP_MAX)
            break;
        next = at * pow(0.98 * target / error, 1.1);
        if (next <= good || (next >= bad && bad < COMPRESSION_STEP_MAX))
            next = good > 0 ? sqrt(good * bad) : 0.5 * bad;
    }
    if (good == 0)
        return failure_set(why, STATUS_CHECK_FAILED, NULL, "allow more, or build with --plain",
                           "a force error of %.3g %% cannot be met; the best compressed bank of this body has %.3g %%",
                           100 * target, 100 * least);
    return STATUS_OK;
}

int compress_compliance(const struct compliance *G, const double *position, const struct contact_surface *surface,
                        const struct compression *wanted, bool quiet, struct compressed *c, struct failure *why)
{
    *c = (struct compressed){0};
    struct search s = {.G = G, .surface = *surface, .order = &c->order};
    struct factor factor = {0};
    size_t n = G->rows;
    uint16_t *rank = malloc(n * sizeof *rank), *row_of = malloc(BANK_MAX_VERTICES * sizeof *row_of);
    int status = rank && row_of ? order_maximin(n, position, &c->order, why)
                                : failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to order the rows");
    progress_start(&s.bar, "compressing", quiet);
    if (!status)
        status = cholesky_build(G, &c->order, &s.cholesky, why);
    if (!status) {
        for (size_t k = 0; k < n; k++)
            rank[c->order.at[k]] = (uint16_t)k;
        for (size_t v = 0; v < surface->vertices; v++)
            row_of[v] = surface->row_of[v] == BANK_NONE ? BANK_NONE : rank[surface->row_of[v]];
        s.surface.row_of = row_of;
        c->step = wanted->step > 0 ? wanted->step : COMPRESSION_STEP;
        status = wanted->force_error > 0 ? find_step(&s, wanted->force_error, &c->step, &factor, why)
                                         : try_step(&s, c->step, &factor, NULL, why);
    }
    cholesky_free(&s.cholesky);
    if (!status)
        status = row_encode(&factor, &c->order, &c->bytes, &c->length, why);
    progress_end(&s.bar);
    factor_free(&factor);
    free(rank);
    free(row_of);
    if (status)
        compressed_free(c);
    return status;
}

void compressed_free(struct compressed *c)
{
    order_free(&c->order);
    free(c->bytes);
    *c = (struct compressed){0};
}
