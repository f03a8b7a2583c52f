/* The states of the controller: silent until proven good, latched after a doubt. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "safety.h"

static void feed(struct safety *s, unsigned ticks, bool fresh, bool plausible)
{
    for (unsigned i = 0; i < ticks; i++)
        safety_update(s, fresh, plausible, false);
}

static struct safety running(void)
{
    struct safety s = {.state = SAFETY_INIT};
    feed(&s, SAFETY_READY_SAMPLES, true, true);
    safety_acknowledge(&s, true);
    return s;
}

static void torque_needs_good_samples_and_then_the_host(void **state)
{
    (void)state;
    struct safety s = {.state = SAFETY_INIT};
    for (int i = 0; i < SAFETY_READY_SAMPLES - 1; i++) {
        safety_update(&s, true, true, false);
        safety_acknowledge(&s, true); /* too early: no effect */
        assert_int_equal(s.state, SAFETY_INIT);
        assert_false(safety_torque(&s));
    }
    safety_update(&s, true, true, false);
    assert_int_equal(s.state, SAFETY_READY);
    assert_false(safety_torque(&s));
    safety_acknowledge(&s, true);
    assert_int_equal(s.state, SAFETY_RUN);
    assert_true(safety_torque(&s));
}

static void one_bad_sample_before_ready_starts_the_count_again(void **state)
{
    (void)state;
    struct safety s = {.state = SAFETY_INIT};
    feed(&s, SAFETY_READY_SAMPLES - 1, true, true);
    feed(&s, 1, true, false);
    feed(&s, SAFETY_READY_SAMPLES - 1, true, true);
    assert_int_equal(s.state, SAFETY_INIT);
}

static void silence_of_five_ticks_is_safe_and_four_are_counted_only(void **state)
{
    (void)state;
    struct safety s = running();
    feed(&s, SAFETY_STALE_TICKS - 1, false, false);
    assert_int_equal(s.state, SAFETY_RUN);
    feed(&s, 1, true, true);
    assert_int_equal(s.missed, SAFETY_STALE_TICKS - 1);
    feed(&s, SAFETY_STALE_TICKS, false, false);
    assert_int_equal(s.state, SAFETY_SAFE);
    assert_int_equal(s.reason, STATUS_LOOP_STALE);
}

static void implausible_samples_and_overruns_in_a_row_are_safe(void **state)
{
    (void)state;
    struct safety s = running();
    feed(&s, SAFETY_IMPLAUSIBLE_TICKS - 1, true, false);
    assert_int_equal(s.state, SAFETY_RUN);
    feed(&s, 1, true, false);
    assert_int_equal(s.state, SAFETY_SAFE);
    assert_int_equal(s.reason, STATUS_LOOP_IMPLAUSIBLE);
    assert_int_equal(s.implausible, SAFETY_IMPLAUSIBLE_TICKS);

    s = running();
    for (int i = 0; i < SAFETY_OVERRUN_TICKS; i++) {
        assert_int_equal(s.state, SAFETY_RUN);
        safety_update(&s, true, true, true);
    }
    assert_int_equal(s.reason, STATUS_LOOP_OVERRUN);
}

static void safe_is_latched_until_acknowledged_with_good_samples_and_no_force(void **state)
{
    (void)state;
    struct safety s = running();
    feed(&s, SAFETY_STALE_TICKS, false, false);
    safety_acknowledge(&s, true); /* still silent */
    assert_int_equal(s.state, SAFETY_SAFE);
    feed(&s, 10 * SAFETY_READY_SAMPLES, true, true);
    assert_int_equal(s.state, SAFETY_SAFE);
    safety_acknowledge(&s, false); /* force not gone */
    assert_int_equal(s.state, SAFETY_SAFE);
    safety_acknowledge(&s, true);
    assert_int_equal(s.state, SAFETY_READY);
    safety_acknowledge(&s, true);
    assert_int_equal(s.state, SAFETY_RUN);
}

static void samples_gone_bad_since_ready_forbid_the_start(void **state)
{
    (void)state;
    struct safety s = {.state = SAFETY_INIT};
    feed(&s, SAFETY_READY_SAMPLES, true, true);
    feed(&s, 1, false, false);
    safety_acknowledge(&s, true);
    assert_int_equal(s.state, SAFETY_READY);
    feed(&s, SAFETY_READY_SAMPLES, true, true);
    safety_acknowledge(&s, true);
    assert_int_equal(s.state, SAFETY_RUN);
}

static void losing_more_than_a_third_for_long_is_safe_and_a_tenth_is_not(void **state)
{
    (void)state;
    for (unsigned every = 2; every <= 10; every++) { /* one of so many samples is lost */
        struct safety s = running();
        unsigned ticks = 0;
        while (s.state == SAFETY_RUN && ticks < 10000) {
            bool lost = ticks % every == 0;
            safety_update(&s, !lost, !lost, false);
            ticks++;
        }
        assert_int_equal(s.state, every == 2 ? SAFETY_SAFE : SAFETY_RUN);
        if (every == 2)
            assert_in_range(ticks, 500, 700); /* half lost fills 300 by 1/2 a tick */
    }
}

static void sequence_accepts_newer_and_counts_duplicate_and_older(void **state)
{
    (void)state;
    for (unsigned last = 0; last < 16; last++)
        for (unsigned next = 0; next < 16; next++) {
            struct safety s = {.sequence = (uint8_t)last, .sequence_known = true};
            unsigned ahead = (next - last) & 15;
            assert_int_equal(safety_sequence(&s, (uint8_t)next), ahead >= 1 && ahead <= 8);
            assert_int_equal(s.duplicates, ahead == 0);
            assert_int_equal(s.out_of_sequence, ahead > 8);
        }
}

static void a_stuck_sequence_is_named_as_the_reason(void **state)
{
    (void)state;
    struct safety s = running();
    s.sequence_known = true;
    s.sequence = 3;
    for (int i = 0; i < SAFETY_STALE_TICKS; i++)
        safety_update(&s, safety_sequence(&s, 3), false, false);
    assert_int_equal(s.state, SAFETY_SAFE);
    assert_int_equal(s.reason, STATUS_LOOP_SEQUENCE);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(torque_needs_good_samples_and_then_the_host),
        cmocka_unit_test(one_bad_sample_before_ready_starts_the_count_again),
        cmocka_unit_test(silence_of_five_ticks_is_safe_and_four_are_counted_only),
        cmocka_unit_test(implausible_samples_and_overruns_in_a_row_are_safe),
        cmocka_unit_test(safe_is_latched_until_acknowledged_with_good_samples_and_no_force),
        cmocka_unit_test(samples_gone_bad_since_ready_forbid_the_start),
        cmocka_unit_test(losing_more_than_a_third_for_long_is_safe_and_a_tenth_is_not),
        cmocka_unit_test(sequence_accepts_newer_and_counts_duplicate_and_older),
        cmocka_unit_test(a_stuck_sequence_is_named_as_the_reason),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
