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
#include "real.h"
#include "tick_bench.h"

/* Of the problem at hand (cone_fixture.h). */
static float block[CONTACT_PAIRS][9];
static const float (*const blocks)[9] = (const float (*)[9])block;

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
        cone_problem_round(&p, &s, block);
        for (unsigned c = 0; c < s.count; c++) /* anything may be left of the last tick */
            for (int a = 0; a < 3; a++)
                s.contact[c].force_N[a] = (float)random_range(-1, 1);
        for (unsigned k = 0; k < 6; k++) {
            again = s;
            cone_solve(&again, blocks, sweeps[k]);
            assert_true(again.sweeps <= sweeps[k]);
            worst = fmax(worst, outside(&again, p.mu));
        }
    }
    printf("# outside the cone by at most %.1e of the normal force\n", worst);
    assert_true(worst < 4e-6); /* frame and force are rounded to 2^-24, some ten times */
}

/* Resultant of the forces, and of the reference. */
static double resultant_error(const struct cone_system *s, const double *f)
{
    double off = 0, size = 0;
    for (int a = 0; a < 3; a++) {
        double sum = 0, wanted = 0;
        for (unsigned c = 0; c < s->count; c++) {
            sum += s->contact[c].force_N[a];
            wanted += f[3 * c + a];
        }
        off += (sum - wanted) * (sum - wanted);
        size += wanted * wanted;
    }
    return sqrt(off / size);
}

/* A tool that presses 5 mm deep, then drags, 0.3 mm a tick at most: every tick starts from the forces of the one before. */
static void the_error_left_by_a_bound_of_sweeps_is_small_on_a_stroke(void **state)
{
    (void)state;
    random_seed("sweeps", 22);
    static const unsigned sweeps[] = {2, 5, 10, 20};
    enum { STROKES = 12, TICKS = 60, POINTS = 10 };
    double worst[4] = {0}, mean[4] = {0}, failure = 0;
    for (int n = 0; n < STROKES; n++) {
        struct cone_problem p;
        static struct cone_system s[4];
        double push[3] = {random_range(-2e-4, 2e-4), random_range(-2e-4, 2e-4), 0};
        cone_problem_random(&p, POINTS, 0.2, 0.005, 0);
        for (int k = 0; k < 4; k++)
            cone_problem_round(&p, &s[k], block);
        for (int tick = 0; tick < TICKS; tick++) {
            double f[CONE_UNKNOWNS];
            push[2] = tick < TICKS / 2 ? 2e-4 : 0;
            for (unsigned c = 0; c < p.m; c++)
                for (int a = 0; a < 3; a++) {
                    float *wanted = &s[0].contact[c].wanted_m[a];
                    *wanted += (float)((tick < TICKS / 2) == (a == 2) ? push[a] : 0);
                    p.d[3 * c + a] = (double)*wanted;
                    for (int k = 1; k < 4; k++)
                        s[k].contact[c].wanted_m[a] = *wanted;
                }
            bool ask = tick % 6 == 5;
            if (ask)
                failure = fmax(failure, cone_reference(&p, f));
            for (int k = 0; k < 4; k++) {
                cone_solve(&s[k], blocks, sweeps[k]);
                double error = ask ? resultant_error(&s[k], f) : 0;
                worst[k] = fmax(worst[k], error);
                mean[k] += error / (STROKES * TICKS / 6);
            }
        }
    }
    printf("# the reference fails Coulomb's law by %.1e m at most\n", failure);
    for (unsigned k = 0; k < 4; k++)
        printf("# at most %2u sweeps a tick: force off by %.1e, %.1e on average\n", sweeps[k], worst[k], mean[k]);
    assert_true(failure < 1e-8);
    assert_true(worst[3] < 1e-2 && mean[3] < 1e-3); /* a hand tells forces apart by some 7 % */
    assert_true(mean[0] > mean[3]);
}

/* Swept until at rest, against ADMM in double: forces of 0.1 to 3 N in single precision with condition numbers to 1e4. */
static void forces_at_rest_are_those_of_another_method(void **state)
{
    (void)state;
    random_seed("converged", 23);
    double worst = 0, failure = 0;
    for (int n = 0; n < 150; n++) {
        struct cone_problem p;
        static struct cone_system s;
        double f[CONE_UNKNOWNS];
        cone_problem_random(&p, 1 + random_below(16), random_range(0.02, 1), 0.005, random_range(1e-3, 0.01));
        cone_problem_round(&p, &s, block);
        failure = fmax(failure, cone_reference(&p, f));
        for (int k = 0; k < 40; k++)
            cone_solve(&s, blocks, BANK_MAX_SWEEPS);
        double error = resultant_error(&s, f);
        worst = fmax(worst, error);
    }
    printf("# resultant against ADMM: %.1e relative; which fails Coulomb's law by %.1e m\n", worst, failure);
    assert_true(worst < 2e-3 && failure < 1e-8);
}

