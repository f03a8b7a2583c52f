/* The quasi-non-linear correction of [C97 3.4.2]: a polynomial Q in the amplitude of the linear force along the imposed
 * direction, and P in the linear displacement across it, fitted to the compression of a cylinder between plates that let it
 * slip. Linear elasticity with E and nu says of it, at depth x (height h, radius r),
 *     f_L = pi r^2 E x / h,     w_L = nu r x / h      (the bulge of its radius).
 *
 * A curve is fitted by least squares without a constant (GSL), is monotone from 0 to `range`, and goes on along its tangent
 * beyond. What it was fitted to is one line of compressions: beside that line it is no truer than linear elasticity
 * (tests/accuracy/test_second_order.c); second_order.h is the correction that holds in every direction. */
#ifndef TROCAR_CYLINDER_FIT_H
#define TROCAR_CYLINDER_FIT_H

#include <stdbool.h>
#include <stddef.h>

#include "failure.h"

enum { CYLINDER_FIT_DEGREE_MIN = 2, CYLINDER_FIT_DEGREE_MAX = 10 };

struct monotone {
    int degree;
    double coefficient[CYLINDER_FIT_DEGREE_MAX + 1]; /* of (x / range)^k, in the unit of y; [0] is 0 */
    double range;                                    /* largest x of the data */
    double residual_rms, residual_max;               /* of the largest |y| */
};

/* Fit of y(x), x rising from 0 or above. `place` is named in messages. STATUS_FIT when there are fewer than degree + 2 points or
 * the curve is not monotone on its range, with the x where it turns; MEMORY. */
int monotone_fit(size_t count, const double *x, const double *y, int degree, const char *place, struct monotone *curve,
                 struct failure *why);

/* The curve; odd in x; along the tangent beyond the range. */
double monotone_value(const struct monotone *curve, double x);
double monotone_slope(const struct monotone *curve, double x);

/* The first x in 0 .. range where the slope vanishes, or a negative number: it is monotone. */
double monotone_turn(const struct monotone *curve);

struct sample {
    double height_m, radius_m, E_Pa, nu;
};

/* What linear elasticity says of the sample at a depth: its force, N; or, `across`, the bulge of its radius, m. */
double cylinder_linear(const struct sample *sample, double depth_m, int across);

/* Measured, in SI; depth rises. */
struct cylinder_table {
    size_t rows;
    double *depth_m, *force_N, *across_m; /* across: NULL when the table has none */
};

/* A table (csv.h) of depth [m or mm], force [N or mN], and, optional, across [m or mm]. STATUS_TABLE_SYNTAX, STATUS_FIT with the
 * line, MEMORY. */
int cylinder_table_read(const char *path, struct cylinder_table *table, struct failure *why);
void cylinder_table_free(struct cylinder_table *table);

struct cylinder_fit {
    struct monotone Q; /* N -> N */
    bool has_across;
    struct monotone P;  /* m -> m, across */
    double depth_max_m; /* of the data */
};

/* From a table. The degrees are the lowest from `degree_min` up whose largest residual is below 0.5 %, or those of the smallest residual. STATUS_TABLE_SYNTAX,
 * STATUS_FIT with the line or the depth. */
int cylinder_fit_file(const char *path, const struct sample *sample, int degree_min, struct cylinder_fit *fit,
                      struct failure *why);

#endif
