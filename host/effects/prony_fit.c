#include "prony_fit.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit_nlinear.h>
#include <stdint.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nonnegative.h"
#include "prony_data.h"

enum { PER_DECADE = 8, MOST_COLUMNS = 200, MOST_STEPS = 200, MOST_PARAMETERS = 2 * PRONY_MAX + 2 };

/* A relaxation function with its modulus, in the unit of the data. */
struct spectrum {
    double equilibrium, viscosity; /* viscosity: unit of the data times s */
    size_t count;
    double modulus[MOST_COLUMNS], time_s[MOST_COLUMNS];
};

static size_t values(const struct prony_fit *fit)
{
    return fit->oscillating ? 2 * fit->points : fit->points;
}

/* Value i: all of G' (or G), then all of G''. */
static double measured(const struct prony_fit *fit, size_t i)
{
    return fit->measured[i / fit->points][i % fit->points];
}

/* One over what a residual is relative to: the value itself, but at least 1 % of |G*|, below which no rheometer tells. */
static double weight(const struct prony_fit *fit, size_t i)
{
    double own = measured(fit, i), all = own;
    if (fit->oscillating)
        all = hypot(fit->measured[0][i % fit->points], fit->measured[1][i % fit->points]);
    return 1 / fmax(own, 0.01 * all);
}

/* What a branch of unit modulus adds to value i, and its derivative by the logarithm of the time. */
static double branch(const struct prony_fit *fit, size_t i, double time_s, double *slope)
{
    double x = fit->x[i % fit->points];
    if (!fit->oscillating) {
        double value = exp(-x / time_s);
        *slope = value * x / time_s;
        return value;
    }
    double w = x * time_s, below = 1 + w * w;
    if (i < fit->points) {
        *slope = 2 * w * w / (below * below);
        return w * w / below;
    }
    *slope = w * (1 - w * w) / (below * below);
    return w / below;
}

static double at_rest(const struct prony_fit *fit, size_t i)
{
    return i < fit->points ? 1 : 0;
}

static double dashpot(const struct prony_fit *fit, size_t i)
{
    return fit->oscillating && i >= fit->points ? fit->x[i - fit->points] : 0;
}

static double value_of(const struct prony_fit *fit, const struct spectrum *s, size_t i)
{
    double sum = s->equilibrium * at_rest(fit, i) + s->viscosity * dashpot(fit, i), unused;
    for (size_t b = 0; b < s->count; b++)
        sum += s->modulus[b] * branch(fit, i, s->time_s[b], &unused);
    return sum;
}

/* Least squares over a grid of times; what is left are those with a modulus, neighbours on the grid joined. */
static int first_spectrum(const struct prony_fit *fit, struct spectrum *s)
{
    size_t rows = values(fit), n = fit->points;
    double fastest = fit->oscillating ? 0.3 / fit->x[n - 1] : 0.3 * fit->x[0];
    double slowest = fit->oscillating ? 3 / fit->x[0] : 3 * fit->x[n - 1];
    size_t times = (size_t)ceil(PER_DECADE * log10(slowest / fastest)) + 1;
    if (times > MOST_COLUMNS)
        times = MOST_COLUMNS;
    size_t columns = times + 2;
    double *A = calloc(rows * columns, sizeof *A), *b = calloc(rows, sizeof *b), *x = calloc(columns, sizeof *x),
           unused;
    bool good = A && b && x;
    for (size_t i = 0; i < rows && good; i++) {
        double w = weight(fit, i);
        b[i] = w * measured(fit, i);
        A[i * columns] = w * at_rest(fit, i);
        A[i * columns + 1] = w * dashpot(fit, i);
        for (size_t k = 0; k < times; k++)
            A[i * columns + 2 + k] =
                w * branch(fit, i, fastest * pow(slowest / fastest, (double)k / (double)(times - 1)), &unused);
    }
    good = good && nonnegative_solve(rows, columns, A, b, x) == 0;
    *s = (struct spectrum){.equilibrium = good ? x[0] : 0, .viscosity = good ? x[1] : 0};
    for (size_t k = 0; k < times && good; k++) {
        double time_s = fastest * pow(slowest / fastest, (double)k / (double)(times - 1)), m = x[2 + k];
        if (!(m > 0))
            continue;
        bool join = k > 0 && x[1 + k] > 0 && s->count > 0;
        if (join) {
            double *own = &s->modulus[s->count - 1], *at = &s->time_s[s->count - 1];
            *at = exp((*own * log(*at) + m * log(time_s)) / (*own + m));
            *own += m;
        } else {
            s->modulus[s->count] = m;
            s->time_s[s->count++] = time_s;
        }
    }
    free(A);
    free(b);
    free(x);
    return good ? 0 : -1;
}

