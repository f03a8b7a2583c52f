/* The controller's elementary functions against the C library in double precision. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "random.h"
#include "real.h"

static void sine_and_cosine_err_less_than_stated(void **state)
{
    (void)state;
    double worst = 0;
    for (int i = -1000000; i <= 1000000; i++) {
        float x = (float)(i * 1.5707963e-6);
        worst = fmax(worst, fabs(real_sin(x) - sin(x)));
        worst = fmax(worst, fabs(real_cos(x) - cos(x)));
    }
    printf("# largest error of sine and cosine %.3g\n", worst);
    assert_true(worst < 1.5e-7);
}

static void sine_and_cosine_are_clamped_outside_their_range(void **state)
{
    (void)state;
    assert_true(real_sin(1e30f) == real_sin(1.57079633f));
    assert_true(real_cos(-1e30f) == real_cos(1.57079633f));
}

static void root_errs_less_than_stated_over_sixty_decades(void **state)
{
    (void)state;
    random_seed("root", 1);
    double worst = 0;
    for (int i = 0; i < 1000000; i++) {
        float x = (float)pow(10, random_range(-30, 30));
        worst = fmax(worst, fabs(real_sqrt(x) / sqrt(x) - 1));
    }
    printf("# largest relative error of the root %.3g\n", worst);
    assert_true(worst < 1.2e-7);
    assert_true(real_sqrt(0) == 0 && real_sqrt(-1) == 0 && real_sqrt(nanf("")) == 0);
}

static void finite_tells_infinities_and_nan(void **state)
{
    (void)state;
    assert_true(real_finite(0) && real_finite(-3e38f) && real_finite(1e-45f));
    assert_false(real_finite(INFINITY) || real_finite(-INFINITY) || real_finite(NAN));
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sine_and_cosine_err_less_than_stated),
        cmocka_unit_test(sine_and_cosine_are_clamped_outside_their_range),
        cmocka_unit_test(root_errs_less_than_stated_over_sixty_decades),
        cmocka_unit_test(finite_tells_infinities_and_nan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
