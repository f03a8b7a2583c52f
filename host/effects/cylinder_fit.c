#include "cylinder_fit.h"

#include <gsl/gsl_multifit.h>
#include <gsl/gsl_poly.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"

static const double GOOD_ENOUGH = 0.005; /* residual, of the largest value: that of a fair load cell */
static const double REAL = 1e-9;         /* imaginary part of a root below which it counts as real */

static double polynomial(const struct monotone *c, double s)
{
    return gsl_poly_eval(c->coefficient, c->degree + 1, s);
}

static double derivative(const struct monotone *c, double s)
{
    double value[2];
    gsl_poly_eval_derivs(c->coefficient, (size_t)c->degree + 1, s, value, 2);
    return value[1];
}

double monotone_value(const struct monotone *c, double x)
{
    double s = fabs(x) / c->range;
    double y = s <= 1 ? polynomial(c, s) : polynomial(c, 1) + derivative(c, 1) * (s - 1);
    return x < 0 ? -y : y;
}

double monotone_slope(const struct monotone *c, double x)
{
    return derivative(c, fmin(1, fabs(x) / c->range)) / c->range;
}

/* Every root of the derivative is looked at. */
double monotone_turn(const struct monotone *c)
{
    double slope[CYLINDER_FIT_DEGREE_MAX] = {0}, root[2 * CYLINDER_FIT_DEGREE_MAX], first = -1;
    int n = c->degree - 1;
    for (int k = 0; k <= n; k++)
        slope[k] = (k + 1) * c->coefficient[k + 1];
    if (!(slope[0] > 0))
        return 0;
    while (n > 0 && fabs(slope[n]) < 1e-14 * slope[0])
        n--;
    if (n == 0)
        return -1;
    gsl_poly_complex_workspace *work = gsl_poly_complex_workspace_alloc((size_t)n + 1);
    if (!work || gsl_poly_complex_solve(slope, (size_t)n + 1, work, root))
        n = 0;
    for (int k = 0; k < n; k++)
        if (fabs(root[2 * k + 1]) < REAL && root[2 * k] >= 0 && root[2 * k] <= 1 && (first < 0 || root[2 * k] < first))
            first = root[2 * k];
    gsl_poly_complex_workspace_free(work);
    return first < 0 ? first : first * c->range;
}

static bool least_squares(size_t count, const double *x, const double *y, struct monotone *c)
{
    size_t terms = (size_t)c->degree;
    gsl_matrix *X = gsl_matrix_alloc(count, terms), *covariance = gsl_matrix_alloc(terms, terms);
    gsl_vector *b = gsl_vector_alloc(terms);
    gsl_multifit_linear_workspace *work = gsl_multifit_linear_alloc(count, terms);
    bool good = X && covariance && b && work;
    for (size_t i = 0; i < count && good; i++)
        for (size_t k = 0; k < terms; k++)
            gsl_matrix_set(X, i, k, pow(x[i] / c->range, (double)k + 1));
    double sum;
    gsl_vector_const_view view = gsl_vector_const_view_array(y, count);
    good = good && !gsl_multifit_linear(X, &view.vector, b, covariance, &sum, work);
    for (size_t k = 0; k < terms && good; k++)
        c->coefficient[k + 1] = gsl_vector_get(b, k);
    if (X)
        gsl_matrix_free(X);
    if (covariance)
        gsl_matrix_free(covariance);
    if (b)
        gsl_vector_free(b);
    if (work)
        gsl_multifit_linear_free(work);
    return good;
}

int monotone_fit(size_t count, const double *x, const double *y, int degree, const char *place, struct monotone *c,
                 struct failure *why)
{
    *c = (struct monotone){.degree = degree};
    if (degree < 1 || degree > CYLINDER_FIT_DEGREE_MAX || count < (size_t)degree + 2)
        return failure_set(why, STATUS_FIT, place, "measure at more depths, or lower the degree",
                           "%zu points are too few for a polynomial of degree %d", count, degree);
    c->range = x[count - 1];
    if (!least_squares(count, x, y, c))
        return failure_set(why, STATUS_MEMORY, place, NULL, "no memory to fit %zu points", count);
    double top = 0;
    for (size_t i = 0; i < count; i++) {
        double off = fabs(polynomial(c, x[i] / c->range) - y[i]);
        c->residual_rms += off * off / (double)count;
        c->residual_max = fmax(c->residual_max, off);
        top = fmax(top, fabs(y[i]));
    }
    c->residual_rms = sqrt(c->residual_rms) / top;
    c->residual_max /= top;
    double turn = monotone_turn(c);
    if (turn >= 0)
        return failure_set(why, STATUS_FIT, place, "leave out what is behind it, or lower the degree",
                           "the curve of degree %d is not monotone: it turns at %.4g of %.4g", degree, turn, c->range);
    return STATUS_OK;
}

