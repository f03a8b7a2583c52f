#include "rounding.h"

#include <lapacke.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "progress.h"
#include "row_code.h"

/* Block (i, j) of G, rows in the factor's order. */
static void block_of(const struct compliance *c, uint32_t i, uint32_t j, double block[9])
{
    size_t ld = 3 * c->rows;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            size_t row = 3 * (size_t)i + a, column = 3 * (size_t)j + b;
            block[3 * a + b] = row >= column ? c->G[ld * column + row] : c->G[ld * row + column];
        }
}

static int rising(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Smallest step for which every entry fits 16 bits and every sum of squares 31, with a tenth to spare for feedback. */
static double smallest_step(const struct cholesky *c)
{
    double entry = 0, squares = 0;
    size_t ld = 3 * c->rows;
    for (size_t i = 0; i < ld; i++) {
        double sum = 0;
        for (size_t j = 0; j <= i; j++) {
            double l = c->L[ld * j + i];
            entry = fmax(entry, fabs(l));
            sum += l * l;
        }
        squares = fmax(squares, sum);
    }
    return 1.1 * fmax(entry / INT16_MAX, sqrt(squares / 0x1p31));
}

int cholesky_build(const struct compliance *compliance, const struct order *order, struct cholesky *c,
                   struct failure *why)
{
    size_t n = compliance->rows, ld = 3 * n, pivots = 0;
    *c = (struct cholesky){.rows = n, .L = malloc(ld * ld * sizeof(double))};
    double *pivot = malloc((ld + 1) * sizeof *pivot);
    bool *fixed = calloc(ld + 1, sizeof *fixed);
    int status = STATUS_OK;
    if (!c->L || !pivot || !fixed) {
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the factor of the compliance (%.0f MB)",
                             8e-6 * (double)ld * (double)ld);
        goto done;
    }
    for (size_t j = 0; j < n; j++)
        for (size_t i = j; i < n; i++) {
            double g[9];
            block_of(compliance, order->at[i], order->at[j], g);
            for (int k = 0; k < 9; k++)
                c->L[ld * (3 * j + k % 3) + 3 * i + k / 3] = g[k];
        }
    for (size_t k = 0; k < ld; k++)
        if (c->L[(ld + 1) * k] == 0) {
            fixed[k] = true;
            c->L[(ld + 1) * k] = 1;
        }
    int at = LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', (int)ld, c->L, (int)ld);
    if (at) {
        status = failure_set(why, STATUS_MODEL_FACTOR, NULL, NULL,
                             "the compliance is not positive definite at row %d of %zu", at / 3, n);
        goto done;
    }
    for (size_t k = 0; k < ld; k++)
        if (fixed[k])
            c->L[(ld + 1) * k] = 0;
        else
            pivot[pivots++] = c->L[(ld + 1) * k];
    qsort(pivot, pivots, sizeof *pivot, rising);
    c->median_diagonal = pivots ? pivot[pivots / 2] : 0;
    c->smallest_step = smallest_step(c);
done:
    free(pivot);
    free(fixed);
    if (status)
        cholesky_free(c);
    return status;
}

void cholesky_free(struct cholesky *c)
{
    free(c->L);
    *c = (struct cholesky){0};
}

/* Mean of the diagonal of L over the columns of a level. */
static double level_diagonal(const struct order *o, const struct cholesky *c, uint32_t level)
{
    size_t end = level + 1 < o->levels ? o->level_first[level + 1] : o->rows, first = o->level_first[level];
    double sum = 0;
    for (size_t k = 3 * first; k < 3 * end; k++)
        sum += c->L[(3 * c->rows + 1) * k];
    return sum / (double)(3 * (end - first));
}

static uint16_t unit_of(double x) /* 1/8 each, so that row_multiple is `fineness` times the product */
{
    return (uint16_t)fmin(2048, fmax(1, floor(x + 0.5)));
}

void rounding_choose(const struct order *o, const struct cholesky *c, double relative, struct rounding *r)
{
    const double near = 2, most = 8, power = 1.5; /* near: in mean spacings of the finer half */
    /* the step of the integers is finer than the rounding near by, so that multiples come in fractions */
    double wanted = relative * c->median_diagonal, step = fmax(wanted / 4, c->smallest_step), fineness = wanted / step;
    double spacing = 0;
    for (size_t k = o->rows / 2; k < o->rows; k++)
        spacing += sqrt(o->spacing2[k]) / (double)(o->rows - o->rows / 2);
    *r = (struct rounding){.step = step, .classes = 14, .feedback_classes = 8};
    for (uint32_t l = 0; l < o->levels; l++) {
        double diagonal = level_diagonal(o, c, l);
        r->level_unit[l] = unit_of(8 * fineness * (diagonal > 0 ? pow(c->median_diagonal / diagonal, power) : 1));
    }
    for (uint32_t log = 0; log < 64; log++) {
        double distance =
            sqrt(1.2 * (double)row_far(log)) / spacing; /* 1.2: the middle of the interval of the square */
        r->distance_unit[log] = unit_of(8 * fmin(most, fmax(1, distance / near)));
    }
    r->diagonal_unit = 8;
}

