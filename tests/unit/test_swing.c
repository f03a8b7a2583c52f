/* Slow swing: a mode alone against its closed forms; on the whole path of the controller, rest against the static contact, a
 * quick press against inertia, let go against free swing; and modes that claim more than the compliance holds. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "random.h"
#include "tick_bench.h"

static const double PI = 3.14159265358979323846, TICK_S = 1e-3;

/* One mode: the whole body moves along z, carrying `share` of the compliance of a point. The coefficients are those of the
 * closed form over a tick, written down here a second time from z = g + fade (...). */
static struct bank_swing *one_mode(double frequency_Hz, double damping, double share, const float G[9])
{
    unsigned vertices = 162; /* of the fixture */
    struct bank_swing *b = calloc(1, sizeof *b + 12 * vertices);
    double w = 2 * PI * frequency_Hz, d = sqrt(1 - damping * damping), fade = exp(-damping * w * TICK_S);
    double c = cos(d * w * TICK_S), s = sin(d * w * TICK_S) / d, size = sqrt(share * (double)(G[0] + G[4] + G[8]) / 3);
    b->modes = 1;
    b->mode[0] = (struct bank_mode){.drive = (float)(1 - fade * (c + damping * s)),
                                    .glide = (float)(fade * s),
                                    .pull = (float)(fade * s),
                                    .drag = (float)(1 - fade * (c - damping * s))};
    b->mode[0].affine[11] = (float)size;
    for (unsigned v = 0; v < vertices; v++)
        ((float *)(b + 1))[3 * v + 2] = (float)size;
    return b;
}

static void fixture_block(float G[9])
{
    size_t length;
    struct bank_view view;
    unsigned char *bytes = bank_fixture(NULL, &length);
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
    bank_view_compliance(&view, 0, 0, G);
    free(bytes);
}

struct rig {
    struct bank_swing *swing;
    struct bench bench;
};

static void rig_open(struct rig *r, unsigned points, double frequency_Hz, double damping, double share)
{
    struct bank_fixture_options o = bank_fixture_default;
    float G[9];
    fixture_block(G);
    o.tip_points = points;
    r->swing = NULL;
    if (share > 0)
        o.swing = r->swing = one_mode(frequency_Hz, damping, share, G);
    bench_open(&r->bench, &o);
}

static void rig_close(struct rig *r)
{
    bench_close(&r->bench);
    free(r->swing);
}

static struct controller *controller(struct rig *r)
{
    return &r->bench.node.controller;
}

static void free_swing_follows_its_closed_form(void **state)
{
    (void)state;
    struct rig r;
    const double f = 1.3, damping = 0.05, w = 2 * PI * f, d = sqrt(1 - damping * damping);
    rig_open(&r, 7, f, damping, 0.3);
    bench_start(&r.bench, 0, 0, 0.11); /* above the body */
    controller(&r)->swing.amplitude[0] = 0.02f;
    double worst = 0;
    for (int i = 1; i <= 5000; i++) {
        bench_tick(&r.bench, 0, 0, 0.11);
        double t = i * TICK_S, exact = exp(-damping * w * t) * (cos(d * w * t) + damping / d * sin(d * w * t));
        worst = fmax(worst, fabs((double)controller(&r)->swing.amplitude[0] / 0.02 - exact));
    }
    printf("# six swings: off by at most %.1e of the first amplitude\n", worst);
    /* Each tick rounds z and w (2^-24 each, of at most 1) and repeats coefficients that are rounded to 2^-24 of theirs: phase and
     * decay drift by theta 2^-24 a tick, below 5000 * 2^-23 in all if nothing cancels. */
    assert_true(worst < 5000 * 0x1p-23);
    rig_close(&r);
}

