/* The whole path of the controller on the fixture's sphere: samples in, torques out. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "random.h"
#include "tick_bench.h"

static double length(const float v[3])
{
    return sqrt((double)v[0] * v[0] + (double)v[1] * v[1] + (double)v[2] * v[2]);
}

/* The torque frame must do the virtual work of the force the controller says it renders. */
static void torque_frame_is_jt_of_the_rendered_force(void **state)
{
    (void)state;
    struct bench b;
    bench_open(&b, NULL);
    bench_start(&b, 0.05, -0.04, 0.10);
    for (int i = 0; i < 600; i++) {
        bench_tick(&b, 0.05, -0.04, 0.10 + 0.03 * i / 600);
        const struct controller *c = &b.node.controller;
        const struct bank_tool *t = &b.bank.tools[0];
        double a = c->instrument[0].kinematics.joint[0], bb = c->instrument[0].kinematics.joint[1],
               L = c->instrument[0].kinematics.joint[2];
        double sa = sin(a), sb = sin(bb), root = sqrt(1 - sa * sa - sb * sb), f[3] = {0}, g[3] = {0};
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++) {
                f[k] += t->rotation[3 * j + k] * c->instrument[0].coupling.force_N[j];
                g[k] += t->rotation[3 * j + k] * t->gravity_direction[j] * t->gravity_N * t->gravity_arm_m;
            }
        double share = c->instrument[0].coupling.gravity_share;
        double want[3] = {L * cos(a) * (f[0] - f[2] * sa / root) + share * cos(a) * (g[0] - g[2] * sa / root),
                          L * cos(bb) * (f[1] - f[2] * sb / root) + share * cos(bb) * (g[1] - g[2] * sb / root),
                          sa * f[0] + sb * f[1] + root * f[2]};
        assert_true(fabs(b.torques.alpha * 1e-4 - want[0]) < 0.6e-4); /* half a step of the wire and rounding */
        assert_true(fabs(b.torques.beta * 1e-4 - want[1]) < 0.6e-4);
        assert_true(fabs(b.torques.insertion * 1e-3 - want[2]) < 0.6e-3);
    }
    assert_true(length(b.node.controller.instrument[0].coupling.force_N) > 0.1);
    bench_close(&b);
}

static void force_rises_with_depth_and_is_gone_after_retraction(void **state)
{
    (void)state;
    struct bench b;
    bench_open(&b, NULL);
    bench_start(&b, 0, 0, 0.10);
    double last = 0;
    unsigned contacts = 0;
    for (int i = 0; i <= 2000; i++) {
        bench_tick(&b, 0, 0, 0.10 + 0.03 * i / 2000);
        double force = length(b.node.controller.contact.force_N[0]);
        assert_true(force >= last - 2e-3); /* another point that touches may shift the load, not lower it */
        last = force;
        contacts = b.node.controller.contact.count > contacts ? b.node.controller.contact.count : contacts;
    }
    printf("# %.2f N at %.1f mm, %u contacts\n", last, 1e3 * (0.13 + 0.005 - 0.12), contacts);
    assert_true(last > 0.2 && contacts == 7);
    for (int i = 0; i <= 2000; i++)
        bench_tick(&b, 0, 0, 0.13 - 0.03 * i / 2000);
    for (int i = 0; i < 20; i++)
        bench_tick(&b, 0, 0, 0.10);
    assert_int_equal(b.node.controller.contact.count, 0);
    assert_true(length(b.node.controller.instrument[0].coupling.force_N) == 0);
    bench_close(&b);
}

static void a_silent_device_in_contact_lets_the_torque_decay_to_zero(void **state)
{
    (void)state;
    struct bench b;
    bench_open(&b, NULL);
    bench_start(&b, 0, 0, 0.10);
    for (int i = 0; i < 1000; i++)
        bench_tick(&b, 0, 0, 0.10 + 0.025 * i / 1000);
    double force = length(b.node.controller.instrument[0].coupling.force_N), before = force;
    assert_true(force > 0.2);
    int ticks = 0;
    while (b.torques.enable && ticks < 1000) {
        bench_silent_tick(&b);
        double now = length(b.node.controller.instrument[0].coupling.force_N);
        assert_true(now < before || now == 0);
        before = now;
        ticks++;
    }
    printf("# %.2f N decayed to zero, motors off after %d ms\n", force, ticks);
    assert_true(ticks < 250); /* ln(8.9 N / 1 mN) = 9.1 time constants of 20 ms and the five ticks before SAFE */
    assert_int_equal(b.node.controller.instrument[0].safety.state, SAFETY_SAFE);
    assert_int_equal(b.node.controller.instrument[0].safety.reason, STATUS_LOOP_STALE);

    for (int i = 0; i < 200; i++) { /* samples alone do not bring torque back */
        bench_tick(&b, 0, 0, 0.125);
        assert_int_equal(b.torques.enable, 0);
    }
    bench_command(&b, 1);
    bench_tick(&b, 0, 0, 0.125);
    assert_int_equal(b.node.controller.instrument[0].safety.state, SAFETY_READY);
    assert_int_equal(b.torques.enable, 0);
    bench_command(&b, 1);
    bench_tick(&b, 0, 0, 0.125);
    assert_int_equal(b.node.controller.instrument[0].safety.state, SAFETY_RUN);
    bench_close(&b);
}

