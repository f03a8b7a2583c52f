/* The simulated instrument against closed forms of its mechanics. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "device.h"
#include "hand.h"

static const struct hand nobody = {.start = {0, 0, 0.16}};

/* A model that a test may alter: no gravity, fast motors. */
static struct device_model plain(void)
{
    struct device_model model = *device_model_find("impulse-engine");
    model.gravity_N = 0;
    for (int k = 0; k < 3; k++)
        model.axis[k].bandwidth_Hz = 1e6;
    return model;
}

static void command_for(struct device *device, const double effort[3], const struct hand *hand, unsigned ms)
{
    for (unsigned t = 0; t < ms; t++) {
        device_command(device, effort, true);
        device_step(device, hand, 1e-3 * t, 1000);
    }
}

static void effort_below_coulomb_moves_nothing(void **state)
{
    (void)state;
    struct device_model model = plain();
    for (int k = 0; k < 3; k++)
        for (int sign = -1; sign <= 1; sign += 2) {
            struct device device;
            device_start(&device, &model, &nobody);
            double before = device.joint[k], effort[3] = {0};
            effort[k] = sign * 0.999 * model.axis[k].coulomb;
            command_for(&device, effort, NULL, 5000);
            assert_memory_equal(&device.joint[k], &before, sizeof before); /* not one bit: no creeping */
            effort[k] = sign * 1.01 * model.axis[k].coulomb;
            command_for(&device, effort, NULL, 100);
            assert_true((device.joint[k] - before) * sign > 0);
        }
}

/* A hand that leans with less than the friction at the tip moves nothing either. */
static void hand_below_coulomb_moves_nothing(void **state)
{
    (void)state;
    struct device_model model = plain();
    struct hand hand = nobody;
    hand.stiffness_N_m = HAND_STIFFNESS_N_M;
    hand.damping_Ns_m = HAND_DAMPING_NS_M;
    struct device device;
    device_start(&device, &model, &hand);
    hand.start[2] += 0.99 * model.axis[2].coulomb / hand.stiffness_N_m;
    double before = device.joint[2];
    device_step(&device, &hand, 0, 1000000);
    assert_memory_equal(&device.joint[2], &before, sizeof before);
}

/* m v' = F - f_c - b v from rest: v = (F - f_c)/b (1 - exp(-b t/m)). Backward Euler errs by at most half a step of the
 * solution's curvature: relative h b / (2 m) of the final speed. */
static void constant_effort_follows_the_closed_form(void **state)
{
    (void)state;
    struct device_model model = plain();
    model.axis[2].minimum = -100;
    model.axis[2].maximum = 100;
    const struct device_axis_model *a = &model.axis[2];
    struct device device;
    device_start(&device, &model, &nobody);
    double F = 2.0, final = (F - a->coulomb) / a->viscous, effort[3] = {0, 0, F};
    for (unsigned t = 1; t <= 500; t++) {
        command_for(&device, effort, NULL, 1);
        double v = final * (1 - exp(-1e-3 * t * a->viscous / a->inertia));
        double bound = final * 50e-6 * a->viscous / (2 * a->inertia) * 1.01;
        assert_true(fabs(device.speed[2] - v) <= bound);
    }
}

/* Sliding to rest under friction alone takes m v0 / f_c without viscosity, and ends exactly. */
static void coulomb_friction_stops_in_finite_time(void **state)
{
    (void)state;
    struct device_model model = plain();
    model.axis[2].viscous = 0;
    const struct device_axis_model *a = &model.axis[2];
    struct device device;
    device_start(&device, &model, &nobody);
    device.speed[2] = 0.05;
    double start = device.joint[2], stop_s = a->inertia * 0.05 / a->coulomb;
    uint32_t steps = 0;
    for (; device.speed[2] != 0 && steps < 100000; steps++)
        device_step(&device, NULL, 0, DEVICE_SUBSTEP_US);
    assert_true(fabs(steps * 50e-6 - stop_s) <= 50e-6);
    /* distance v0^2 m / (2 f_c), one step of rounding at the start */
    assert_true(fabs(device.joint[2] - start - 0.5 * 0.05 * stop_s) <= 0.05 * 50e-6);
}

