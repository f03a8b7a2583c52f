/* Two instruments in one body: what each feels is its own, and what the other does to the tissue. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "tick_bench.h"

/* One controller on the fixture's sphere; the trocars are 2 cm apart above its top. */
struct rig {
    struct bench bench;
    uint8_t sequence[2];
    bool silent[2];
    double insertion_m[2];
};

static void rig_open(struct rig *r, unsigned instruments)
{
    struct bank_fixture_options o = bank_fixture_default;
    memset(r, 0, sizeof *r);
    o.instruments = instruments;
    bench_open(&r->bench, &o);
    r->insertion_m[0] = r->insertion_m[1] = 0.1;
}

static const struct controller *controller(const struct rig *r)
{
    return &r->bench.node.controller;
}

static void send(struct rig *r, unsigned t)
{
    struct wire_encoders m = bench_counts(&r->bench, 0, 0, r->insertion_m[t]);
    struct can_frame_t frame = bench_frame(WIRE_ENCODERS_ID + 1 + t, WIRE_ENCODERS_LENGTH);
    m.sequence = r->sequence[t]++ & 15;
    wire_encoders_pack(frame.data, &m);
    node_receive(&r->bench.node, &frame);
}

static void rig_tick(struct rig *r)
{
    struct can_frame_t frame;
    node_begin_tick(&r->bench.node);
    while (node_transmit(&r->bench.node, &frame)) {
    }
    for (unsigned t = 0; t < r->bench.bank.tool_count; t++)
        if (!r->silent[t])
            send(r, t);
    bench_finish(&r->bench);
}

static void command(struct rig *r, uint8_t word, uint8_t node)
{
    struct can_frame_t frame = bench_frame(WIRE_NMT_ID, WIRE_NMT_LENGTH);
    wire_nmt_pack(frame.data, &(struct wire_nmt){.command = word, .node = node});
    node_receive(&r->bench.node, &frame);
}

static void run(struct rig *r, unsigned ticks)
{
    for (unsigned i = 0; i < ticks; i++)
        rig_tick(r);
}

/* At rest above the body until both run. */
static void start(struct rig *r)
{
    run(r, SAFETY_READY_SAMPLES + 5);
    command(r, 1, 0);
    run(r, 150);
    for (unsigned t = 0; t < r->bench.bank.tool_count; t++)
        assert_int_equal(controller(r)->instrument[t].safety.state, SAFETY_RUN);
}

/* Slowly to these insertions, then until the force is steady. */
static void go(struct rig *r, double first_m, double second_m)
{
    const double from[2] = {r->insertion_m[0], r->insertion_m[1]}, to[2] = {first_m, second_m};
    for (int i = 1; i <= 100; i++) {
        for (int t = 0; t < 2; t++)
            r->insertion_m[t] = from[t] + 0.01 * i * (to[t] - from[t]);
        rig_tick(r);
    }
    run(r, 50);
}

static double size(const float v[3])
{
    return sqrt((double)v[0] * v[0] + (double)v[1] * v[1] + (double)v[2] * v[2]);
}

/* Up along the axis, which is what an instrument that presses straight down feels most of. */
static double force(const struct rig *r, unsigned t)
{
    return (double)controller(r)->contact.force_N[t][2];
}

static const double above = 0.112, deep = 0.127, shallow = 0.1255; /* the pole of the tip is 5 mm further */

static void unequal_loads_are_felt_unequally_and_equal_places_feel_the_other(void **state)
{
    (void)state;
    struct rig r;
    rig_open(&r, 2);
    start(&r);
    go(&r, deep, above);
    const double alone = force(&r, 0);
    assert_true(alone > 0.05 && size(controller(&r)->contact.force_N[1]) == 0);
    go(&r, deep, shallow);
    const double first = force(&r, 0), second = force(&r, 1);
    print_message("# deep alone %.3f N; deep %.3f N beside shallow %.3f N\n", alone, first, second);
    assert_true(first > 1.5 * second && second > 0.02);
    assert_true(first < 0.97 * alone); /* the other pushes the tissue away under it */
    /* Maxwell and Betti: what each feels of the other is the same compliance, so both felt less than alone */
    go(&r, above, shallow);
    const double second_alone = force(&r, 1);
    assert_true(second < 0.97 * second_alone);
    /* each hand gets its own torques, and nothing of the other's */
    go(&r, deep, shallow);
    for (unsigned t = 0; t < 2; t++) {
        const struct tick_output *out = &r.bench.node.instrument[t].output;
        const struct instrument *own = &controller(&r)->instrument[t];
        float effort[3], gravity[3];
        kinematics_efforts(&own->kinematics, &r.bench.bank.tools[t], controller(&r)->contact.force_N[t], effort);
        kinematics_gravity(&own->kinematics, &r.bench.bank.tools[t], gravity);
        assert_true(out->enable);
        for (int a = 0; a < 3; a++) /* at rest nothing but contact and weight is left */
            assert_true(fabs((double)(effort[a] + gravity[a] - out->torque[a])) < 2e-3);
    }
    bench_close(&r.bench);
}

/* The compliance between the two sets of contacts decides how they share: solved again here, in double, for the forces of all
 * contacts at once. */