/* The lowest degree that is good enough, else the one with the smallest residual; monotone ones only. */
static int best_fit(size_t count, const double *x, const double *y, int degree_min, const char *place,
                    struct monotone *best, struct failure *why)
{
    int status = STATUS_FIT;
    for (int degree = degree_min; degree <= CYLINDER_FIT_DEGREE_MAX && count >= (size_t)degree + 2; degree++) {
        struct monotone c;
        struct failure failed;
        int now = monotone_fit(count, x, y, degree, place, &c, &failed);
        if (now == STATUS_OK && (status || c.residual_max < best->residual_max)) {
            *best = c;
            status = STATUS_OK;
        } else if (status && degree == degree_min)
            *why = failed;
        if (status == STATUS_OK && best->residual_max < GOOD_ENOUGH)
            break;
    }
    if (status && count < (size_t)degree_min + 2)
        return monotone_fit(count, x, y, degree_min, place, best, why);
    return status;
}

static int unit_of(const struct csv *t, size_t column, const char *whole, const char *thousandth, double *times,
                   struct failure *why)
{
    *times = !strcmp(t->unit[column], whole) ? 1 : !strcmp(t->unit[column], thousandth) ? 1e-3 : 0;
    if (*times > 0)
        return STATUS_OK;
    return failure_set(why, STATUS_TABLE_SYNTAX, t->path, NULL, "column '%s' must be in [%s] or [%s]", t->name[column],
                       whole, thousandth);
}

static int check_rows(const struct csv *t, size_t depth, size_t used, const size_t *column, struct failure *why)
{
    for (size_t r = 0; r < t->rows; r++) {
        for (size_t c = 0; c < used; c++)
            if (isnan(t->value[r * t->columns + column[c]]))
                return failure_at(why, STATUS_FIT, t->path, t->line[r], "complete or remove the line", "%s is missing",
                                  t->name[column[c]]);
        double x = t->value[r * t->columns + depth];
        if (!(x >= 0) || (r > 0 && !(x > t->value[(r - 1) * t->columns + depth])))
            return failure_at(why, STATUS_FIT, t->path, t->line[r], "sort the rows by depth, each once, from 0 on",
                              "the depth %g does not rise", x);
    }
    return STATUS_OK;
}

double cylinder_linear(const struct sample *s, double depth_m, int across)
{
    return across ? s->nu * s->radius_m * depth_m / s->height_m
                  : acos(-1) * s->radius_m * s->radius_m * s->E_Pa * depth_m / s->height_m;
}

void cylinder_table_free(struct cylinder_table *t)
{
    free(t->depth_m);
    free(t->force_N);
    free(t->across_m);
    *t = (struct cylinder_table){0};
}

/* In metres and newtons. */
static int copy(const struct csv *t, const size_t column[3], size_t used, struct cylinder_table *table,
                struct failure *why)
{
    static const char *const unit[3][2] = {{"m", "mm"}, {"N", "mN"}, {"m", "mm"}};
    double **to[3] = {&table->depth_m, &table->force_N, &table->across_m};
    table->rows = t->rows;
    for (size_t k = 0; k < used; k++) {
        double times, *values = *to[k] = malloc((t->rows + 1) * sizeof *values);
        int status = unit_of(t, column[k], unit[k][0], unit[k][1], &times, why);
        if (!values)
            return failure_set(why, STATUS_MEMORY, t->path, NULL, "no memory for %zu rows", t->rows);
        if (status)
            return status;
        for (size_t r = 0; r < t->rows; r++)
            values[r] = times * t->value[r * t->columns + column[k]];
    }
    return STATUS_OK;
}

int cylinder_table_read(const char *path, struct cylinder_table *table, struct failure *why)
{
    struct csv t;
    size_t column[3] = {0};
    struct failure none;
    *table = (struct cylinder_table){0};
    int status = csv_read(path, &t, why);
    if (!status)
        status = csv_column(&t, "depth", &column[0], why);
    if (!status)
        status = csv_column(&t, "force", &column[1], why);
    size_t used = !status && csv_column(&t, "across", &column[2], &none) == STATUS_OK ? 3 : 2;
    if (!status)
        status = copy(&t, column, used, table, why);
    if (!status)
        status = check_rows(&t, column[0], used, column, why);
    csv_free(&t);
    if (status)
        cylinder_table_free(table);
    return status;
}

int cylinder_fit_file(const char *path, const struct sample *s, int degree_min, struct cylinder_fit *fit,
                      struct failure *why)
{
    struct cylinder_table t;
    *fit = (struct cylinder_fit){0};
    int status = cylinder_table_read(path, &t, why);
    if (status)
        return status;
    double *x = malloc((t.rows + 1) * sizeof *x);
    if (!x)
        status = failure_set(why, STATUS_MEMORY, path, NULL, "no memory for %zu rows", t.rows);
    fit->has_across = t.across_m;
    fit->depth_max_m = t.rows > 0 ? t.depth_m[t.rows - 1] : 0;
    for (int k = 0; k < 1 + fit->has_across && !status; k++) {
        for (size_t r = 0; r < t.rows; r++)
            x[r] = cylinder_linear(s, t.depth_m[r], k);
        status = best_fit(t.rows, x, k ? t.across_m : t.force_N, degree_min, path, k ? &fit->P : &fit->Q, why);
    }
    free(x);
    cylinder_table_free(&t);
    return status;
}