static void without_friction_the_forces_are_those_of_the_frictionless_solver(void **state)
{
    (void)state;
    random_seed("frictionless", 24);
    double worst = 0;
    for (int n = 0; n < 500; n++) {
        struct cone_problem p;
        static struct cone_system s;
        float A[CONTACT_MAX][CONTACT_MAX], d[CONTACT_MAX], pressure[CONTACT_MAX];
        double sum = 0, wanted = 0;
        cone_problem_random(&p, 1 + random_below(16), 0, 0.005, random_range(1e-3, 0.01));
        cone_problem_round(&p, &s, block);
        for (unsigned c = 0; c < p.m; c++) {
            d[c] = 0;
            for (int a = 0; a < 3; a++)
                d[c] += (float)(p.n[c][a] * p.d[3 * c + a]);
            for (unsigned e = 0; e < p.m; e++) {
                double entry = 0;
                for (int a = 0; a < 9; a++)
                    entry += p.n[c][a / 3] * p.A[3 * c + a / 3][3 * e + a % 3] * p.n[e][a % 3];
                A[c][e] = (float)entry;
            }
        }
        uint32_t active = 0;
        bool cut;
        contact_solve((const float(*)[CONTACT_MAX])A, d, p.m, CONTACT_MAX_FACTORS, &active, pressure, &cut);
        assert_false(cut);
        for (int k = 0; k < 40; k++)
            cone_solve(&s, blocks, BANK_MAX_SWEEPS);
        for (unsigned c = 0; c < p.m; c++) {
            sum += (double)pressure[c];
            for (int a = 0; a < 3; a++)
                wanted += (double)s.contact[c].force_N[a] * s.contact[c].frame[0][a];
        }
        worst = fmax(worst, fabs(sum - wanted) / fmax(sum, 0.01));
    }
    printf("# sum of the pressures: %.1e relative\n", worst);
    assert_true(worst < 2e-3);
}

static void a_held_contact_has_no_cone(void **state)
{
    (void)state;
    random_seed("held", 25);
    for (int n = 0; n < 200; n++) {
        struct cone_problem p;
        static struct cone_system s;
        double f[3];
        cone_problem_random(&p, 1, 0.2, 0.005, 0.005);
        p.d[2] = -p.d[2]; /* pulls */
        cone_problem_round(&p, &s, block);
        s.contact[0].mu = CONE_HELD;
        cone_solve(&s, blocks, 1);
        for (int a = 0; a < 3; a++) { /* A f = d */
            f[a] = 0;
            for (int b = 0; b < 3; b++)
                f[a] += p.A[a][b] * s.contact[0].force_N[b];
            assert_true(fabs(f[a] - p.d[a]) < 1e-5 * 0.01);
        }
        assert_int_equal(s.contact[0].state, CONE_STICK);
    }
}

/* A body so large that its surface is flat under the tool, touched by one point, so that pressing does not push sideways. The
 * tissue's tangential compliance there and the coupling's 1/k are the two springs in series. */
static void flat(struct bench *b, double mu)
{
    struct bank_fixture_options o = bank_fixture_default;
    o.radius_m = 20;
    o.subdivisions = 3;
    o.shear = 0;
    o.grain_m = 0.01;
    o.tip_points = 1;
    o.friction_mu = mu;
    bench_open(b, &o);
}

static const struct controller *at(const struct bench *b)
{
    return &b->node.controller;
}