/* Presses to `depth_m` below the top of the sphere within `ticks`, then holds for `hold`; the force then, and the largest. */
static double press(struct rig *r, double depth_m, int ticks, int hold, double *largest_N)
{
    struct bench *b = &r->bench;
    double from = 0.11, to = 0; /* the tip meets the sphere's top at that insertion */
    for (double reach = 0.1; reach < 0.23 && to == 0; reach += 1e-4) {
        float tip[3];
        for (int a = 0; a < 3; a++)
            tip[a] = b->bank.tools[0].trocar_m[a] + (float)reach * b->bank.tools[0].rotation[3 * a + 2];
        if (sqrt((double)tip[0] * tip[0] + (double)tip[1] * tip[1] + (double)tip[2] * tip[2]) < 0.05)
            to = reach + depth_m;
    }
    bench_start(b, 0, 0, from);
    *largest_N = 0;
    for (int i = 1; i <= ticks + hold; i++) {
        bench_tick(b, 0, 0, i < ticks ? from + (to - from) * i / ticks : to);
        const float *f = controller(r)->contact.force_N[0];
        *largest_N = fmax(*largest_N, sqrt((double)f[0] * f[0] + (double)f[1] * f[1] + (double)f[2] * f[2]));
        assert_int_equal(controller(r)->instrument[0].safety.state, SAFETY_RUN);
    }
    const float *f = controller(r)->contact.force_N[0];
    return sqrt((double)f[0] * f[0] + (double)f[1] * f[1] + (double)f[2] * f[2]);
}

static void held_for_long_the_force_is_the_static_one(void **state)
{
    (void)state;
    struct rig still, swings;
    double most_still, most_swings;
    rig_open(&still, 1, 0, 0, 0);
    rig_open(&swings, 1, 1.0, 0.3, 0.4);
    double at_rest = press(&still, 0.006, 150, 100, &most_still);
    double held = press(&swings, 0.006, 150, 12000, &most_swings);
    printf("# static %.5f N, with the mode %.5f N after 12 s, %.5f N at most\n", at_rest, held, most_swings);
    /* One point: with several, fewer of them stay in touch when the body has given way, which the static contact does not see.
     * What is left is how the normal turns under a point whose place on the body has changed by a part of the depth. */
    assert_true(fabs(held / at_rest - 1) < 1e-4);
    assert_true(most_still < 1.01 * at_rest);
    assert_true(most_swings > 1.1 * at_rest); /* the body's inertia: it gives way only later */
    assert_int_equal(controller(&swings)->swing.withheld, 0);
    rig_close(&still);
    rig_close(&swings);
}

static void let_go_the_body_swings_on(void **state)
{
    (void)state;
    struct rig r;
    double most;
    rig_open(&r, 7, 2.0, 0.1, 0.4);
    press(&r, 0.006, 150, 3000, &most);
    double before = (double)controller(&r)->swing.amplitude[0], low = 0, high = 0;
    for (int i = 0; i < 2000; i++) {
        bench_tick(&r.bench, 0, 0, 0.11);
        low = fmin(low, (double)controller(&r)->swing.amplitude[0]);
        high = fmax(high, (double)controller(&r)->swing.amplitude[0]);
    }
    printf("# pressed %.4f; let go it swings from %.4f to %.4f\n", before, low, high);
    assert_true(before < 0 && high > -0.5 * before); /* back through its rest: exp(-0.1 pi) of it, 0.73 */
    rig_close(&r);
}

/* A shape of three times what the compliance holds: what is left would be negative. */
static void modes_that_claim_too_much_are_withheld(void **state)
{
    (void)state;
    random_seed("swing", 31);
    struct rig r;
    rig_open(&r, 7, 1.5, 0.1, 9.0);
    bench_start(&r.bench, 0, 0, 0.11);
    double at = 0.11, most = 0;
    for (int i = 0; i < 20000; i++) {
        double speed = random_range(-2, 2);
        at = fmin(0.2, fmax(0.11, at + 1e-3 * speed));
        bench_tick(&r.bench, random_range(-0.01, 0.01), random_range(-0.01, 0.01), at);
        const struct controller *c = controller(&r);
        for (int a = 0; a < 3; a++) {
            assert_true(isfinite(c->contact.force_N[0][a]));
            most = fmax(most, fabs((double)c->contact.force_N[0][a]));
        }
        for (uint32_t k = 0; k < c->contact.count; k++)
            assert_true(c->contact.contact[k].pressure_N >= 0);
    }
    printf("# withheld in %u ticks; at most %.2f N\n", controller(&r)->swing.withheld, most);
    assert_true(controller(&r)->swing.withheld > 100);
    assert_int_equal(controller(&r)->instrument[0].safety.nonfinite, 0);
    rig_close(&r);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(free_swing_follows_its_closed_form),
        cmocka_unit_test(held_for_long_the_force_is_the_static_one),
        cmocka_unit_test(let_go_the_body_swings_on),
        cmocka_unit_test(modes_that_claim_too_much_are_withheld),
    };
    return cmocka_run_group_tests_name("swing", tests, NULL, NULL);
}