/* One branch less: the two nearest in time become one, the last one goes. */
static void join_nearest(struct spectrum *s)
{
    size_t at = 0;
    if (s->count == 1) {
        s->count = 0;
        return;
    }
    for (size_t b = 0; b + 1 < s->count; b++)
        if (s->time_s[b + 1] / s->time_s[b] < s->time_s[at + 1] / s->time_s[at])
            at = b;
    double sum = s->modulus[at] + s->modulus[at + 1];
    s->time_s[at] = exp((s->modulus[at] * log(s->time_s[at]) + s->modulus[at + 1] * log(s->time_s[at + 1])) / sum);
    s->modulus[at] = sum;
    for (size_t b = at + 1; b + 1 < s->count; b++) {
        s->modulus[b] = s->modulus[b + 1];
        s->time_s[b] = s->time_s[b + 1];
    }
    s->count--;
}

/* ---- refinement: parameters are the logarithms of equilibrium, moduli, times, and the viscosity if there is one ---- */

struct problem {
    const struct prony_fit *fit;
    size_t branches;
    bool viscous;
};

static size_t parameters(const struct problem *p)
{
    return 1 + 2 * p->branches + p->viscous;
}

static void unpack(const struct problem *p, const gsl_vector *x, struct spectrum *s)
{
    s->equilibrium = exp(gsl_vector_get(x, 0));
    s->count = p->branches;
    for (size_t b = 0; b < p->branches; b++) {
        s->modulus[b] = exp(gsl_vector_get(x, 1 + 2 * b));
        s->time_s[b] = exp(gsl_vector_get(x, 2 + 2 * b));
    }
    s->viscosity = p->viscous ? exp(gsl_vector_get(x, 1 + 2 * p->branches)) : 0;
}

static int residuals(const gsl_vector *x, void *data, gsl_vector *f)
{
    const struct problem *p = data;
    struct spectrum s;
    unpack(p, x, &s);
    for (size_t i = 0; i < values(p->fit); i++)
        gsl_vector_set(f, i, weight(p->fit, i) * (value_of(p->fit, &s, i) - measured(p->fit, i)));
    return GSL_SUCCESS;
}

static int derivatives(const gsl_vector *x, void *data, gsl_matrix *J)
{
    const struct problem *p = data;
    struct spectrum s;
    unpack(p, x, &s);
    for (size_t i = 0; i < values(p->fit); i++) {
        double w = weight(p->fit, i), slope;
        gsl_matrix_set(J, i, 0, w * s.equilibrium * at_rest(p->fit, i));
        for (size_t b = 0; b < p->branches; b++) {
            double value = branch(p->fit, i, s.time_s[b], &slope);
            gsl_matrix_set(J, i, 1 + 2 * b, w * s.modulus[b] * value);
            gsl_matrix_set(J, i, 2 + 2 * b, w * s.modulus[b] * slope);
        }
        if (p->viscous)
            gsl_matrix_set(J, i, 1 + 2 * p->branches, w * s.viscosity * dashpot(p->fit, i));
    }
    return GSL_SUCCESS;
}

static double square_sum(const struct prony_fit *fit, const struct spectrum *s)
{
    double sum = 0;
    for (size_t i = 0; i < values(fit); i++) {
        double r = weight(fit, i) * (value_of(fit, s, i) - measured(fit, i));
        sum += r * r;
    }
    return sum;
}

/* False when the parameters leave what is representable; then `s` is as it was. */
static bool refine(const struct problem *p, struct spectrum *s)
{
    size_t n = values(p->fit), k = parameters(p);
    gsl_multifit_nlinear_parameters options = gsl_multifit_nlinear_default_parameters();
    gsl_multifit_nlinear_workspace *w = gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &options, n, k);
    gsl_multifit_nlinear_fdf system = {
        .f = residuals, .df = derivatives, .n = n, .p = k, .params = (void *)(uintptr_t)p};
    gsl_vector *x = gsl_vector_alloc(k);
    struct spectrum better = *s;
    bool good = w && x;
    if (good) {
        int info;
        gsl_vector_set(x, 0, log(s->equilibrium));
        for (size_t b = 0; b < p->branches; b++) {
            gsl_vector_set(x, 1 + 2 * b, log(s->modulus[b]));
            gsl_vector_set(x, 2 + 2 * b, log(s->time_s[b]));
        }
        if (p->viscous)
            gsl_vector_set(x, k - 1, log(s->viscosity));
        good = gsl_multifit_nlinear_init(x, &system, w) == GSL_SUCCESS;
        if (good)
            gsl_multifit_nlinear_driver(MOST_STEPS, 1e-10, 1e-10, 0, NULL, NULL, &info, w);
        unpack(p, gsl_multifit_nlinear_position(w), &better);
        double sum = better.equilibrium + better.viscosity;
        for (size_t b = 0; b < p->branches; b++)
            sum += better.modulus[b] + better.time_s[b] + 1 / better.time_s[b];
        good = good && isfinite(sum) && square_sum(p->fit, &better) <= square_sum(p->fit, s);
    }
    if (good)
        *s = better;
    gsl_multifit_nlinear_free(w);
    gsl_vector_free(x);
    return good;
}

