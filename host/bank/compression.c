#include "compression.h"

#include <math.h>
#include <stdlib.h>

#include "progress.h"
#include "row_encode.h"
#include "step_search.h"

enum { MAX_CONFIRMATIONS = 4 };
static const double keep =
    1 - 1e-4; /* the bank's step is a float32: what is measured on it may differ in the sixth digit */

/* One step tried. */
struct attempt {
    double step;
    struct factor factor;
    unsigned char *bytes; /* NULL: not coded */
    size_t length;
};

struct search {
    const struct compliance *G;
    const struct compression *wanted;
    struct contact_surface surface; /* rows in the order of the factor */
    const struct order *order;
    struct cholesky cholesky;
    struct progress bar;
    int tries;
};

double compression_padded(size_t length)
{
    return (double)((length + BANK_ALIGNMENT - 1) / BANK_ALIGNMENT * BANK_ALIGNMENT);
}

static void attempt_free(struct attempt *a)
{
    factor_free(&a->factor);
    free(a->bytes);
    *a = (struct attempt){0};
}

static int attempt_make(struct search *s, double step, bool code, struct attempt *a, struct failure *why)
{
    struct rounding rounding;
    *a = (struct attempt){.step = step};
    rounding_choose(s->order, &s->cholesky, step, &rounding);
    int status = rounding_run(s->G, s->order, &s->cholesky, &rounding, &a->factor, why);
    if (!status && code)
        status = row_encode(&a->factor, s->order, &a->bytes, &a->length, why);
    if (status)
        attempt_free(a);
    const int expected = s->wanted->force_error > 0 || s->wanted->bytes > 0 ? STEP_SEARCH_TRIES : 1;
    progress_show(&s->bar, fmin(1, (double)++s->tries / expected));
    return status;
}

static int patch_error(struct search *s, const struct attempt *a, uint64_t seed, double *error, struct failure *why)
{
    struct compression_error measured;
    int status = compression_error_measure(&s->surface, s->G, s->order->at, &a->factor, 1u << COMPRESSION_ERROR_PATCH,
                                           COMPRESSION_TRIALS, seed, &measured, why);
    *error = measured.of[COMPRESSION_ERROR_PATCH].p95;
    return status;
}

static double total_bytes(const struct search *s, const struct attempt *a)
{
    return s->wanted->rest_bytes + compression_padded(a->length);
}

/* The best step for a limit of bytes, or of the error; `best` is empty when there is none (range->good). */
static int find(struct search *s, bool for_bytes, double limit, double first, struct step_search *range,
                struct attempt *best, struct failure *why)
{
    double step, value = 0;
    *best = (struct attempt){0};
    step_search_start(range, for_bytes, limit, COMPRESSION_STEP_MIN, COMPRESSION_STEP_MAX, first);
    while (step_search_next(range, &step)) {
        struct attempt now;
        int status = attempt_make(s, step, for_bytes, &now, why);
        if (!status && !for_bytes)
            status = patch_error(s, &now, COMPRESSION_SEARCH_SEED, &value, why);
        if (status) {
            attempt_free(&now);
            attempt_free(best);
            return status;
        }
        if (for_bytes)
            value = total_bytes(s, &now);
        if (step_search_found(range, value)) {
            attempt_free(best);
            *best = now;
        } else
            attempt_free(&now);
    }
    return STATUS_OK;
}

/* The coarsest step whose error is at most the limit, also on the draw that is reported. STATUS_OK with an empty `best`
 * when there is none; then *error is the least that was found. */
static int find_for_error(struct search *s, struct attempt *best, double *error, struct failure *why)
{
    double limit = s->wanted->force_error, target = limit, first = COMPRESSION_STEP * limit / 0.005;
    for (int k = 0; k < MAX_CONFIRMATIONS; k++) {
        struct step_search range;
        int status = find(s, false, target, first, &range, best, why);
        *error = range.least;
        if (status || !range.good)
            return status;
        first = best->step;
        status = patch_error(s, best, COMPRESSION_SEED, error, why);
        if (status || *error <= keep * limit)
            return status;
        attempt_free(best);
        target = 0.98 * fmin(target, range.found) * limit / *error;
    }
    return STATUS_OK;
}

/* Both limits cannot be had: what each would take of the other. */
static int refuse_both(struct search *s, double error_in_bytes, double least_bytes, struct failure *why)
{
    const struct compression *w = s->wanted;
    struct attempt enough = {0};
    double error = 0;
    char remedy[200];
    int status = find_for_error(s, &enough, &error, why);
    if (!status && !enough.factor.block) {
        snprintf(remedy, sizeof remedy, "allow a force error of %.3g %%, or build with --plain", 100 * error);
        return failure_set(why, STATUS_BANK_LIMIT, NULL, remedy,
                           "a force error of %.3g %% cannot be met; the truest compressed bank has %.3g %%",
                           100 * w->force_error, 100 * error);
    }
    if (!status)
        status = row_encode(&enough.factor, s->order, &enough.bytes, &enough.length, why);
    if (!status) {
        double bytes = total_bytes(s, &enough);
        if (error_in_bytes > 0) {
            snprintf(remedy, sizeof remedy, "allow %.0f bytes, or a force error of %.3g %%", bytes,
                     100.5 * error_in_bytes);
            failure_set(why, STATUS_BANK_LIMIT, NULL, remedy,
                        "a force error of %.3g %% takes %.0f bytes, %.0f more than the limit of %.0f; within that the "
                        "least force error is %.3g %%",
                        100 * w->force_error, bytes, bytes - w->bytes, w->bytes, 100 * error_in_bytes);
        } else {
            snprintf(remedy, sizeof remedy, "allow %.0f bytes, or use a coarser mesh", bytes);
            failure_set(why, STATUS_BANK_LIMIT, NULL, remedy,
                        "a force error of %.3g %% takes %.0f bytes, %.0f more than the limit of %.0f; the smallest "
                        "bank of this body has %.0f",
                        100 * w->force_error, bytes, bytes - w->bytes, w->bytes, least_bytes);
        }
        status = STATUS_BANK_LIMIT;
    }
    attempt_free(&enough);
    return status;
}