/* An encoder that loses counts stands somewhere else from one sample to the next. However small the jump beyond what the
 * joint can do in a tick, it is a doubt: not one force is rendered from it. */
static void a_lasting_jump_of_the_encoder_ends_in_safe_and_is_not_rendered(void **state)
{
    (void)state;
    for (int jump_um = 12100; jump_um < 60000; jump_um += 4000) { /* speed limit 12 m/s: 12 mm in a tick */
        struct bench b;
        bench_open(&b, NULL);
        bench_start(&b, 0, 0, 0.114);
        float force = (float)length(b.node.controller.instrument[0].coupling.force_N);
        assert_true(force == 0);
        for (int i = 0; i < SAFETY_IMPLAUSIBLE_TICKS; i++) {
            assert_int_equal(b.node.controller.instrument[0].safety.state, SAFETY_RUN);
            bench_tick(&b, 0, 0, 0.114 + 1e-6 * jump_um);
            assert_true(length(b.node.controller.instrument[0].coupling.force_N) == 0);
        }
        assert_int_equal(b.node.controller.instrument[0].safety.state, SAFETY_SAFE);
        assert_int_equal(b.node.controller.instrument[0].safety.reason, STATUS_LOOP_IMPLAUSIBLE);
        for (int i = 0; i < 400; i++) /* where it stands now is believed again, after the count of good samples */
            bench_tick(&b, 0, 0, 0.114 + 1e-6 * jump_um);
        bench_command(&b, 1);
        bench_tick(&b, 0, 0, 0.114 + 1e-6 * jump_um);
        assert_int_equal(b.node.controller.instrument[0].safety.state, SAFETY_READY);
        bench_close(&b);
    }
}

/* A device that drops out with the tool in the tissue and comes back there: after the host's two acknowledgements the
 * contact is found again along the shaft, and the force comes in over the decay's time constant, not at once. */
static void contact_is_found_again_after_a_dropout_inside_the_tissue(void **state)
{
    (void)state;
    struct bench b;
    bench_open(&b, NULL);
    bench_start(&b, 0, 0, 0.10);
    for (int i = 0; i <= 1000; i++)
        bench_tick(&b, 0, 0, 0.10 + 0.025 * i / 1000);
    double before = length(b.node.controller.contact.force_N[0]), last;
    unsigned contacts = b.node.controller.contact.count;
    for (int i = 0; i < 10; i++)
        bench_silent_tick(&b);
    for (int i = 0; i < 300; i++)
        bench_tick(&b, 0, 0, 0.125);
    assert_int_equal(b.node.controller.instrument[0].safety.state, SAFETY_SAFE);
    for (int k = 0; k < 2; k++) {
        bench_command(&b, 1);
        bench_tick(&b, 0, 0, 0.125);
    }
    assert_int_equal(b.node.controller.instrument[0].safety.state, SAFETY_RUN);
    last = length(b.node.controller.instrument[0].coupling.force_N);
    assert_true(last < 0.06 * before); /* 1 ms of 20 ms */
    for (int i = 0; i < 300; i++) {
        bench_tick(&b, 0, 0, 0.125);
        double now = length(b.node.controller.instrument[0].coupling.force_N);
        assert_true(now >= last - 1e-6 && now - last < 0.06 * before);
        last = now;
    }
    assert_int_equal(b.node.controller.contact.count, contacts);
    assert_true(fabs(last - before) < 1e-3 * before);
    bench_close(&b);
}