/* Stick, slip, turn back: force against way of the tool, by the closed form of a spring behind a slider. */
static void a_point_on_a_flat_body_sticks_and_slips_as_a_spring_behind_a_slider(void **state)
{
    (void)state;
    const double mu = 0.3;
    struct bench b;
    flat(&b, mu);
    bench_start(&b, 0, 0, 0.10);
    int tick = 0;
    for (; tick < 1000; tick++)
        bench_tick(&b, 0, 0, 0.10 + 0.022 * tick / 1000);
    assert_int_equal(at(&b)->contact.count, 1);
    double A[6], x0 = at(&b)->collide.point[0].position_m[0], worst = 0, f = 0, way = 0, slider = 0, most = 0;
    double normal = at(&b)->contact.contact[0].pressure_N;
    for (int k = 0; k < 6; k++)
        A[k] = at(&b)->cone.system.contact[0].local[k];
    /* the world's x is tangential; its compliance from the local frame, whose tangents are not the world's */
    const float(*frame)[3] = at(&b)->cone.system.contact[0].frame;
    double t1 = frame[1][0], t2 = frame[2][0];
    double compliance = A[3] * t1 * t1 + 2 * A[4] * t1 * t2 + A[5] * t2 * t2;
    assert_true(normal > 0.05);
    double loop[2] = {0, 0}, before_f = 0, before_x = 0;
    double lift = 0, depth = at(&b)->contact.contact[0].depth_m, farthest = 0;
    int passes = 0;
    const double amplitude = 0.08;
    for (int k = 0; k < 6000; k++) {
        double phase = k / 1000.0;
        double angle = amplitude * (phase < 1 ? phase : phase < 3 ? 2 - phase : phase < 5 ? phase - 4 : 6 - phase);
        bench_tick(&b, angle, 0, 0.122 / cos(angle) + lift);
        const struct contact *c = &at(&b)->contact.contact[0];
        lift += 0.3 * (depth - c->depth_m); /* the body's facets slope a little: a hand that keeps the depth */
        way = at(&b)->collide.point[0].position_m[0] - x0;
        f = at(&b)->contact.force_N[0][0];
        normal = c->pressure_N;
        /* the slider follows so that the spring never pulls more than mu p */
        double bound = mu * normal * compliance;
        slider = fmin(fmax(slider, way - bound), way + bound);
        worst = fmax(worst, fabs(f + (way - slider) / compliance));
        most = fmax(most, fabs(f));
        farthest = fmax(farthest, way);
        if (k >= 1000 && k < 5000) { /* one closed loop, from end to end */
            loop[0] += -0.5 * (f + before_f) * (way - before_x);
            passes++;
        }
        before_f = f;
        before_x = way;
    }
    /* Area of the loop: slipping at mu p over 4 (a - s), s the way that the spring takes. */
    double s = mu * normal * compliance;
    loop[1] = 4 * mu * normal * (farthest - s);
    printf("# spring %.1f N/m, slips at %.4f N of %.4f N; off by %.1e N; loop %.3e J of %.3e J\n", 1 / compliance, most,
           mu * normal, worst, loop[0], loop[1]);
    assert_true(passes == 4000 && farthest > 2 * s);
    assert_true(fabs(most - mu * normal) < 0.02 * mu * normal);
    /* a count of the encoder is 15 um; the weights on the vertices, and so the compliance, change along the way */
    assert_true(worst < 0.03 * mu * normal);
    assert_true(fabs(loop[0] - loop[1]) < 0.03 * loop[1]);
    bench_close(&b);
}

/* A tool at rest on the side of a body, with encoders that flicker by a count: the contact neither creeps nor fades. */
static void a_resting_contact_does_not_creep(void **state)
{
    (void)state;
    random_seed("creep", 26);
    struct bank_fixture_options o = bank_fixture_default;
    o.friction_mu = 0.3;
    struct bench b;
    bench_open(&b, &o);
    bench_start(&b, 0, 0, 0.10);
    for (int i = 0; i < 1000; i++)
        bench_tick(&b, 0.03 * i / 1000, 0, 0.10 + 0.025 * i / 1000);
    for (int i = 0; i < 100; i++)
        bench_tick(&b, 0.03, 0, 0.125);
    float first[3], off = 0;
    memcpy(first, at(&b)->contact.force_N[0], sizeof first);
    for (int i = 0; i < 20000; i++) {
        bench_tick(&b, 0.03 + 1.2e-4 * random_below(2), 1.2e-4 * random_below(2), 0.125);
        if (i % 1000 == 999)
            bench_tick(&b, 0.03, 0, 0.125);
    }
    for (int i = 0; i < 10; i++)
        bench_tick(&b, 0.03, 0, 0.125);
    for (int a = 0; a < 3; a++)
        off = fmaxf(off, fabsf(at(&b)->contact.force_N[0][a] - first[a]));
    printf("# after 20000 ticks of flicker the force is off by %.1e N of %.2f N\n", (double)off,
           sqrt((double)real_dot(first, first)));
    /* The flicker itself is some 15 um of way: at most what one count moves the force, 15 um times a stiffness of 60 N/m. */
    assert_true(off < 2e-3f);
    bench_close(&b);
}

