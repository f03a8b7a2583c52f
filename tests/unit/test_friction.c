/* Friction: the cone solver against another method in double precision, and the effect on the whole path of the controller
 * against closed forms. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "cone_fixture.h"
#include "tick_bench.h"

static double outside(const struct cone_system *s, double mu)
{
    double worst = 0;
    for (unsigned c = 0; c < s->count; c++) {
        const float *f = s->contact[c].force_N, *n = s->contact[c].frame[0];
        double fn = 0, ft = 0;
        for (int a = 0; a < 3; a++) {
            assert_true(isfinite(f[a]));
            fn += (double)n[a] * f[a];
        }
        for (int a = 0; a < 3; a++)
            ft += pow(f[a] - fn * n[a], 2);
        worst = fmax(worst, fmax(-fn, sqrt(ft) - mu * fn) / fmax(fabs(fn), 1e-3));
    }
    return worst;
}

static void the_force_is_in_its_cone_after_any_number_of_sweeps(void **state)
{
    (void)state;
    random_seed("cone", 21);
    static const unsigned sweeps[] = {1, 2, 3, 5, 10, 20};
    double worst = 0;
    for (int n = 0; n < 2000; n++) {
        struct cone_problem p;
        static struct cone_system s, again;
        double mu = random_below(8) ? random_range(0, 1.5) : 0;
        cone_problem_random(&p, 1 + random_below(16), mu, 0.005, random_range(1e-4, 0.01));
        cone_problem_round(&p, &s);
        for (unsigned c = 0; c < s.count; c++) /* anything may be left of the last tick */
            for (int a = 0; a < 3; a++)
                s.contact[c].force_N[a] = (float)random_range(-1, 1);
        for (unsigned k = 0; k < 6; k++) {
            again = s;
            cone_solve(&again, sweeps[k]);
            assert_true(again.sweeps <= sweeps[k]);
            worst = fmax(worst, outside(&again, p.mu));
        }
    }
    printf("# outside the cone by at most %.1e of the normal force\n", worst);
    assert_true(worst < 4e-6); /* frame and force are rounded to 2^-24, some ten times */
}

static void the_error_left_after_some_sweeps(void **state)
{
    (void)state;
    random_seed("sweeps", 22);
    static const unsigned sweeps[] = {2, 5, 10, 20, 64};
    enum { TRIALS = 300 };
    double worst[5] = {0}, mean[5] = {0}, failure = 0;
    for (int n = 0; n < TRIALS; n++) {
        struct cone_problem p;
        static struct cone_system s, again;
        double f[CONE_UNKNOWNS], total[3] = {0}, size = 0;
        cone_problem_random(&p, 10, 0.2, 0.005, random_range(1e-3, 0.01));
        cone_problem_round(&p, &s);
        failure = fmax(failure, cone_reference(&p, f));
        for (unsigned i = 0; i < 3 * p.m; i++)
            total[i % 3] += f[i];
        size = sqrt(total[0] * total[0] + total[1] * total[1] + total[2] * total[2]);
        for (unsigned k = 0; k < 5; k++) {
            double off = 0;
            again = s;
            cone_solve(&again, sweeps[k]);
            for (int a = 0; a < 3; a++) {
                double sum = 0;
                for (unsigned c = 0; c < p.m; c++)
                    sum += again.contact[c].force_N[a];
                off += (sum - total[a]) * (sum - total[a]);
            }
            worst[k] = fmax(worst[k], sqrt(off) / size);
            mean[k] += sqrt(off) / size / TRIALS;
        }
    }
    printf("# reference fails by %.1e m\n", failure);
    for (unsigned k = 0; k < 5; k++)
        printf("# %2u sweeps from nothing: force off by %.2e at most, %.2e on average\n", sweeps[k], worst[k], mean[k]);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_force_is_in_its_cone_after_any_number_of_sweeps),
        cmocka_unit_test(the_error_left_after_some_sweeps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