enum { FEEDBACK_MAX = 100 }; /* multiples by which feedback may move an entry */

struct work {
    const struct compliance *compliance;
    const struct order *order;
    const struct cholesky *cholesky;
    struct factor *factor;
    int32_t *row; /* of the row at hand: 9 per column, dense */
    size_t room;  /* blocks that factor->block holds */
};

/* sum over the columns before j of Q_ik Q_jk^t; row i is the dense one. */
static void product(const struct work *w, size_t j, double sum[9])
{
    const struct factor *f = w->factor;
    int64_t total[9] = {0};
    for (size_t p = f->start[j]; p + 1 < f->start[j + 1]; p++) { /* the last block of a row is its diagonal */
        const int16_t *q = f->block[p].value;
        const int32_t *r = w->row + 9 * (size_t)f->block[p].column;
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                total[3 * a + b] += (int64_t)r[3 * a] * q[3 * b] + (int64_t)r[3 * a + 1] * q[3 * b + 1] +
                                    (int64_t)r[3 * a + 2] * q[3 * b + 2];
    }
    for (int k = 0; k < 9; k++)
        sum[k] = (double)total[k];
}

/* To the nearest multiple, but what is below 0.6 of one becomes zero: feedback makes good for it, and a zero costs less. */
static int32_t nearest(double x, uint32_t multiple)
{
    double whole = x / multiple;
    if (fabs(whole) < 0.6)
        return 0;
    return (int32_t)lround(fmax(-1e5, fmin(1e5, whole))) * (int32_t)multiple;
}

/* The block by rounding L itself. */
static void plain(const struct work *w, size_t i, size_t j, uint32_t multiple, int32_t out[9])
{
    size_t ld = 3 * w->cholesky->rows;
    for (int k = 0; k < 9; k++)
        out[k] = nearest(w->cholesky->L[ld * (3 * j + k % 3) + 3 * i + k / 3] / w->factor->rounding.step, multiple);
}

/* Whether component b of Q_jj is there only because feedback divides by it: nothing is left of it when the earlier ones are known, as
 * where a node slides on an oblique plane. */
static bool all_rounding(const struct work *w, size_t j, int b, const int16_t diagonal[9])
{
    const struct cholesky *c = w->cholesky;
    return c->L[(3 * c->rows + 1) * (3 * j + (size_t)b)] < 0.5 * w->factor->rounding.step * diagonal[4 * b];
}

/* The block for which the product meets G_ij: X Q_jj^t = G_ij / step^2 - sum, a column at a time. What it makes good is the
 * rounding of earlier columns, a few multiples; where it asks for more, at steps so coarse that Q_jj is mostly rounding,
 * making good would grow from row to row, and L's own block is taken. */
static void with_feedback(const struct work *w, size_t i, size_t j, uint32_t multiple, int32_t out[9])
{
    const struct factor *f = w->factor;
    const int16_t *d = f->block[f->start[j + 1] - 1].value;
    double g[9], sum[9], step2 = f->rounding.step * f->rounding.step;
    block_of(w->compliance, w->order->at[i], w->order->at[j], g);
    product(w, j, sum);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            double rest = g[3 * a + b] / step2 - sum[3 * a + b];
            for (int k = 0; k < b; k++)
                rest -= (double)out[3 * a + k] * d[3 * b + k];
            out[3 * a + b] = d[4 * b] ? nearest(rest / d[4 * b], multiple) : 0;
        }
    int32_t own[9];
    bool far = false;
    plain(w, i, j, multiple, own);
    for (int k = 0; k < 9; k++)
        if (all_rounding(w, j, k % 3, d))
            out[k] = own[k];
    for (int k = 0; k < 9; k++)
        far = far || abs(out[k] - own[k]) > FEEDBACK_MAX * (int32_t)multiple;
    if (far)
        memcpy(out, own, sizeof own);
}

