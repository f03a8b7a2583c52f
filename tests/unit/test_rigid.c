/* Rigid contact on the whole path of the controller: forces against closed forms, virtual work, sides that are kept at any speed,
 * energy in closed paths. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "rigid_fixture.h"

static const double FAR_m[3] = {0.3, 0, 0}; /* of the body */
static const double DOWN[3] = {0, 0, -1};

static void above(double height_m, double out[3])
{
    out[0] = FAR_m[0];
    out[1] = FAR_m[1];
    out[2] = FAR_m[2] + height_m;
}

static double stiffness(const struct rigid_rig *r)
{
    return (double)r->bank.contact->coupling_stiffness_N_m;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void shaft(const struct rigid_rig *r, unsigned t, double axis[3])
{
    for (int k = 0; k < 3; k++)
        axis[k] = (double)r->c.instrument[t].kinematics.frame[3 * k + 2];
}

/* A ball of radius R - shaft beside the shaft, its centre D from the trocar: the proxy's axis stays on a cone of half the opening
 * asin(R / D) around the centre, so the tip force is k L sin(asin(R / D) - angle), square to the cone. */
static void a_ball_stops_the_shaft_with_the_force_of_the_lever(void **state)
{
    (void)state;
    random_seed("lever", 60);
    double worst = 0, strongest = 0;
    for (int n = 0; n < 200; n++) {
        struct rigid_rig r;
        struct rigid_section section = rig_section();
        double trocar[3], ball[1][3], radius = random_range(0.002, 0.006), away = random_range(0.06, 0.11);
        above(0.1, trocar);
        for (int k = 0; k < 3; k++)
            ball[0][k] = trocar[k] + away * DOWN[k];
        ball[0][0] += random_range(-0.01, 0.01), ball[0][1] += random_range(-0.01, 0.01);
        rig_obstacle(&section, 1, (const double(*)[3])ball, radius);
        struct bank_tool tool = rig_tool(trocar, DOWN, RIG_SHAFT_m);
        rig_open(&r, 1, &tool, &section);

        double q[2], to[3], axis[3], f[3], out[3];
        double L = random_range(0.15, 0.19), turn = random_range(-1, 1), deep = random_range(0.3, 0.9);
        for (int k = 0; k < 3; k++)
            to[k] = ball[0][k] - trocar[k];
        double D = rig_length(to), opening = asin((radius + RIG_SHAFT_m) / D);
        rig_aim(&r, 0, ball[0], q);
        double aside[2] = {-cos(turn), -sin(turn)}; /* in joints: to the side from which it comes */
        r.joint[0][0] = q[0] + 1.2 * opening * aside[0];
        r.joint[0][1] = q[1] + 1.2 * opening * aside[1];
        r.joint[0][2] = L;
        rig_tick(&r);
        rig_force(&r, 0, f);
        assert_true(rig_length(f) == 0);
        rig_go(&r, 0, q[0] + deep * opening * aside[0], q[1] + deep * opening * aside[1], L, 100);
        for (int i = 0; i < 100; i++)
            rig_tick(&r);
        shaft(&r, 0, axis);
        rig_force(&r, 0, f);
        rig_unit(to);
        double cosine = dot(axis, to), angle = acos(fmin(1, cosine)), bent = opening - angle;
        double expected =
            stiffness(&r) / (1 + (double)RIGID_GIVE) * (double)r.c.instrument[0].kinematics.joint[2] * sin(bent);
        for (int k = 0; k < 3; k++)
            out[k] = axis[k] - cosine * to[k];
        rig_unit(out);
        for (int k = 0; k < 3; k++) /* square to the proxy's axis, which is at the cone's opening */
            out[k] = cos(opening) * out[k] - sin(opening) * to[k];
        assert_true(bent > 0);
        strongest = fmax(strongest, rig_length(f));
        for (int k = 0; k < 3; k++)
            f[k] -= expected * out[k];
        /* the proxy sinks in by RIGID_GIVE of `bent`, and its axis is turned by as much; what convex.h says of a distance,
         * by the lever */
        double rounding = 3e-7 * L / away * stiffness(&r);
        worst = fmax(worst, rig_length(f) / (expected * (double)RIGID_GIVE * bent + rounding));
        rig_close(&r);
    }
    printf("# up to %.1f N; off by at most %.2f of what is allowed\n", strongest, worst);
    assert_true(strongest > 5);
    assert_true(worst < 1);
}

/* Two instruments that cross: their trocars on two sides of the crossing, `height_m` above each other there. */
static void crossing(struct bank_tool tool[2], double height_m)
{
    double trocar[2][3] = {{FAR_m[0] - 0.09, FAR_m[1], FAR_m[2]}, {FAR_m[0], FAR_m[1] - 0.07, FAR_m[2] + height_m}};
    const double axis[2][3] = {{1, 0, 0}, {0, 1, 0}};
    for (int t = 0; t < 2; t++)
        tool[t] = rig_tool(trocar[t], axis[t], RIG_SHAFT_m);
}

/* Where the instrument's point at this share of its length is, by its joints, in double precision. */
static void along(const struct bank_tool *tool, const double q[3], double share, double out[3])
{
    double v[3] = {sin(q[0]), sin(q[1]), 0};
    v[2] = sqrt(1 - v[0] * v[0] - v[1] * v[1]);
    for (int k = 0; k < 3; k++) {
        out[k] = (double)tool->trocar_m[k];
        for (int i = 0; i < 3; i++)
            out[k] += share * q[2] * (double)tool->rotation[3 * k + i] * v[i];
    }
}

/* What the tip force does along the joints is what one force, equal and opposite on the two, does at one place where their shafts
 * touch: from the joints alone, with the place and the force as unknowns. */
static void two_shafts_feel_one_force_equal_and_opposite(void **state)
{
    (void)state;
    random_seed("pair", 61);
    double worst = 0, weakest = INFINITY, most_unequal = 1;
    for (int n = 0; n < 100; n++) {
        struct rigid_rig r;
        struct rigid_section section = rig_section();
        struct bank_tool tool[2];
        crossing(tool, 0.012);
        rig_open(&r, 2, tool, &section);
        double L[2] = {random_range(0.13, 0.19), random_range(0.11, 0.19)}, f[2][3], place[2][3], q[2][3], n_m[3];
        for (int t = 0; t < 2; t++)
            r.joint[t][2] = L[t];
        rig_tick(&r);
        /* bring them together by what makes them meet and some millimetres, turned about a little */
        double turn[2] = {random_range(-0.15, 0.15), random_range(-0.15, 0.15)};
        rig_go(&r, 0, turn[0], 0, L[0], 100);
        rig_go(&r, 1, turn[1], 0, L[1], 100);
        for (int t = 0; t < 2; t++) { /* whichever joint moves along z */
            double up[3], down[3], j[3] = {turn[t], 0.01, L[t]};
            along(&tool[t], j, 1, up);
            j[1] = -0.01;
            along(&tool[t], j, 1, down);
            bool by_beta = fabs(up[2] - down[2]) > 1e-3;
            assert_true(by_beta);
            double sign = (up[2] > down[2]) == (t == 0) ? 1 : -1;
            rig_go(&r, t, turn[t], sign * random_range(0.05, 0.08), L[t], 100);
        }
        for (int i = 0; i < 100; i++)
            rig_tick(&r);
        for (int t = 0; t < 2; t++) {
            rig_force(&r, t, f[t]);
            for (int i = 0; i < 3; i++)
                q[t][i] = (double)r.c.instrument[t].kinematics.joint[i];
            weakest = fmin(weakest, rig_length(f[t]));
        }
        /* The proxies: device and force / k. They touch: the common perpendicular of their axes is the sum of the radii long. */
        double at[2][3], axis[2][3], lever[2];
        for (int t = 0; t < 2; t++) {
            along(&tool[t], q[t], 1, at[t]);
            for (int k = 0; k < 3; k++)
                axis[t][k] = at[t][k] + f[t][k] / stiffness(&r) - (double)tool[t].trocar_m[k];
        }
        n_m[0] = axis[0][1] * axis[1][2] - axis[0][2] * axis[1][1];
        n_m[1] = axis[0][2] * axis[1][0] - axis[0][0] * axis[1][2];
        n_m[2] = axis[0][0] * axis[1][1] - axis[0][1] * axis[1][0];
        rig_unit(n_m);
        double w[3], a = dot(axis[0], axis[0]), b = dot(axis[0], axis[1]), c = dot(axis[1], axis[1]);
        for (int k = 0; k < 3; k++)
            w[k] = (double)tool[0].trocar_m[k] - (double)tool[1].trocar_m[k];
        lever[0] = (b * dot(axis[1], w) - c * dot(axis[0], w)) / (a * c - b * b);
        lever[1] = (a * dot(axis[1], w) - b * dot(axis[0], w)) / (a * c - b * b);
        assert_true(lever[0] > 0 && lever[0] < 1 && lever[1] > 0 && lever[1] < 1);
        for (int t = 0; t < 2; t++)
            for (int k = 0; k < 3; k++)
                place[t][k] = (double)tool[t].trocar_m[k] + lever[t] * axis[t][k];
        double gap = (place[0][0] - place[1][0]) * n_m[0] + (place[0][1] - place[1][1]) * n_m[1] +
                     (place[0][2] - place[1][2]) * n_m[2];
        /* one force at the place: each tip's over its lever, along the perpendicular, summing up to none */
        double one[2] = {dot(f[0], n_m) / lever[0], dot(f[1], n_m) / lever[1]}, aside = 0;
        for (int t = 0; t < 2; t++)
            for (int k = 0; k < 3; k++)
                aside = fmax(aside, fabs(f[t][k] - lever[t] * one[t] * n_m[k]));
        worst = fmax(worst, fabs(one[0] + one[1]) / fabs(one[0]));
        worst = fmax(worst, aside / rig_length(f[0]));
        most_unequal =
            fmax(most_unequal, fmax(rig_length(f[0]) / rig_length(f[1]), rig_length(f[1]) / rig_length(f[0])));
        /* they sink into each other by RIGID_GIVE of what the couplings give */
        assert_true(fabs(fabs(gap) - 2 * RIG_SHAFT_m) <
                    (double)RIGID_GIVE * (rig_length(f[0]) + rig_length(f[1])) / stiffness(&r) + 1e-6);
        rig_close(&r);
    }
    printf("# at least %.2f N at a tip, up to %.2f times as much at the other; off by at most %.1e\n", weakest,
           most_unequal, worst);
    assert_true(weakest > 0.5);
    assert_true(most_unequal > 1.5);
    assert_true(worst < 1e-4);
}

/* The work that the contact does on the hand, from force and way of each tick (trapezoids). */
struct work {
    double before[2][3], tip[2][3], done, moved;
};

static void work_tick(struct work *w, const struct rigid_rig *r, bool first)
{
    for (unsigned t = 0; t < r->bank.tool_count; t++) {
        double f[3];
        rig_force(r, t, f);
        for (int k = 0; k < 3; k++) {
            double tip = (double)r->c.instrument[t].kinematics.tip_m[k], part = 0;
            if (!first)
                part = (f[k] + w->before[t][k]) / 2 * (tip - w->tip[t][k]);
            w->done += part;
            w->moved += fabs(part);
            w->before[t][k] = f[k];
            w->tip[t][k] = tip;
        }
    }
}

/* Closed ways of up to 0.1 m/s around and into an obstacle, over its end and back, and of two instruments around each other. */
static void a_closed_way_gains_no_energy(void **state)
{
    (void)state;
    random_seed("energy", 62);
    double most = -INFINITY, least = INFINITY, peak = 0;
    for (int n = 0; n < 60; n++) {
        struct rigid_rig r;
        struct rigid_section section = rig_section();
        struct bank_tool tool[2];
        unsigned count = 1 + n % 2;
        crossing(tool, 0.012);
        const double hull[2][3] = {{FAR_m[0], FAR_m[1] - 0.03, FAR_m[2] + 0.012},
                                   {FAR_m[0], FAR_m[1] + 0.01, FAR_m[2] + 0.012}};
        if (count == 1)
            rig_obstacle(&section, 2, hull, 0.004);
        rig_open(&r, count, tool, &section);
        double middle[2][3] = {{0, 0, 0.12}, {0, 0, 0.12}}, swing[2][3], phase[2][3];
        for (int t = 0; t < 2; t++)
            for (int i = 0; i < 3; i++) {
                swing[t][i] = i == 2 ? random_range(0, 0.04) : random_range(0.02, 0.12);
                phase[t][i] = random_range(0, 6.28);
            }
        struct work w = {.done = 0};
        const int turn = 4000;
        for (int i = 0; i <= 2 * turn; i++) {
            for (unsigned t = 0; t < count; t++)
                for (int k = 0; k < 3; k++)
                    r.joint[t][k] =
                        middle[t][k] +
                        swing[t][k] * sin(6.283185307179586 * i / turn * (1 + (k + (int)t) % 2) + phase[t][k]);
            rig_tick(&r);
            if (i == turn)
                w = (struct work){.done = 0};
            if (i >= turn)
                work_tick(&w, &r, i == turn);
            for (unsigned t = 0; t < count && i >= turn; t++) {
                double f[3];
                rig_force(&r, t, f);
                peak = fmax(peak, rig_length(f));
            }
        }
        if (w.moved > 0.01) {
            most = fmax(most, w.done / w.moved);
            least = fmin(least, w.done / w.moved);
        }
        rig_close(&r);
    }
    printf("# up to %.1f N; work on the hand around a closed way from %.1e to %.1e of what goes to and fro\n", peak,
           least, most);
    assert_true(peak > 5);
    /* made by sampling: a kHz of steps of up to 0.1 mm against a potential of some mm */
    assert_true(most < 3e-3);
}

/* Swiped as fast as the encoders may move, over what is thinner than the way of a tick, a shaft stays on the side from which it
 * came; brought back over it, it is free as if nothing had been. */
static void no_speed_tunnels(void **state)
{
    (void)state;
    random_seed("swipe", 63);
    unsigned within_a_tick = 0;
    double peak = 0;
    for (int n = 0; n < 400; n++) {
        struct rigid_rig r;
        struct rigid_section section = rig_section();
        struct bank_tool tool[2];
        unsigned count = 1 + n % 2;
        crossing(tool, 0);
        section.head.shaft_radius_m[0] = section.head.shaft_radius_m[1] = BANK_MIN_SHAFT_M;
        for (int t = 0; t < 2; t++)
            tool[t].tip_radius_m = BANK_MIN_SHAFT_M;
        const double hull[2][3] = {{FAR_m[0], FAR_m[1] - 0.05, FAR_m[2]}, {FAR_m[0], FAR_m[1] + 0.05, FAR_m[2]}};
        double other = count == 2 ? (double)BANK_MIN_SHAFT_M : random_unit() < 0.5 ? 0 : 0.002;
        double clear = 1.05 * (other + (double)BANK_MIN_SHAFT_M) / 0.09; /* rad */
        if (count == 1)
            rig_obstacle(&section, 2, hull, other);
        rig_open(&r, count, tool, &section);
        double L = random_range(0.13, 0.19), step = random_range(n % 4 < 2 ? 0.2 : 0.9, 0.99) * 30e-3, f[3];
        double turned = random_range(-0.1, 0.1), side = random_unit() < 0.5 ? 1 : -1, start = random_range(0.1, 0.2);
        r.joint[0][0] = turned;
        r.joint[0][1] = side * start;
        r.joint[0][2] = L;
        r.joint[1][2] = 0.12;
        r.joint[1][0] = random_range(-0.1, 0.1);
        rig_tick(&r);
        rig_force(&r, 0, f);
        assert_true(rig_length(f) == 0);
        double out_z = (double)r.c.instrument[0].kinematics.tip_m[2];
        int ticks = (int)ceil((start + 0.05) / step);
        for (int i = 0; i < ticks; i++) {
            double before = r.joint[0][1];
            r.joint[0][1] -= side * step;
            rig_tick(&r);
            rig_force(&r, 0, f);
            bool passed = r.joint[0][1] * side < -clear;
            within_a_tick += passed && before * side > clear;
            if (!passed)
                continue;
            /* past it: pushed back to where it came from */
            assert_true(rig_length(f) > 0);
            assert_true(f[2] * out_z > 0);
            peak = fmax(peak, rig_length(f));
        }
        for (int i = 0; i < ticks; i++) {
            r.joint[0][1] += side * step;
            rig_tick(&r);
        }
        rig_force(&r, 0, f);
        assert_true(rig_length(f) == 0);
        rig_close(&r);
    }
    printf("# %u swipes from clear on one side to clear on the other in one tick; up to %.0f N to be limited\n",
           within_a_tick, peak);
    assert_true(within_a_tick > 0);
}

/* Off the end of what it was pressed against, a shaft slips over and is free. */
static void a_shaft_slips_off_an_end(void **state)
{
    (void)state;
    struct rigid_rig r;
    struct rigid_section section = rig_section();
    struct bank_tool tool[2];
    double f[3];
    crossing(tool, 0.012);
    const double hull[2][3] = {{FAR_m[0], FAR_m[1] - 0.05, FAR_m[2] + 0.012},
                               {FAR_m[0], FAR_m[1] + 0.01, FAR_m[2] + 0.012}};
    rig_obstacle(&section, 2, hull, 0.003);
    rig_open(&r, 1, tool, &section);
    double up = tool[0].rotation[7] > 0 ? 1 : -1, across = tool[0].rotation[3] > 0 ? 1 : -1;
    assert_true(fabs((double)tool[0].rotation[7]) > 0.9 && fabs((double)tool[0].rotation[3]) > 0.9);
    rig_go(&r, 0, 0, 0, 0.15, 20);
    rig_go(&r, 0, 0, up * 0.15, 0.15, 100); /* from below, through it by a few millimetres */
    rig_force(&r, 0, f);
    assert_true(f[2] < -1);
    rig_go(&r, 0, across * 0.25, up * 0.15, 0.15, 200); /* along it, over its end */
    for (int i = 0; i < 100; i++)
        rig_tick(&r);
    rig_force(&r, 0, f);
    assert_true(rig_length(f) == 0);
    rig_close(&r);
}

/* A tip thicker than the cannula meets the rim on its way out, squarely and with the coupling's stiffness; one that is not goes in. */
static void the_rim_stops_a_thick_tip(void **state)
{
    (void)state;
    for (int thick = 0; thick < 2; thick++) {
        struct rigid_rig r;
        struct rigid_section section = rig_section();
        double trocar[3], f[3], axis[3], tip = thick ? 0.006 : 0.004, inside = 0.07;
        above(0.1, trocar);
        section.head.cannula_radius_m = 0.0045f;
        section.head.cannula_inside_m = (float)inside;
        struct bank_tool tool = rig_tool(trocar, DOWN, tip);
        rig_open(&r, 1, &tool, &section);
        rig_go(&r, 0, 0.1, -0.05, 0.12, 40);
        rig_go(&r, 0, 0.1, -0.05, 0.065, 100);
        rig_tick(&r);
        rig_force(&r, 0, f);
        shaft(&r, 0, axis);
        double stop = inside + sqrt(tip * tip - 0.0045 * 0.0045), L = (double)r.c.instrument[0].kinematics.joint[2];
        double expected = thick ? stiffness(&r) / (1 + (double)RIGID_GIVE) * (stop - L) : 0;
        for (int k = 0; k < 3; k++)
            assert_true(fabs(f[k] - expected * axis[k]) < 1e-6 * stiffness(&r));
        assert_true(!thick || expected > 1);
        rig_close(&r);
    }
}

/* Pushed along its axis a cannula gives nothing on to its instrument; across it, what the lever says. */
static void a_cannula_passes_on_only_what_turns_it(void **state)
{
    (void)state;
    struct rigid_rig r;
    struct rigid_section section = rig_section();
    double trocar[2][3] = {{FAR_m[0], FAR_m[1], FAR_m[2] + 0.1}, {FAR_m[0] - 0.1, FAR_m[1], FAR_m[2] + 0.06}}, f[2][3];
    const double axis[2][3] = {{0, 0, -1}, {1, 0, 0}};
    section.head.cannula_radius_m = 0.005f;
    section.head.cannula_inside_m = 0.06f;
    struct bank_tool tool[2] = {rig_tool(trocar[0], axis[0], RIG_SHAFT_m), rig_tool(trocar[1], axis[1], RIG_SHAFT_m)};
    rig_open(&r, 2, tool, &section);
    rig_go(&r, 0, 0, 0, 0.16, 20);
    rig_go(&r, 1, 0, 0, 0.08, 20);
    rig_go(&r, 1, 0, 0, 0.1, 100); /* the second's tip against the side of the first's cannula, 0.04 from its trocar */
    for (int i = 0; i < 100; i++)
        rig_tick(&r);
    for (int t = 0; t < 2; t++)
        rig_force(&r, t, f[t]);
    double depth = (double)(section.head.cannula_radius_m) + RIG_SHAFT_m - 1e-7, lever = 0.04 / 0.16;
    double expected = depth * stiffness(&r) / (1 + (double)RIGID_GIVE) / (1 + lever * lever);
    printf("# %.3f N on the tip that pushes, %.3f N on the other's\n", rig_length(f[1]), rig_length(f[0]));
    assert_true(fabs(f[1][0] + expected) <
                0.01 * expected); /* the cannula turns by 0.03 rad: its lever changes by as much squared */
    assert_true(fabs(f[0][0] - lever * expected) < 0.01 * expected);
    assert_true(fabs(f[0][2]) < 0.05 * fabs(f[0][0])); /* square to the turned axis */
    rig_close(&r);
}

/* An instrument of which nothing is heard stays where it was, then is forgotten; heard again, it is there again. */
static void a_silent_instrument_is_there_until_it_is_forgotten(void **state)
{
    (void)state;
    struct rigid_rig r;
    struct rigid_section section = rig_section();
    struct bank_tool tool[2];
    double pressed[3], f[3];
    crossing(tool, 0.004); /* nearer than both radii */
    rig_open(&r, 2, tool, &section);
    r.joint[0][2] = r.joint[1][2] = 0.13;
    for (int i = 0; i < 50; i++)
        rig_tick(&r);
    rig_force(&r, 0, pressed);
    assert_true(rig_length(pressed) > 0.1);
    r.silent[1] = true;
    for (unsigned i = 1; i < SAFETY_STALE_TICKS; i++) {
        rig_tick(&r);
        rig_force(&r, 0, f);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(f[k] - pressed[k]) < 1e-3 * rig_length(pressed));
    }
    rig_tick(&r);
    rig_force(&r, 0, f);
    assert_true(rig_length(f) == 0);
    r.silent[1] = false;
    for (int i = 0; i < 50; i++)
        rig_tick(&r);
    rig_force(&r, 0, f);
    printf("# %.3f %.3f %.3f N, before %.3f %.3f %.3f N\n", f[0], f[1], f[2], pressed[0], pressed[1], pressed[2]);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(f[k] - pressed[k]) < 1e-2 * rig_length(pressed));
    rig_close(&r);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ball_stops_the_shaft_with_the_force_of_the_lever),
        cmocka_unit_test(two_shafts_feel_one_force_equal_and_opposite),
        cmocka_unit_test(a_closed_way_gains_no_energy),
        cmocka_unit_test(no_speed_tunnels),
        cmocka_unit_test(a_shaft_slips_off_an_end),
        cmocka_unit_test(the_rim_stops_a_thick_tip),
        cmocka_unit_test(a_silent_instrument_is_there_until_it_is_forgotten),
        cmocka_unit_test(a_cannula_passes_on_only_what_turns_it),
    };
    return cmocka_run_group_tests_name("rigid", tests, NULL, NULL);
}