static void motors_follow_with_their_bandwidth_and_saturate(void **state)
{
    (void)state;
    struct device_model model = *device_model_find("impulse-engine");
    struct device device;
    device_start(&device, &model, &nobody);
    double effort[3];
    for (int k = 0; k < 3; k++)
        effort[k] = 10 * model.axis[k].effort_limit;
    device_command(&device, effort, true);
    for (int n = 1; n <= 100; n++) {
        device_step(&device, NULL, 0, DEVICE_SUBSTEP_US);
        for (int k = 0; k < 3; k++) {
            double limit = model.axis[k].effort_limit;
            double expected = limit * (1 - exp(-2 * M_PI * model.axis[k].bandwidth_Hz * n * 50e-6));
            assert_true(fabs(device.effort[k] - expected) < 1e-12 * limit);
        }
    }
    double bad[3] = {NAN, INFINITY, -INFINITY};
    device_command(&device, bad, true);
    for (int k = 0; k < 3; k++)
        assert_true(device.command[k] == 0);
}

static void silence_drops_the_motors_after_10_ms(void **state)
{
    (void)state;
    struct device_model model = plain();
    struct device device;
    device_start(&device, &model, &nobody);
    double effort[3] = {0.1, 0.1, 1};
    device_command(&device, effort, true);
    device_step(&device, NULL, 0, 10000 - DEVICE_SUBSTEP_US);
    assert_true(device.enabled && device.effort[2] > 0.99);
    device_step(&device, NULL, 0, 2 * DEVICE_SUBSTEP_US);
    assert_false(device.enabled);
    assert_int_equal(device.silences, 1);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(device.effort[k]) < 1e-6);
    device_command(&device, effort, true);
    device_step(&device, NULL, 0, 1000);
    assert_true(device.enabled && device.effort[2] > 0.99);
}

/* Counts are the joint to half a step, and the wrap can be followed as long as no more than half a turn goes by. */
static void encoders_quantise_and_wrap(void **state)
{
    (void)state;
    struct device_model model = plain();
    for (int k = 0; k < 3; k++) {
        model.axis[k].count_modulus = 1000; /* 23 mm: wraps several times over the range */
        model.axis[k].count_zero = 990;
    }
    model.axis[1].per_count = -model.axis[1].per_count; /* mounted the other way round */
    struct device device;
    device_start(&device, &model, &nobody);
    long turns[3] = {0};
    uint16_t last[3];
    device_counts(&device, last);
    for (int k = 0; k < 3; k++)
        turns[k] = lround((device.joint[k] - model.axis[k].zero) / model.axis[k].per_count);
    for (int n = 0; n <= 4000; n++) {
        uint16_t counts[3];
        for (int k = 0; k < 3; k++) {
            const struct device_axis_model *a = &model.axis[k];
            double middle = 0.5 * (a->minimum + a->maximum), half = 0.5 * (a->maximum - a->minimum);
            device.joint[k] = middle + half * sin(1e-3 * n * (k + 1));
        }
        device_counts(&device, counts);
        for (int k = 0; k < 3; k++) {
            const struct device_axis_model *a = &model.axis[k];
            assert_true(counts[k] < a->count_modulus);
            if (n > 0) {
                int step = (int)counts[k] - (int)last[k];
                step += step < -500 ? 1000 : step >= 500 ? -1000 : 0;
                turns[k] += step;
            } else {
                turns[k] = lround((device.joint[k] - a->zero) / a->per_count);
            }
            last[k] = counts[k];
            double seen = a->zero + (double)turns[k] * a->per_count;
            assert_true(fabs(seen - device.joint[k]) <= 0.5 * fabs(a->per_count) * (1 + 1e-9));
        }
    }
}

static void stops_hold(void **state)
{
    (void)state;
    struct device_model model = plain();
    struct device device;
    for (int sign = -1; sign <= 1; sign += 2) {
        device_start(&device, &model, &nobody);
        double effort[3];
        for (int k = 0; k < 3; k++)
            effort[k] = sign * model.axis[k].effort_limit;
        command_for(&device, effort, NULL, 1000);
        for (int k = 0; k < 3; k++) {
            assert_true(device.joint[k] == (sign < 0 ? model.axis[k].minimum : model.axis[k].maximum));
            assert_true(device.speed[k] == 0);
        }
    }
}

