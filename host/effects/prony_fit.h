/* A Prony series from measurements: a table (csv.h) of either
 *
 *   omega [rad/s] or f [Hz], G' [Pa], G'' [Pa]        an oscillating rheometer; moduli also in kPa or MPa
 *   t [s], G [Pa]                                      a relaxation curve; also F [N] or sigma [Pa]: only ratios matter
 *
 * (G' and G'' may be called E' and E'', G may be E.) Method: non-negative least squares over times that are spaced
 * logarithmically, eight to a decade, over what the data can show (Tschoegl; Baumgaertel and Winter 1989 say why fewer
 * suffice); neighbouring times are joined; then for each number of branches all shares and times are refined by
 * Levenberg and Marquardt (GSL), in logarithms, on relative residuals. The number of branches is the smallest that the
 * corrected Akaike criterion does not prefer a larger one to by more than 2.
 *
 * Refused, with the line where there is one: fewer than 5 rows; values that are missing or not above 0; times or
 * frequencies that do not rise; less than a factor of 3 between the first and the last; moduli that no relaxation can have
 * (a relaxation curve that rises by more than 10 % in all); data that show no equilibrium (its modulus less than 1 % of
 * the largest one: a fluid has none), a residual above 25 %. */
#ifndef TROCAR_PRONY_FIT_H
#define TROCAR_PRONY_FIT_H

#include <stdbool.h>

#include "csv.h"
#include "failure.h"
#include "prony.h"

struct prony_fit {
    struct prony series;
    double equilibrium; /* modulus (or force) at rest, in the unit of the table's column */
    bool oscillating;
    double residual_rms, residual_max; /* relative; of |G*| for an oscillation */
    size_t points;                     /* rows */
    double *x;                         /* omega in rad/s, or t in s */
    double *measured[2];               /* G', G''; or G, NULL */
    char unit[CSV_NAME], what[CSV_NAME];
};

/* Read and fit. STATUS_TABLE_SYNTAX, STATUS_FIT. Free with prony_fit_free, also after a failure. */
int prony_fit_file(const char *path, struct prony_fit *fit, struct failure *why);
void prony_fit_free(struct prony_fit *fit);

/* The fitted curve: part 0 (G', or G) or 1 (G'') at x. */
double prony_fit_value(const struct prony_fit *fit, int part, double x);

#endif