static void the_forces_satisfy_one_system(void **state)
{
    (void)state;
    struct rig r;
    double worst = 0, crossed = 0;
    rig_open(&r, 2);
    start(&r);
    go(&r, deep, shallow + 0.002);
    const struct contact_set *s = &controller(&r)->contact;
    const struct bank_view *bank = &r.bench.bank;
    unsigned of[2] = {0, 0};
    for (uint32_t c = 0; c < s->count; c++) {
        const struct contact *at = &s->contact[c];
        double left = -(double)at->depth_m;
        of[at->tool]++;
        for (uint32_t d = 0; d < s->count; d++) {
            const struct contact *from = &s->contact[d];
            double moved = 0, same = at->tool == from->tool ? 1 / (double)bank->contact->coupling_stiffness_N_m : 0;
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) {
                    uint16_t row = bank->row_of[bank->triangles[at->triangle].vertex[i]];
                    uint16_t column = bank->row_of[bank->triangles[from->triangle].vertex[j]];
                    float G[9];
                    if (row == BANK_NONE || column == BANK_NONE)
                        continue;
                    bank_view_compliance(bank, row, column, G);
                    for (int a = 0; a < 3; a++)
                        for (int b = 0; b < 3; b++)
                            moved += (double)at->weights[i] * from->weights[j] * at->normal[a] * G[3 * a + b] *
                                     from->normal[b];
                }
            for (int a = 0; a < 3; a++)
                moved += same * at->normal[a] * from->normal[a];
            left += moved * from->pressure_N + (c == d ? (double)at->pad_m_N * from->pressure_N : 0);
            if (at->tool != from->tool)
                crossed = fmax(crossed, moved * from->pressure_N / (double)s->contact[0].depth_m);
        }
        if (at->pressure_N > 0)
            worst = fmax(worst, fabs(left) / at->depth_m);
        else
            assert_true(left > -1e-4 * at->depth_m);
    }
    print_message(
        "# %u and %u contacts, residual %.1e of the depth, the other adds up to %.0f %% of the depth of a point\n",
        of[0], of[1], worst, 100 * crossed);
    assert_true(of[0] > 1 && of[1] > 1);
    assert_true(worst < 1e-4); /* single precision of sums over 14 contacts */
    assert_true(crossed > 0.02);
    bench_close(&r.bench);
}

/* While the second keeps away from the body, the first has the same torques to the last bit as the only one. */
static void who_does_not_touch_changes_nothing(void **state)
{
    (void)state;
    struct rig one, two;
    rig_open(&one, 1);
    rig_open(&two, 2);
    start(&one);
    start(&two);
    for (int i = 0; i < 400; i++) {
        double depth = above + 0.015 * sin(0.01 * i) * sin(0.01 * i);
        one.insertion_m[0] = two.insertion_m[0] = depth;
        two.insertion_m[1] = 0.1 + 0.005 * sin(0.02 * i);
        rig_tick(&one);
        rig_tick(&two);
        assert_memory_equal(&one.bench.node.instrument[0].output, &two.bench.node.instrument[0].output,
                            sizeof one.bench.node.instrument[0].output);
    }
    bench_close(&one.bench);
    bench_close(&two.bench);
}

/* A silent device's tool stays where it was, then is forgotten; the other goes on without a break. */
static void a_silent_device_is_held_then_forgotten(void **state)
{
    (void)state;
    struct rig r;
    rig_open(&r, 2);
    start(&r);
    go(&r, deep, above);
    const double alone = force(&r, 0);
    go(&r, deep, shallow);
    const double beside = force(&r, 0);
    r.silent[1] = true;
    rig_tick(&r);
    assert_true(fabs(force(&r, 0) - beside) < 1e-6 * beside);
    assert_int_equal(controller(&r)->instrument[0].safety.missed, 0);
    run(&r, SAFETY_STALE_TICKS + 1);
    assert_true(fabs(force(&r, 0) - alone) < 1e-3 * alone);
    assert_true(size(controller(&r)->contact.force_N[1]) == 0);
    assert_int_equal(controller(&r)->instrument[0].safety.state, SAFETY_RUN);
    assert_int_equal(controller(&r)->instrument[1].safety.state, SAFETY_SAFE);
    assert_true(controller(&r)->second.alone > 0);
    r.silent[1] = false;
    run(&r, 200);
    assert_true(fabs(force(&r, 0) - beside) < 1e-3 * beside); /* found again where it is */
    assert_false(r.bench.node.instrument[1].output.enable);
    command(&r, 1, 2);
    run(&r, 5);
    command(&r, 1, 2);
    run(&r, 200);
    assert_int_equal(controller(&r)->instrument[1].safety.state, SAFETY_RUN);
    bench_close(&r.bench);
}

static void each_is_started_and_stopped_by_itself(void **state)
{
    (void)state;
    struct rig r;
    rig_open(&r, 2);
    run(&r, SAFETY_READY_SAMPLES + 5);
    command(&r, 1, 2);
    run(&r, 2);
    assert_int_equal(controller(&r)->instrument[0].safety.state, SAFETY_READY);
    assert_int_equal(controller(&r)->instrument[1].safety.state, SAFETY_RUN);
    command(&r, 1, 1);
    run(&r, 2);
    command(&r, 2, 2);
    run(&r, 200);
    assert_int_equal(controller(&r)->instrument[0].safety.state, SAFETY_RUN);
    assert_int_equal(controller(&r)->instrument[1].safety.state, SAFETY_SAFE);
    assert_true(r.bench.node.instrument[0].output.enable && !r.bench.node.instrument[1].output.enable);
    bench_close(&r.bench);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unequal_loads_are_felt_unequally_and_equal_places_feel_the_other),
        cmocka_unit_test(the_forces_satisfy_one_system),
        cmocka_unit_test(who_does_not_touch_changes_nothing),
        cmocka_unit_test(a_silent_device_is_held_then_forgotten),
        cmocka_unit_test(each_is_started_and_stopped_by_itself),
    };
    return cmocka_run_group_tests_name("second", tests, NULL, NULL);
}