/* Akaike's criterion, corrected for few values (Burnham and Anderson 2002, 2.4). */
static double criterion(double square, size_t n, size_t k)
{
    double N = (double)n, K = (double)k + 1;
    return n > k + 2 ? N * log(square / N + 1e-20) + 2 * K + 2 * K * (K + 1) / (N - K - 1) : INFINITY;
}

static int choose(struct prony_fit *fit, const char *path, struct spectrum *best, struct failure *why)
{
    struct spectrum start;
    if (first_spectrum(fit, &start))
        return failure_set(why, STATUS_FIT, path, NULL, "the least squares on the data did not end");
    double largest = 0, best_score = INFINITY;
    for (size_t i = 0; i < fit->points; i++)
        largest = fmax(largest, fit->measured[0][i]);
    if (!(start.equilibrium > 0.01 * largest))
        return failure_set(why, STATUS_FIT, path, "measure slower, or longer, until the modulus settles",
                           "the data show no equilibrium: their modulus at rest is below 1 %% of the largest");
    if (start.count == 0 && !(start.viscosity > 0))
        return failure_set(why, STATUS_FIT, path, "leave the effect out",
                           "the data show no relaxation: the modulus is the same at all times");
    while (start.count > PRONY_MAX)
        join_nearest(&start);
    for (;; join_nearest(&start)) { /* from many branches to few: a smaller one must be as good to within 2 */
        struct spectrum s = start;
        double noticeable = s.viscosity * (fit->oscillating ? fit->x[fit->points - 1] : 0);
        struct problem p = {fit, s.count, noticeable > 1e-3 * largest};
        s.viscosity = p.viscous ? s.viscosity : 0;
        if (parameters(&p) + 2 <= values(fit)) {
            refine(&p, &s);
            double score = criterion(square_sum(fit, &s), values(fit), parameters(&p));
            if (score <= best_score + 2) {
                best_score = fmin(score, best_score);
                *best = s;
            }
        }
        if (start.count == 0 || (start.count == 1 && !p.viscous))
            break;
    }
    return isfinite(best_score) ? STATUS_OK
                                : failure_set(why, STATUS_FIT, path, "measure at more points",
                                              "%zu rows are too few for the branches that they need", fit->points);
}

static int judge(struct prony_fit *fit, const char *path, const struct spectrum *s, struct failure *why)
{
    double sum = 0;
    for (size_t i = 0; i < fit->points; i++) {
        double square = 0, size = 0;
        for (int part = 0; part < 1 + fit->oscillating; part++) {
            double r = value_of(fit, s, i + (part ? fit->points : 0)) - fit->measured[part][i];
            square += r * r;
            size += fit->measured[part][i] * fit->measured[part][i];
        }
        sum += square / size;
        fit->residual_max = fmax(fit->residual_max, sqrt(square / size));
    }
    fit->residual_rms = sqrt(sum / (double)fit->points);
    fit->equilibrium = s->equilibrium;
    fit->series = (struct prony){.count = s->count, .viscosity_s = s->viscosity / s->equilibrium};
    for (size_t b = 0; b < s->count; b++) {
        fit->series.share[b] = s->modulus[b] / s->equilibrium;
        fit->series.time_s[b] = s->time_s[b];
    }
    prony_sort(&fit->series);
    if (fit->residual_max > 0.25)
        return failure_set(why, STATUS_FIT, path, "look at the data: no relaxation of a solid has such moduli",
                           "the best fit misses a value by %.0f %%", 100 * fit->residual_max);
    return STATUS_OK;
}

int prony_fit_file(const char *path, struct prony_fit *fit, struct failure *why)
{
    struct spectrum s = {0};
    int status = prony_data_read(path, fit, why);
    if (status)
        return status;
    gsl_error_handler_t *handler = gsl_set_error_handler_off(); /* its default ends the process */
    status = choose(fit, path, &s, why);
    gsl_set_error_handler(handler);
    return status ? status : judge(fit, path, &s, why);
}

double prony_fit_value(const struct prony_fit *fit, int part, double x)
{
    double relative = !fit->oscillating ? prony_relaxation(&fit->series, x)
                      : part            ? prony_loss(&fit->series, x)
                                        : prony_storage(&fit->series, x);
    return fit->equilibrium * relative;
}