static void sliding_over_edges_changes_the_force_smoothly(void **state)
{
    (void)state;
    struct bench b;
    bench_open(&b, NULL); /* 162 vertices: 10 degrees between neighbouring faces */
    bench_start(&b, -0.1, 0, 0.10);
    for (int i = 0; i <= 500; i++)
        bench_tick(&b, -0.1, 0, 0.10 + 0.026 * i / 500);
    double worst = 0, mean = 0;
    float last[3];
    memcpy(last, b.node.controller.contact.force_N[0], sizeof last);
    for (int i = 0; i <= 4000; i++) {
        bench_tick(&b, -0.1 + 0.2 * i / 4000, 0.03 * sin(i / 500.0), 0.126);
        float change[3];
        for (int k = 0; k < 3; k++)
            change[k] = b.node.controller.contact.force_N[0][k] - last[k];
        memcpy(last, b.node.controller.contact.force_N[0], sizeof last);
        worst = fmax(worst, length(change));
        mean += length(last) / 4001;
    }
    printf("# mean force %.3f N, largest change in a tick %.4f N\n", mean, worst);
    /* 6.3 um of travel and up to 3 counts of 23 um a tick against at most the coupling's 1 kN/m: 0.08 N. */
    assert_true(worst < 0.08);
    assert_true(mean > 0.1);
    assert_int_equal(b.node.controller.collide.walks_cut, 0);
    bench_close(&b);
}

static void equal_inputs_give_equal_states_bit_for_bit(void **state)
{
    (void)state;
    struct bench *b = calloc(2, sizeof *b);
    for (int run = 0; run < 2; run++) {
        bench_open(&b[run], NULL);
        bench_start(&b[run], 0, 0, 0.10);
        random_state = 11;
        double q[3] = {0, 0, 0.118};
        for (int i = 0; i < 5000; i++) {
            for (int k = 0; k < 3; k++)
                q[k] += (k < 2 ? 1e-3 : 1e-4) * random_range(-1, 1);
            bench_tick(&b[run], q[0], q[1], q[2]);
        }
    }
    b[1].node.bank = b[0].node.bank;
    assert_memory_equal(&b[0].node, &b[1].node, sizeof b[0].node);
    bench_close(&b[0]);
    bench_close(&b[1]);
    free(b);
}

/* A bank that is far too stiff, far too soft, or regularised next to nothing: the force stays finite and bounded, and
 * the hand feels at most the virtual coupling. */
static void badly_scaled_banks_stay_bounded(void **state)
{
    (void)state;
    static const double young[] = {4, 4e3, 4e6, 4e12};
    for (unsigned e = 0; e < 4; e++) {
        struct bank_fixture_options o = bank_fixture_default;
        o.young_Pa = young[e];
        struct bench b;
        bench_open(&b, &o);
        bench_start(&b, 0, 0, 0.10);
        random_seed("scales", 12 + e);
        double q[3] = {0, 0, 0.10};
        for (int i = 0; i < 5000; i++) {
            q[0] = 0.2 * sin(i / 700.0), q[1] = 0.2 * cos(i / 500.0);
            q[2] = 0.118 + 0.015 * sin(i / 150.0);
            bench_tick(&b, q[0], q[1], q[2]);
            const struct controller *c = &b.node.controller;
            double deepest = 0;
            for (unsigned k = 0; k < c->contact.count; k++)
                deepest = fmax(deepest, c->contact.contact[k].depth_m);
            assert_true(isfinite(length(c->contact.force_N[0])));
            assert_true(length(c->instrument[0].coupling.force_N) <= 8.9 * 1.00001);
            /* proxy offset <= the deepest point's depth in the directions that push: |f| <= k * depth * sqrt(m) */
            assert_true(length(c->contact.force_N[0]) <= 1000 * deepest * sqrt(7) * 1.001 + 1e-6);
        }
        assert_int_equal(b.node.controller.instrument[0].safety.nonfinite, 0);
        bench_close(&b);
    }
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(torque_frame_is_jt_of_the_rendered_force),
        cmocka_unit_test(force_rises_with_depth_and_is_gone_after_retraction),
        cmocka_unit_test(a_silent_device_in_contact_lets_the_torque_decay_to_zero),
        cmocka_unit_test(a_lasting_jump_of_the_encoder_ends_in_safe_and_is_not_rendered),
        cmocka_unit_test(contact_is_found_again_after_a_dropout_inside_the_tissue),
        cmocka_unit_test(sliding_over_edges_changes_the_force_smoothly),
        cmocka_unit_test(equal_inputs_give_equal_states_bit_for_bit),
        cmocka_unit_test(badly_scaled_banks_stay_bounded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