/* The finest step whose bank has at most so many bytes. */
static int find_for_bytes(struct search *s, struct attempt *best, struct compressed *c, struct failure *why)
{
    const struct compression *w = s->wanted;
    struct step_search range;
    struct attempt standard;
    int status = attempt_make(s, COMPRESSION_STEP, true, &standard, why);
    if (!status)
        status = patch_error(s, &standard, COMPRESSION_SEED, &c->default_error, why);
    if (status)
        return status;
    c->default_bytes = total_bytes(s, &standard);
    attempt_free(&standard);
    double first = COMPRESSION_STEP * pow(c->default_bytes / w->bytes, 2.5); /* the slope of step_search.c */
    status = find(s, true, w->bytes, first, &range, best, why);
    if (status)
        return status;
    if (!range.good && w->force_error > 0)
        return refuse_both(s, 0, range.least, why);
    if (!range.good) {
        char remedy[200];
        snprintf(remedy, sizeof remedy, "allow %.0f bytes, or use a coarser mesh", range.least);
        return failure_set(why, STATUS_BANK_LIMIT, NULL, remedy,
                           "%.0f bytes cannot be met; the smallest bank of this body has %.0f, %.0f more", w->bytes,
                           range.least, range.least - w->bytes);
    }
    double error = 0;
    if (w->force_error > 0)
        status = patch_error(s, best, COMPRESSION_SEED, &error, why);
    return status || error <= keep * w->force_error ? status : refuse_both(s, error, 0, why);
}

/* A step that is given: whether it keeps the limits. */
static int check_given(struct search *s, const struct attempt *a, struct failure *why)
{
    const struct compression *w = s->wanted;
    double bytes = total_bytes(s, a), error = 0;
    char remedy[200];
    int status = w->force_error > 0 ? patch_error(s, a, COMPRESSION_SEED, &error, why) : STATUS_OK;
    if (status)
        return status;
    if (w->bytes > 0 && bytes > w->bytes) {
        snprintf(remedy, sizeof remedy, "allow %.0f bytes, or leave the step out", bytes);
        return failure_set(why, STATUS_BANK_LIMIT, NULL, remedy,
                           "with step %g the bank has %.0f bytes, %.0f more than the limit of %.0f", w->step, bytes,
                           bytes - w->bytes, w->bytes);
    }
    if (error > w->force_error) {
        snprintf(remedy, sizeof remedy, "allow %.3g %%, or leave the step out", 100.5 * error);
        return failure_set(why, STATUS_BANK_LIMIT, NULL, remedy,
                           "with step %g the force error is %.3g %%, the limit is %.3g %%", w->step, 100 * error,
                           100 * w->force_error);
    }
    return STATUS_OK;
}

static int choose(struct search *s, struct attempt *best, struct compressed *c, struct failure *why)
{
    const struct compression *w = s->wanted;
    if (w->step > 0) {
        int status = attempt_make(s, w->step, true, best, why);
        return status ? status : check_given(s, best, why);
    }
    if (w->bytes > 0)
        return find_for_bytes(s, best, c, why);
    if (!(w->force_error > 0))
        return attempt_make(s, COMPRESSION_STEP, true, best, why);
    double error;
    int status = find_for_error(s, best, &error, why);
    if (status || best->factor.block)
        return status;
    char remedy[200];
    snprintf(remedy, sizeof remedy, "allow %.3g %%, or build with --plain", 100.5 * error);
    return failure_set(why, STATUS_BANK_LIMIT, NULL, remedy,
                       "a force error of %.3g %% cannot be met; the best compressed bank of this body has %.3g %%",
                       100 * w->force_error, 100 * error);
}

int compress_compliance(const struct compliance *G, const double *position, const struct contact_surface *surface,
                        const struct compression *wanted, bool quiet, struct compressed *c, struct failure *why)
{
    *c = (struct compressed){0};
    struct search s = {.G = G, .wanted = wanted, .surface = *surface, .order = &c->order};
    struct attempt best = {0};
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
        status = choose(&s, &best, c, why);
    }
    cholesky_free(&s.cholesky);
    if (!status && !best.bytes)
        status = row_encode(&best.factor, &c->order, &best.bytes, &best.length, why);
    progress_end(&s.bar);
    if (!status) {
        c->step = best.step;
        c->bytes = best.bytes;
        c->length = best.length;
        best.bytes = NULL;
    }
    attempt_free(&best);
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
