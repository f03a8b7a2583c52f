/* The search for a step on functions whose answer is known in closed form, and the bound of a tick against its definition. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "random.h"
#include "row_cache.h"
#include "step_search.h"
#include "worst_tick.h"

static const double finest = 2e-5, coarsest = 0.05;

/* value = scale step^power, and a jitter of up to `jitter` that depends on the step alone. */
struct law {
    double scale, power, jitter;
};

static double value_at(const struct law *law, double step)
{
    double phase = 1e4 * log(step);
    return law->scale * pow(step, law->power) * (1 + law->jitter * sin(phase));
}

static double step_of(const struct law *law, double value)
{
    return pow(value / law->scale, 1 / law->power);
}

static void search(struct step_search *s, bool for_bytes, const struct law *law, double limit, double first)
{
    double step;
    step_search_start(s, for_bytes, limit, finest, coarsest, first);
    while (step_search_next(s, &step)) {
        assert_true(step >= finest && step <= coarsest);
        bool kept = step_search_found(s, value_at(law, step));
        assert_true(!kept || (s->step == step && value_at(law, step) <= limit));
    }
    assert_true(s->tries <= STEP_SEARCH_TRIES);
}

static void the_finest_step_within_the_bytes_is_found(void **state)
{
    (void)state;
    random_seed("bytes", 11);
    for (int n = 0; n < 3000; n++) {
        struct law law = {random_range(1e3, 1e5), -random_range(0.15, 0.7), 0};
        double answer = exp(random_range(log(1.1 * finest), log(coarsest / 1.1))), limit = value_at(&law, answer);
        struct step_search s;
        search(&s, true, &law, limit, exp(random_range(log(finest), log(coarsest))));
        assert_true(s.good && value_at(&law, s.step) <= limit);
        /* within 1.5 % of the bytes, or 1 % of the step: what the header promises */
        assert_true(value_at(&law, s.step) >= limit / 1.016 || s.step <= 1.011 * answer);
    }
}

static void the_coarsest_step_within_the_error_is_found(void **state)
{
    (void)state;
    random_seed("error", 12);
    for (int n = 0; n < 3000; n++) {
        struct law law = {random_range(0.5, 20), random_range(0.6, 1.3), 0};
        double answer = exp(random_range(log(1.1 * finest), log(coarsest / 1.1))), limit = value_at(&law, answer);
        struct step_search s;
        search(&s, false, &law, limit, exp(random_range(log(finest), log(coarsest))));
        assert_true(s.good && value_at(&law, s.step) <= limit);
        assert_true(value_at(&law, s.step) >= limit / 1.032 || s.step >= answer / 1.011);
    }
}

static void a_drawn_error_ends_within_its_limit(void **state)
{
    (void)state;
    random_seed("jitter", 13);
    for (int n = 0; n < 3000; n++) {
        struct law law = {random_range(0.5, 20), random_range(0.8, 1.2), 0.04};
        double answer = exp(random_range(log(2 * finest), log(coarsest / 2)));
        struct law mean = {law.scale, law.power, 0};
        double limit = value_at(&mean, answer);
        struct step_search s;
        search(&s, false, &law, limit, answer * random_range(0.3, 3));
        assert_true(s.good && value_at(&law, s.step) <= limit);
        /* the jitter and what the search leaves, as steps */
        assert_true(s.step >= step_of(&mean, limit / 1.04 / 1.04 / 1.04));
    }
}

static void what_cannot_be_met_is_known_with_the_nearest(void **state)
{
    (void)state;
    random_seed("beyond", 14);
    for (int n = 0; n < 1000; n++) {
        bool for_bytes = random_below(2);
        struct law law = {random_range(1, 100), for_bytes ? -random_range(0.15, 0.7) : random_range(0.6, 1.3), 0};
        double end = for_bytes ? coarsest : finest, nearest = value_at(&law, end);
        struct step_search s;
        search(&s, for_bytes, &law, nearest * random_range(0.01, 0.999), exp(random_range(log(finest), log(coarsest))));
        assert_true(!s.good && s.step_least == end && s.least == nearest);
    }
}

static void all_that_fits_is_taken(void **state)
{
    (void)state;
    struct law law = {1000, -0.4, 0}, error = {4, 1, 0};
    struct step_search s;
    search(&s, true, &law, 1e9, 1e-3);
    assert_true(s.good && s.step == finest);
    search(&s, false, &error, 1, 1e-3);
    assert_true(s.good && s.step == coarsest);
}

static const struct worst_effects none, five = {.sweeps = 5}, six = {.sweeps = 6};

static void the_row_work_that_is_given_is_the_largest_within_the_limit(void **state)
{
    (void)state;
    random_seed("instructions", 15);
    for (int n = 0; n < 3000; n++) {
        struct bank_contact contact = {.solver_steps = (uint16_t)random_below(BANK_MAX_SOLVER_STEPS + 1)};
        unsigned points = 1 + random_below(BANK_MAX_TOOL_POINTS);
        uint32_t blocks = random_below(3) ? 1 + random_below(500) : 0;
        double limit = floor(random_range(2e4, 2e6));
        bool kept = worst_tick_fit(&contact, none, points, blocks, limit);
        assert_true(kept == (worst_tick(&contact, none, points, blocks) <= limit));
        if (kept && contact.row_work) { /* 0 is the image's own, which is the most */
            contact.row_work++;
            assert_true(worst_tick(&contact, none, points, blocks) > limit ||
                        contact.row_work * BANK_ROW_WORK_UNIT > ROW_CACHE_WORK);
        }
        if (!kept && blocks)
            assert_int_equal(contact.row_work, 1);
    }
}

static void more_points_steps_and_rows_take_more(void **state)
{
    (void)state;
    struct bank_contact few = {.solver_steps = 3, .row_work = 10}, steps = few, rows = few;
    steps.solver_steps = 4;
    rows.row_work = 11;
    assert_true(worst_tick(&few, none, 7, 100) < worst_tick(&few, none, 8, 100));
    assert_true(worst_tick(&few, none, 7, 100) < worst_tick(&steps, none, 7, 100));
    assert_true(worst_tick(&few, none, 7, 100) < worst_tick(&rows, none, 7, 100));
    few.row_work = rows.row_work = 0;
    rows.row_work = ROW_CACHE_WORK / BANK_ROW_WORK_UNIT;
    assert_true(worst_tick(&few, none, 7, 100) == worst_tick(&rows, none, 7, 100));
    /* with friction the sweeps count, not the factorisations */
    assert_true(worst_tick(&few, five, 7, 100) < worst_tick(&few, six, 7, 100));
    steps = few;
    steps.solver_steps = 4;
    assert_true(worst_tick(&few, five, 7, 100) == worst_tick(&steps, five, 7, 100));
    const struct worst_effects swing = {.modes = 1}, visco = {.branches = 1};
    assert_true(worst_tick(&few, none, 7, 100) < worst_tick(&few, swing, 7, 100));
    assert_true(worst_tick(&few, none, 7, 100) < worst_tick(&few, visco, 7, 100));
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_finest_step_within_the_bytes_is_found),
        cmocka_unit_test(the_coarsest_step_within_the_error_is_found),
        cmocka_unit_test(a_drawn_error_ends_within_its_limit),
        cmocka_unit_test(what_cannot_be_met_is_known_with_the_nearest),
        cmocka_unit_test(all_that_fits_is_taken),
        cmocka_unit_test(the_row_work_that_is_given_is_the_largest_within_the_limit),
        cmocka_unit_test(more_points_steps_and_rows_take_more),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