/* The diagonal block: what of G_ii the row has not spent yet. Where rounding has spent nearly all, L's own. */
static void diagonal(const struct work *w, size_t i, uint32_t multiple, int32_t out[9])
{
    const struct factor *f = w->factor;
    double rest[9], step = f->rounding.step, l[9] = {0};
    size_t ld = 3 * w->cholesky->rows;
    block_of(w->compliance, w->order->at[i], w->order->at[i], rest);
    for (int k = 0; k < 9; k++)
        rest[k] /= step * step;
    for (size_t j = 0; j < i; j++) {
        const int32_t *r = w->row + 9 * j;
        for (int a = 0; a < 3; a++)
            for (int b = 0; b <= a; b++)
                for (int c = 0; c < 3; c++)
                    rest[3 * a + b] -= (double)r[3 * a + c] * (double)r[3 * b + c];
    }
    bool good = true;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b <= a; b++) {
            double own = w->cholesky->L[ld * (3 * i + b) + 3 * i + a] / step;
            double s = rest[3 * a + b];
            for (int k = 0; k < b; k++)
                s -= l[3 * a + k] * l[3 * b + k];
            if (a == b) {
                good = good && (own == 0 || s > 0.04 * own * own);
                l[4 * a] = own == 0 ? 0 : sqrt(fmax(s, 0));
            } else
                l[3 * a + b] = l[4 * b] > 0 ? s / l[4 * b] : 0;
        }
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            double own = w->cholesky->L[ld * (3 * i + b) + 3 * i + a] / step;
            out[3 * a + b] = b > a ? 0 : nearest(good ? l[3 * a + b] : own, multiple);
            if (a == b && own > 0 && out[4 * a] == 0)
                out[4 * a] = (int32_t)multiple; /* feedback divides by it */
        }
}

static int append(struct work *w, size_t column, const int32_t value[9], struct failure *why)
{
    struct factor *f = w->factor;
    size_t count = f->start[f->rows];
    if (count == w->room) {
        size_t room = 2 * w->room + 1024;
        struct row_block *larger = realloc(f->block, room * sizeof *larger);
        if (!larger)
            return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the rounded factor");
        f->block = larger;
        w->room = room;
    }
    f->block[count].column = (uint16_t)column;
    for (int k = 0; k < 9; k++)
        f->block[count].value[k] = (int16_t)value[k];
    f->start[f->rows] = count + 1;
    return STATUS_OK;
}

static int too_fine(const struct factor *f, struct failure *why)
{
    return failure_set(why, STATUS_CHECK_FAILED, NULL, "take a larger step",
                       "with a step of %.3g (m/N)^1/2 the integers of the factor exceed 16 bits", f->rounding.step);
}

/* One row; factor->rows counts the finished ones and start[rows] the blocks written. */
static int round_row(struct work *w, size_t i, struct failure *why)
{
    struct factor *f = w->factor;
    const struct rounding *r = &f->rounding;
    double squares[3] = {0};
    uint32_t level = 0;
    memset(w->row, 0, 9 * (i + 1) * sizeof *w->row);
    size_t first = f->start[i];
    f->start[i + 1] = first;
    f->rows = i + 1;
    for (size_t j = 0; j <= i; j++) {
        if (level + 1 < w->order->levels && w->order->level_first[level + 1] == j)
            level++;
        uint32_t log = order_log(w->order, i, j), log0 = w->order->level_log[level];
        uint32_t class = log > log0 ? log - log0 : 0, unit = r->level_unit[level];
        if (j < i && class >= r->classes)
            continue;
        int32_t *out = w->row + 9 * j, any = j == i;
        if (j == i)
            diagonal(w, i, row_multiple(unit, r->diagonal_unit), out);
        else if (class < r->feedback_classes)
            with_feedback(w, i, j, row_multiple(unit, r->distance_unit[log]), out);
        else
            plain(w, i, j, row_multiple(unit, r->distance_unit[log]), out);
        for (int k = 0; k < 9; k++) {
            any |= out[k];
            squares[k / 3] += (double)out[k] * out[k];
            if (abs(out[k]) > INT16_MAX || squares[k / 3] >= 0x1p31)
                return too_fine(f, why);
        }
        int status = any ? append(w, j, out, why) : STATUS_OK;
        if (status)
            return status;
    }
    uint32_t blocks = (uint32_t)(f->start[i + 1] - first);
    if (blocks > f->max_blocks)
        f->max_blocks = blocks;
    return STATUS_OK;
}

int rounding_run(const struct compliance *compliance, const struct order *order, const struct cholesky *cholesky,
                 const struct rounding *rounding, struct factor *f, struct failure *why)
{
    size_t n = order->rows;
    *f = (struct factor){.rounding = *rounding, .start = calloc(n + 1, sizeof *f->start)};
    struct work w = {.compliance = compliance,
                     .order = order,
                     .cholesky = cholesky,
                     .factor = f,
                     .row = malloc(9 * n * sizeof *w.row)};
    int status = STATUS_OK;
    if (!f->start || !w.row)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the rounded factor");
    for (size_t i = 0; i < n && !status; i++)
        status = interrupted() ? failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while rounding")
                               : round_row(&w, i, why);
    free(w.row);
    if (status)
        factor_free(f);
    return status;
}

void factor_free(struct factor *f)
{
    free(f->start);
    free(f->block);
    *f = (struct factor){0};
}
