#include "prony_data.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FEWEST_ROWS = 5 };

static const struct {
    const char *name;
    double times;
} moduli[] = {{"Pa", 1}, {"kPa", 1e3}, {"MPa", 1e6}, {"GPa", 1e9}}, forces[] = {{"N", 1}, {"mN", 1e-3}};

/* The first of these names (a NULL ends them) that is a column; -1 when none is. */
static int find(const struct csv *t, const char *const *names)
{
    for (; *names; names++)
        for (size_t c = 0; c < t->columns; c++)
            if (strcmp(t->name[c], *names) == 0)
                return (int)c;
    return -1;
}

/* What numbers of a column are multiplied with: moduli in Pa, forces in N. */
static int modulus_unit(const struct csv *t, int column, bool force, double *times, struct failure *why)
{
    for (size_t k = 0; k < (force ? sizeof forces / sizeof *forces : sizeof moduli / sizeof *moduli); k++)
        if (strcmp(t->unit[column], force ? forces[k].name : moduli[k].name) == 0) {
            *times = force ? forces[k].times : moduli[k].times;
            return STATUS_OK;
        }
    return failure_set(why, STATUS_TABLE_SYNTAX, t->path, force ? "write [N] or [mN]" : "write [Pa], [kPa] or [MPa]",
                       "column '%s' has %s%s%s", t->name[column], *t->unit[column] ? "the unit '" : "no unit",
                       t->unit[column], *t->unit[column] ? "'" : "");
}

static int x_unit(const struct csv *t, int column, const char *wanted, const char *thousandth, double *times,
                  struct failure *why)
{
    *times = strcmp(t->unit[column], wanted) == 0 ? 1 : 0;
    if (thousandth && strcmp(t->unit[column], thousandth) == 0)
        *times = 1e-3;
    if (*times > 0)
        return STATUS_OK;
    return failure_set(why, STATUS_TABLE_SYNTAX, t->path, NULL, "column '%s' must be in [%s]", t->name[column], wanted);
}

/* A column into a new array of the fit; every value is there and above 0 (x = 0 is dropped by the caller). */
static int take(const struct csv *t, int column, double times, bool zero_first, double **out, struct failure *why)
{
    *out = malloc((t->rows + 1) * sizeof **out);
    if (!*out)
        return failure_set(why, STATUS_MEMORY, t->path, NULL, "no memory for %zu rows", t->rows);
    for (size_t r = 0; r < t->rows; r++) {
        double value = t->value[r * t->columns + (size_t)column];
        if (isnan(value))
            return failure_at(why, STATUS_FIT, t->path, t->line[r], "complete or remove the line", "%s is missing",
                              t->name[column]);
        if (!(value > 0) && !(zero_first && r == 0 && value == 0))
            return failure_at(why, STATUS_FIT, t->path, t->line[r], NULL, "%s = %g: it must be above 0",
                              t->name[column], value);
        (*out)[r] = times * value;
    }
    return STATUS_OK;
}

static int check(const struct csv *t, struct prony_fit *fit, struct failure *why)
{
    for (size_t r = 1; r < t->rows; r++)
        if (!(fit->x[r] > fit->x[r - 1]))
            return failure_at(why, STATUS_FIT, t->path, t->line[r], "sort the rows, each time or frequency once",
                              "%g does not rise above the %g before it", fit->x[r], fit->x[r - 1]);
    if (!fit->oscillating && fit->x[0] == 0) { /* the logarithm of a time is needed: the first row goes */
        memmove(fit->x, fit->x + 1, (fit->points - 1) * sizeof *fit->x);
        memmove(fit->measured[0], fit->measured[0] + 1, (fit->points - 1) * sizeof *fit->x);
        fit->points--;
    }
    size_t n = fit->points;
    if (n < FEWEST_ROWS)
        return failure_set(why, STATUS_FIT, t->path, "measure at more points", "%zu rows are too few: 5 at least", n);
    if (!(fit->x[n - 1] >= 3 * fit->x[0]))
        return failure_set(why, STATUS_FIT, t->path, "measure over a wider range",
                           "from %g to %g is less than a factor of 3", fit->x[0], fit->x[n - 1]);
    double lowest = INFINITY;
    for (size_t r = 0; r < n && !fit->oscillating; r++) {
        lowest = fmin(lowest, fit->measured[0][r]);
        if (fit->measured[0][r] > 1.1 * lowest)
            return failure_at(why, STATUS_FIT, t->path, t->line[r + t->rows - n], "is this a relaxation at all?",
                              "the curve rises to %g after %g: relaxation only falls", fit->measured[0][r], lowest);
    }
    return STATUS_OK;
}

