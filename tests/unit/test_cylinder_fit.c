/* The polynomials of the quasi-non-linear correction: recovered from their own values, monotone or refused, continued along
 * the tangent; and the compression of a tissue cylinder that slips between its plates, whose force and bulge are known in
 * closed form for a neo-Hookean body, reproduced from a table. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "element.h"
#include "cylinder_fit.h"
#include "status.h"

static void a_polynomial_comes_back(void **state)
{
    (void)state;
    double x[12], y[12];
    struct monotone c;
    struct failure why;
    for (int k = 0; k < 12; k++) {
        x[k] = 0.5 * k;
        y[k] = 3 * x[k] + 0.5 * x[k] * x[k] + 0.1 * pow(x[k], 4);
    }
    assert_int_equal(monotone_fit(12, x, y, 4, "test", &c, &why), STATUS_OK);
    assert_true(c.residual_max < 1e-12);
    for (double at = 0; at < 5.5; at += 0.1) {
        assert_true(fabs(monotone_value(&c, at) - (3 * at + 0.5 * at * at + 0.1 * pow(at, 4))) < 1e-10);
        assert_true(fabs(monotone_value(&c, at) + monotone_value(&c, -at)) < 1e-12);
    }
    double slope = 3 + 5.5 + 0.4 * pow(5.5, 3); /* beyond: the tangent at 5.5 */
    assert_true(fabs(monotone_slope(&c, 9) - slope) < 1e-9);
    assert_true(fabs(monotone_value(&c, 7.5) - monotone_value(&c, 5.5) - 2 * slope) < 1e-8);
}

static void what_turns_or_is_too_short_is_refused(void **state)
{
    (void)state;
    double x[12], y[12];
    struct monotone c;
    struct failure why;
    for (int k = 0; k < 12; k++) {
        x[k] = k / 11.0;
        y[k] = x[k] - 0.8 * x[k] * x[k]; /* turns at 0.625 */
    }
    assert_int_equal(monotone_fit(12, x, y, 2, "test", &c, &why), STATUS_FIT);
    assert_non_null(strstr(why.cause, "0.625"));
    assert_int_equal(monotone_fit(3, x, y, 2, "test", &c, &why), STATUS_FIT);
    for (int k = 0; k < 12; k++) /* falls from the start */
        y[k] = -x[k] + 3 * x[k] * x[k];
    assert_int_equal(monotone_fit(12, x, y, 2, "test", &c, &why), STATUS_FIT);
}

/* Of a bar at stretch s whose sides are free: mu (b^2 - 1) + lambda ln(s b^2) = 0 for the lateral stretch b. */
static double lateral(struct lame m, double s)
{
    double low = 0.3, high = 3;
    for (int k = 0; k < 200; k++) {
        double b = (low + high) / 2;
        *(m.mu_Pa * (b * b - 1) + m.lambda_Pa * log(s * b * b) > 0 ? &high : &low) = b;
    }
    return low;
}

static int fit_of(const char *text, int degree, struct cylinder_fit *q, struct failure *why)
{
    static const struct sample brain = {.height_m = 0.013, .radius_m = 0.015, .E_Pa = 3000, .nu = 0.45};
    char path[] = "/tmp/trocar-curve-XXXXXX";
    int file = mkstemp(path);
    assert_true(file >= 0 && write(file, text, strlen(text)) == (ssize_t)strlen(text));
    close(file);
    int status = cylinder_fit_file(path, &brain, degree, q, why);
    unlink(path);
    return status;
}

/* To 30 % of its height, in steps of 1.5 %. */
static void the_compression_of_a_tissue_cylinder_is_reproduced(void **state)
{
    (void)state;
    const double h = 0.013, r = 0.015, E = 3000, nu = 0.45;
    struct lame m = lame_from_young(E, nu);
    char text[4000] = "# a cylinder between plates\ndepth [mm], force [mN], across [mm]\n";
    double force[21], bulge[21], worst[3] = {0}, area = acos(-1) * r * r;
    for (int k = 0; k <= 20; k++) {
        double s = 1 - 0.015 * k, b = lateral(m, s);
        force[k] = -area * (m.mu_Pa * (s - 1 / s) + m.lambda_Pa * log(s * b * b) / s);
        bulge[k] = r * (b - 1);
        snprintf(text + strlen(text), sizeof text - strlen(text), "%.9g, %.9g, %.9g\n", 1e3 * h * 0.015 * k,
                 1e3 * force[k], 1e3 * bulge[k]);
    }
    struct cylinder_fit q;
    struct failure why;
    assert_int_equal(fit_of(text, 4, &q, &why), STATUS_OK);
    assert_true(q.has_across && fabs(q.depth_max_m - 0.3 * h) < 1e-12);
    for (int k = 0; k <= 20; k++) {
        double x = 0.015 * k * h, f = area * E * x / h, w = nu * r * x / h;
        worst[0] = fmax(worst[0], fabs(monotone_value(&q.Q, f) - force[k]) / force[20]);
        worst[1] = fmax(worst[1], fabs(monotone_value(&q.P, w) - bulge[k]) / bulge[20]);
        worst[2] = fmax(worst[2], fabs(f - force[k]) / force[20]);
    }
    printf("# cylinder: force to %.2e, bulge to %.2e of the largest, degrees %d and %d; linear elasticity is off by "
           "%.0f %%\n",
           worst[0], worst[1], q.Q.degree, q.P.degree, 100 * worst[2]);
    assert_true(worst[0] < 0.005 && worst[1] < 0.005);     /* the fit's own promise */
    assert_true(fabs(worst[0] - q.Q.residual_max) < 1e-7); /* 9 digits in the table */
    assert_true(worst[2] > 0.1);
}

static void bad_tables_are_refused_with_their_line(void **state)
{
    (void)state;
    struct cylinder_fit q;
    struct failure why;
    assert_int_equal(fit_of("depth [mm], F [N]\n0, 0\n", 2, &q, &why), STATUS_TABLE_SYNTAX);
    assert_int_equal(fit_of("depth [mm], force [kg]\n0, 0\n", 2, &q, &why), STATUS_TABLE_SYNTAX);
    assert_int_equal(fit_of("depth [mm], force [N]\n0, 0\n1, 1\n1, 2\n", 2, &q, &why), STATUS_FIT);
    assert_non_null(strstr(why.place, ":4"));
    assert_int_equal(fit_of("depth [mm], force [N]\n0, 0\n1, \n2, 2\n", 2, &q, &why), STATUS_FIT);
    assert_non_null(strstr(why.place, ":3"));
    assert_int_equal(fit_of("depth [mm], force [N]\n0, 0\n1, 1\n2, 2\n", 2, &q, &why), STATUS_FIT);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_polynomial_comes_back),
        cmocka_unit_test(what_turns_or_is_too_short_is_refused),
        cmocka_unit_test(the_compression_of_a_tissue_cylinder_is_reproduced),
        cmocka_unit_test(bad_tables_are_refused_with_their_line),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
