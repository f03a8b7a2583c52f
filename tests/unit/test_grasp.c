/* Grasping on the whole path of the controller: closing changes no force, a pull follows the closed form of the bank's compliance,
 * the set of contacts is kept, slip bounds the force, opening lets go, a grip near a threshold does not chatter. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "random.h"
#include "tick_bench.h"

/* Wide enough for the points beside the tip to push too. TOP_m: insertion at which the tip meets the fixture's sphere. */
static const double TIP_RADIUS_m = 0.01, TOP_m = 0.11;

struct rig {
    struct bench bench;
    double alpha, beta, at_m;
    unsigned grip;
};

static void rig_open(struct rig *r, unsigned points, double slip_N)
{
    struct bank_fixture_options o = bank_fixture_default;
    o.tip_points = points;
    o.grasp_slip_N = slip_N;
    o.tip_radius_m = TIP_RADIUS_m;
    o.grain_m = 0.003;
    *r = (struct rig){.at_m = 0.10};
    bench_open(&r->bench, &o);
    bench_start(&r->bench, 0, 0, r->at_m);
}

static struct controller *controller(struct rig *r)
{
    return &r->bench.node.controller;
}

static void rig_tick(struct rig *r)
{
    struct can_frame_t frame;
    struct bench *b = &r->bench;
    node_begin_tick(&b->node);
    while (node_transmit(&b->node, &frame)) {
    }
    struct wire_encoders sample = bench_counts(b, r->alpha, r->beta, r->at_m);
    sample.grip = (uint8_t)r->grip;
    bench_send_sample(b, sample);
    bench_finish(b);
    assert_int_equal(controller(r)->instrument[0].safety.state, SAFETY_RUN);
}

/* In `ticks`, to this insertion and these angles. */
static void go(struct rig *r, double at_m, double alpha, double beta, int ticks)
{
    double from[3] = {r->at_m, r->alpha, r->beta}, to[3] = {at_m, alpha, beta};
    for (int i = 1; i <= ticks; i++) {
        r->at_m = from[0] + (to[0] - from[0]) * i / ticks;
        r->alpha = from[1] + (to[1] - from[1]) * i / ticks;
        r->beta = from[2] + (to[2] - from[2]) * i / ticks;
        rig_tick(r);
    }
}

static void force(struct rig *r, double f[3])
{
    for (int a = 0; a < 3; a++)
        f[a] = (double)controller(r)->contact.force_N[0][a];
}

static double distance(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

static void closing_alone_changes_no_force(void **state)
{
    (void)state;
    const double none[3] = {0};
    for (unsigned points = 1; points <= 16; points += 5) {
        struct rig r;
        double before[3], after[3];
        rig_open(&r, points, 100);
        go(&r, TOP_m + 0.012, 0.01, -0.01, 100);
        for (int i = 0; i < 50; i++)
            rig_tick(&r);
        force(&r, before);
        r.grip = 63;
        for (int i = 0; i < 50; i++)
            rig_tick(&r);
        force(&r, after);
        assert_true(controller(&r)->grasp.taken > 0);
        printf("# %u points: %.4f N, closing changes it by %.1e of it\n", points, distance(before, none),
               distance(before, after) / distance(before, none));
        /* the solver stops when no force moves by more than 1e-4 of the largest */
        assert_true(distance(before, after) < (double)CONE_TOLERANCE * distance(before, none));
        bench_close(&r.bench);
    }
}

/* One point held: f = (W G W + I / k + epsilon I)^-1 (from - x), whatever the direction, pulls included. */
static void a_pull_follows_the_compliance_of_the_bank(void **state)
{
    (void)state;
    struct rig r;
    rig_open(&r, 1, 100);
    go(&r, TOP_m + 0.004, 0.02, 0.03, 100);
    r.grip = 63;
    rig_tick(&r);
    const struct grasp_point *h = &controller(&r)->grasp.point[0];
    const struct bank_view *bank = &r.bench.bank;
    assert_true(h->held);
    double A[3][3] = {{0}}, worst = 0, pulled = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            float G[9];
            const uint16_t *v = bank->triangles[h->triangle].vertex;
            bank_view_compliance(bank, bank->row_of[v[i]], bank->row_of[v[j]], G);
            for (int e = 0; e < 9; e++)
                A[e / 3][e % 3] += (double)h->weights[i] * h->weights[j] * G[e];
        }
    double own = (A[0][0] + A[1][1] + A[2][2]) / 3 / (double)bank->contact->typical_compliance_m_N;
    for (int a = 0; a < 3; a++)
        A[a][a] += fmax(own, 1) * (double)bank->contact->regularisation_m_N +
                   1 / (double)bank->contact->coupling_stiffness_N_m;
    random_seed("pull", 41);
    for (int n = 0; n < 40; n++) {
        go(&r, TOP_m + random_range(-0.01, 0.006), random_range(-0.05, 0.05), random_range(-0.05, 0.05), 60);
        double f[3], none[3] = {0}, asked[3], size = 0, off = 0;
        force(&r, f);
        for (int a = 0; a < 3; a++) {
            asked[a] = (double)h->from_m[a] - (double)controller(&r)->collide.point[0].position_m[a];
            double back = A[a][0] * f[0] + A[a][1] * f[1] + A[a][2] * f[2];
            off += pow(back - asked[a], 2);
            size += pow(asked[a], 2);
        }
        worst = fmax(worst, sqrt(off / size));
        pulled = fmin(pulled, f[2]);
        assert_true(distance(f, none) > 0);
    }
    printf("# A f against what is asked: off by at most %.1e; strongest pull %.3f N\n", worst, pulled);
    /* from_m and x are rounded to 2^-24 of 0.05 m, of differences above 1 mm: 6e-6; the solve adds some 1e-6 */
    assert_true(worst < 2e-5);
    assert_true(pulled < -0.05);
    bench_close(&r.bench);
}