/* A random motion in and along a curved body: the energy that the hand has put in never falls below what the tissue may give
 * back, so a closed way takes energy. */
static void no_closed_way_gives_energy(void **state)
{
    (void)state;
    random_seed("energy", 27);
    double least = INFINITY, most = 0;
    for (int way = 0; way < 12; way++) {
        struct bank_fixture_options o = bank_fixture_default;
        o.friction_mu = random_range(0.05, 0.8);
        o.tip_points = 1 + random_below(7);
        struct bench b;
        bench_open(&b, &o);
        bench_start(&b, 0, 0, 0.10);
        double p1 = random_range(150, 600), p2 = random_range(150, 600), p3 = random_range(200, 800);
        double energy = 0, taken = 0;
        float tip[3], force[3];
        memcpy(tip, at(&b)->instrument[0].kinematics.tip_m, sizeof tip);
        memset(force, 0, sizeof force);
        for (int i = 0; i < 6000; i++) {
            double in = 0.5 - 0.5 * cos(2 * 3.14159265358979 * i / 6000);
            bench_tick(&b, 0.12 * in * sin(i / p1), 0.12 * in * sin(i / p2),
                       0.10 + in * (0.024 + 0.004 * sin(i / p3))); /* to 13 mm deep on a radius of 50 mm */
            const float *now = at(&b)->contact.force_N[0], *to = at(&b)->instrument[0].kinematics.tip_m;
            for (int a = 0; a < 3; a++) {
                energy -= 0.5 * (double)(now[a] + force[a]) * (double)(to[a] - tip[a]);
                tip[a] = to[a];
                force[a] = now[a];
            }
            taken = fmax(taken, energy);
        }
        assert_int_equal(at(&b)->contact.count, 0); /* out again: whatever was stored has come back */
        least = fmin(least, energy / taken);
        most = fmax(most, taken);
        bench_close(&b);
    }
    printf("# of up to %.1e J put in, at least %.2f stays\n", most, least);
    assert_true(least > 0);
}

/* With mu next to nothing the whole path gives the torques of the bank without friction. */
static void next_to_no_friction_is_the_frictionless_path(void **state)
{
    (void)state;
    struct bank_fixture_options o = bank_fixture_default, none = bank_fixture_default;
    static struct bench with, without;
    o.friction_mu = 1e-7;
    o.friction_sweeps = BANK_MAX_SWEEPS;
    bench_open(&with, &o);
    bench_open(&without, &none);
    bench_start(&with, -0.1, 0, 0.10);
    bench_start(&without, -0.1, 0, 0.10);
    double worst = 0, peak = 0;
    for (int i = 0; i < 4000; i++) {
        double in = 0.10 + 0.026 * fmin(1, i / 500.0);
        bench_tick(&with, -0.1 + 0.2 * i / 4000, 0.03 * sin(i / 500.0), in);
        bench_tick(&without, -0.1 + 0.2 * i / 4000, 0.03 * sin(i / 500.0), in);
        for (int a = 0; a < 3; a++) {
            worst = fmax(worst, fabs((double)at(&with)->contact.force_N[0][a] - at(&without)->contact.force_N[0][a]));
            peak = fmax(peak, fabs((double)at(&without)->contact.force_N[0][a]));
        }
    }
    printf("# off by %.1e N of %.2f N\n", worst, peak);
    assert_true(worst < 2e-3 * peak);
    bench_close(&with);
    bench_close(&without);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_force_is_in_its_cone_after_any_number_of_sweeps),
        cmocka_unit_test(the_error_left_by_a_bound_of_sweeps_is_small_on_a_stroke),
        cmocka_unit_test(forces_at_rest_are_those_of_another_method),
        cmocka_unit_test(without_friction_the_forces_are_those_of_the_frictionless_solver),
        cmocka_unit_test(a_held_contact_has_no_cone),
        cmocka_unit_test(a_point_on_a_flat_body_sticks_and_slips_as_a_spring_behind_a_slider),
        cmocka_unit_test(a_resting_contact_does_not_creep),
        cmocka_unit_test(no_closed_way_gives_energy),
        cmocka_unit_test(next_to_no_friction_is_the_frictionless_path),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