int prony_data_read(const char *path, struct prony_fit *fit, struct failure *why)
{
    static const char *const angular[] = {"omega", "w", NULL}, *const cycles[] = {"f", "frequency", NULL},
                             *const times[] = {"t", "time", NULL}, *const storage[] = {"G'", "E'", NULL},
                             *const loss[] = {"G''", "E''", NULL}, *const relaxation[] = {"G", "E",     "sigma",
                                                                                          "F", "force", NULL};
    struct csv t;
    *fit = (struct prony_fit){.points = 0};
    int status = csv_read(path, &t, why);
    if (status) {
        csv_free(&t);
        return status;
    }
    int omega = find(&t, angular), f = find(&t, cycles), time = find(&t, times), x = omega >= 0 ? omega : f;
    int first = find(&t, storage), second = find(&t, loss), curve = find(&t, relaxation);
    double x_times = 1, y_times[2] = {1, 1};
    fit->oscillating = x >= 0;
    fit->points = t.rows;
    if (fit->oscillating && (first < 0 || second < 0))
        status = failure_set(why, STATUS_TABLE_SYNTAX, path, "add the columns G' [Pa] and G'' [Pa]",
                             "a table with frequencies lacks %s", first < 0 ? "G'" : "G''");
    else if (!fit->oscillating && (time < 0 || curve < 0))
        status = failure_set(why, STATUS_TABLE_SYNTAX, path, "give omega [rad/s], G' [Pa], G'' [Pa], or t [s], G [Pa]",
                             "the table has neither frequencies with G' and G'' nor times with G or F");
    bool force = !fit->oscillating && curve >= 0 && (t.name[curve][0] == 'F' || t.name[curve][0] == 'f');
    if (status == STATUS_OK)
        status = fit->oscillating ? x_unit(&t, x, omega >= 0 ? "rad/s" : "Hz", NULL, &x_times, why)
                                  : x_unit(&t, time, "s", "ms", &x_times, why);
    if (status == STATUS_OK)
        status = modulus_unit(&t, fit->oscillating ? first : curve, force, &y_times[0], why);
    if (status == STATUS_OK && fit->oscillating)
        status = modulus_unit(&t, second, false, &y_times[1], why);
    if (status == STATUS_OK)
        status = take(&t, fit->oscillating ? x : time, fit->oscillating && omega < 0 ? 2 * M_PI : x_times,
                      !fit->oscillating, &fit->x, why);
    if (status == STATUS_OK)
        status = take(&t, fit->oscillating ? first : curve, y_times[0], false, &fit->measured[0], why);
    if (status == STATUS_OK && fit->oscillating)
        status = take(&t, second, y_times[1], false, &fit->measured[1], why);
    if (status == STATUS_OK)
        status = check(&t, fit, why);
    if (status == STATUS_OK) {
        snprintf(fit->unit, sizeof fit->unit, "%s", force ? "N" : "Pa");
        snprintf(fit->what, sizeof fit->what, "%s", t.name[fit->oscillating ? first : curve]);
    }
    csv_free(&t);
    return status;
}

void prony_fit_free(struct prony_fit *fit)
{
    free(fit->x);
    free(fit->measured[0]);
    free(fit->measured[1]);
    *fit = (struct prony_fit){.points = 0};
}