static void the_set_is_kept_while_the_jaws_are_closed(void **state)
{
    (void)state;
    struct rig r;
    rig_open(&r, 7, 100);
    go(&r, TOP_m + 0.012, 0, 0, 100);
    r.grip = 63;
    rig_tick(&r);
    struct grasp_point held[CONTACT_MAX];
    memcpy(held, controller(&r)->grasp.point, sizeof held);
    unsigned count = 0;
    for (int i = 0; i < CONTACT_MAX; i++)
        count += held[i].held;
    assert_true(count >= 3);
    go(&r, TOP_m - 0.012, 0.1, 0.05, 300); /* 12 mm above where the surface was at rest */
    for (int i = 0; i < CONTACT_MAX; i++) {
        const struct grasp_point *now = &controller(&r)->grasp.point[i];
        assert_int_equal(now->held, held[i].held);
        if (now->held) {
            assert_int_equal(now->triangle, held[i].triangle);
            assert_memory_equal(now->weights, held[i].weights, sizeof now->weights);
        }
    }
    assert_true(controller(&r)->contact.count >= count);
    assert_true(controller(&r)->contact.force_N[0][2] < 0); /* the tissue pulls the tool back */
    r.grip = 0;
    rig_tick(&r);
    const double none[3] = {0};
    double f[3];
    force(&r, f);
    assert_true(distance(f, none) == 0); /* above the surface nothing is left of it */
    assert_int_equal(controller(&r)->contact.count, 0);
    bench_close(&r.bench);
}

static void slip_bounds_what_a_point_holds(void **state)
{
    (void)state;
    const double slip_N = 0.1;
    struct rig r;
    rig_open(&r, 7, slip_N);
    go(&r, TOP_m + 0.004, 0, 0, 100);
    r.grip = 63;
    rig_tick(&r);
    double most = 0, step_m = 0.03 / 400;
    for (int i = 0; i < 400; i++) {
        go(&r, r.at_m - step_m, 0, 0, 1);
        for (unsigned c = 0; c < controller(&r)->contact.count; c++)
            most = fmax(most, (double)controller(&r)->contact.contact[c].pressure_N);
    }
    printf("# most that a point holds %.4f N of %.1f N, %u slips\n", most, slip_N, controller(&r)->grasp.slips);
    assert_true(controller(&r)->grasp.slips > 0);
    /* over by what one tick's motion adds before the hold follows: at most the coupling's stiffness times the step */
    assert_true(most <= slip_N + (double)r.bench.bank.contact->coupling_stiffness_N_m * step_m);
    bench_close(&r.bench);
}

static void a_grip_between_the_thresholds_changes_nothing(void **state)
{
    (void)state;
    struct rig r;
    rig_open(&r, 7, 100);
    go(&r, TOP_m + 0.012, 0, 0, 100);
    for (int i = 0; i < 20; i++) {
        r.grip = 26 + (unsigned)(i % 12); /* above the one, below the other */
        rig_tick(&r);
        assert_int_equal(controller(&r)->grasp.taken, 0);
    }
    r.grip = 38;
    rig_tick(&r);
    uint32_t taken = controller(&r)->grasp.taken;
    assert_true(taken > 0);
    for (int i = 0; i < 20; i++) {
        r.grip = 26 + (unsigned)(i % 38);
        rig_tick(&r);
        assert_true(controller(&r)->grasp.jaws[0].closed);
    }
    assert_int_equal(controller(&r)->grasp.taken, taken);
    bench_close(&r.bench);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closing_alone_changes_no_force),
        cmocka_unit_test(a_pull_follows_the_compliance_of_the_bank),
        cmocka_unit_test(the_set_is_kept_while_the_jaws_are_closed),
        cmocka_unit_test(slip_bounds_what_a_point_holds),
        cmocka_unit_test(a_grip_between_the_thresholds_changes_nothing),
    };
    return cmocka_run_group_tests_name("grasp", tests, NULL, NULL);
}