static void velocity_is_the_derivative_of_the_tip(void **state)
{
    (void)state;
    struct device_model model = plain();
    struct device device;
    device_start(&device, &model, &nobody);
    for (int n = 0; n < 200; n++) {
        const double joint[3] = {0.45 * sin(n), 0.45 * cos(1.7 * n), 0.165 + 0.06 * sin(0.3 * n)};
        const double speed[3] = {cos(0.9 * n), sin(2.1 * n), 0.3 * cos(3.3 * n)};
        const double h = 1e-5; /* central difference: error h^2/6 of the third derivative, below 1e-8 here */
        double velocity[3], ahead[3], behind[3];
        memcpy(device.joint, joint, sizeof joint);
        memcpy(device.speed, speed, sizeof speed);
        device_velocity(&device, velocity);
        for (int k = 0; k < 3; k++)
            device.joint[k] = joint[k] + h * speed[k];
        device_tip(&device, ahead);
        for (int k = 0; k < 3; k++)
            device.joint[k] = joint[k] - h * speed[k];
        device_tip(&device, behind);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(velocity[i] - (ahead[i] - behind[i]) / (2 * h)) < 1e-8);
    }
}

/* Let go off its rest by the hand's spring: energy (kinetic and spring) falls at every step, and all of it is gone. */
static void held_by_a_still_hand_it_comes_to_rest(void **state)
{
    (void)state;
    struct device_model model = plain();
    struct hand hand = nobody;
    hand.stiffness_N_m = HAND_STIFFNESS_N_M;
    hand.damping_Ns_m = HAND_DAMPING_NS_M;
    struct device device;
    device_start(&device, &model, &hand);
    device.joint[0] += 0.1;
    device.joint[1] -= 0.05;
    device.joint[2] += 0.02;
    double last = INFINITY;
    for (int t = 0; t < 20000; t++) {
        double tip[3], energy = device_kinetic_J(&device);
        device_tip(&device, tip);
        for (int i = 0; i < 3; i++)
            energy += 0.5 * hand.stiffness_N_m * (tip[i] - hand.start[i]) * (tip[i] - hand.start[i]);
        assert_true(energy <= last);
        last = energy;
        device_step(&device, &hand, 0, DEVICE_SUBSTEP_US);
    }
    for (int k = 0; k < 3; k++)
        assert_true(device.speed[k] == 0);
}

static void same_calls_give_the_same_bits(void **state)
{
    (void)state;
    struct gesture gesture;
    char message[100];
    long line;
    assert_int_equal(gesture_read("tour", &gesture, message, sizeof message, &line), 0);
    struct hand hand = {.stiffness_N_m = HAND_STIFFNESS_N_M,
                        .damping_Ns_m = HAND_DAMPING_NS_M,
                        .start = {0, 0, 0.11},
                        .touch = {0.01, 0, 0.13},
                        .gesture = &gesture};
    struct device device[2];
    for (int n = 0; n < 2; n++) {
        memset(&device[n], n ? 0xFF : 0, sizeof device[n]);
        device_start(&device[n], device_model_find("impulse-engine"), &hand);
        for (int t = 0; t < 3000; t++)
            device_step(&device[n], &hand, 1e-3 * t, 1000);
    }
    assert_memory_equal(device[0].joint, device[1].joint, sizeof device[0].joint);
    assert_memory_equal(device[0].speed, device[1].speed, sizeof device[0].speed);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(effort_below_coulomb_moves_nothing),
        cmocka_unit_test(hand_below_coulomb_moves_nothing),
        cmocka_unit_test(constant_effort_follows_the_closed_form),
        cmocka_unit_test(coulomb_friction_stops_in_finite_time),
        cmocka_unit_test(motors_follow_with_their_bandwidth_and_saturate),
        cmocka_unit_test(silence_drops_the_motors_after_10_ms),
        cmocka_unit_test(encoders_quantise_and_wrap),
        cmocka_unit_test(stops_hold),
        cmocka_unit_test(velocity_is_the_derivative_of_the_tip),
        cmocka_unit_test(held_by_a_still_hand_it_comes_to_rest),
        cmocka_unit_test(same_calls_give_the_same_bits),
    };
    return cmocka_run_group_tests_name("device", tests, NULL, NULL);
}
