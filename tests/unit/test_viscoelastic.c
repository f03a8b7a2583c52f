/* Visco-elastic contact: the controller's recursion against the hereditary integral in double precision, closed responses
 * to ramps, steps and sines, and what must hold for every motion: no pull, no energy made, no growth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "random.h"
#include "tick_bench.h"

static const double T = 1e-3; /* a tick */

/* Points on a bank of the fixture, pushed without a collision: depths are given, anchors stay. */
struct press {
    unsigned char *bytes;
    struct bank_view bank;
    struct bank_contact contact; /* of the bank, changed by the test */
    struct row_cache rows;
    struct viscoelastic effect;
    struct collide points;
    struct contact_set set;
    uint32_t tick;
    unsigned count; /* of points */
    uint32_t triangle[CONTACT_MAX];
    double C[CONTACT_MAX][CONTACT_MAX]; /* n_c . G_cd n_d, m/N */
};

static struct bank_branch branch(double share, double time_s)
{
    return (struct bank_branch){.decay = (float)exp(-T / time_s),
                                .gain = (float)(share * time_s * -expm1(-T / time_s) / T),
                                .share = (float)share,
                                .time_s = (float)time_s};
}

static struct bank_branch dashpot(double time_s)
{
    return (struct bank_branch){.gain = (float)(time_s / T), .time_s = (float)time_s};
}

static void push(struct press *p, const double *depth_m)
{
    p->set.count = 0;
    p->points.count = p->points.tool[0].count = p->count;
    for (unsigned i = 0; i < p->count; i++) {
        if (!(depth_m[i] > 0)) /* above the surface at rest: not touching */
            continue;
        struct contact *c = &p->set.contact[p->set.count++];
        const uint16_t *v = p->bank.triangles[p->triangle[i]].vertex;
        *c = (struct contact){
            .point = i, .triangle = p->triangle[i], .weights = {0.3f, 0.3f, 0.4f}, .depth_m = (float)depth_m[i]};
        for (int a = 0; a < 3; a++)
            c->normal[a] = c->pull[0][a] = p->bank.normals[3 * v[0] + a]; /* any unit vector will do */
        for (int a = 0; a < 3; a++)
            p->points.point[i].anchor_m[a] = p->bank.positions[3 * v[0] + a];
    }
    p->tick++;
    contact_assemble(&p->set, &p->rows, &p->bank);
    viscoelastic_ask(&p->effect, &p->bank, &p->set, &p->points, p->tick);
    viscoelastic_deepen(&p->effect, &p->set);
    contact_push(&p->set, &p->effect.contact);
    viscoelastic_follow(&p->effect, &p->bank, &p->set);
}

/* `hard`: coupling and regularisation that are nothing beside the tissue. */
static void press_open(struct press *p, const struct bank_branch *branches, unsigned count, unsigned points, bool hard)
{
    struct bank_fixture_options o = bank_fixture_default;
    size_t length;
    memset(p, 0, sizeof *p);
    o.branches = count;
    memcpy(o.branch, branches, count * sizeof *branches);
    p->bytes = bank_fixture(&o, &length);
    assert_int_equal(bank_view_open(&p->bank, p->bytes, length), STATUS_OK);
    p->contact = *p->bank.contact;
    if (hard) {
        p->contact.coupling_stiffness_N_m = 1e9f;
        p->contact.regularisation_m_N = 1e-12f;
    }
    p->bank.contact = &p->contact;
    assert_true(row_cache_start(&p->rows, &p->bank, NULL, 0));
    p->count = points;
    unsigned found = 0;
    for (uint32_t t = 0; t < p->bank.triangle_count && found < points; t += 7) {
        const uint16_t *v = p->bank.triangles[t].vertex;
        bool free_ = true;
        for (int k = 0; k < 3; k++)
            free_ = free_ && p->bank.row_of[v[k]] != BANK_NONE;
        if (free_)
            p->triangle[found++] = t;
    }
    assert_int_equal(found, points);
    double depth[CONTACT_MAX];
    for (unsigned i = 0; i < points; i++)
        depth[i] = 0.001;
    push(p, depth);
    for (unsigned c = 0; c < points; c++)
        for (unsigned d = 0; d < points; d++) {
            float moved[3];
            p->C[c][d] = 0;
            contact_multiply(&p->set, c, d, p->set.contact[d].normal, moved);
            for (int a = 0; a < 3; a++)
                p->C[c][d] += (double)p->set.contact[c].normal[a] * moved[a];
        }
    viscoelastic_forget(&p->effect, &p->points.tool[0]);
    contact_forget(&p->set, &p->points, 0);
}

static double pressure(const struct press *p, unsigned point)
{
    for (unsigned c = 0; c < p->set.count; c++)
        if (p->set.contact[c].point == point)
            return p->set.contact[c].pressure_N;
    return 0;
}

/* u of the tissue into the body. */
static double moved(const struct press *p, unsigned point)
{
    const struct viscoelastic_point *v = &p->effect.point[point];
    double sum = 0;
    for (int a = 0; a < 3; a++)
        sum -= (double)v->moved_m[a] * p->bank.normals[3 * p->bank.triangles[p->triangle[point]].vertex[0] + a];
    return sum;
}

/* The series, with its dashpot, in double precision: from the rounded numbers of the bank, as the controller's. */
struct series {
    unsigned count;
    double decay[BANK_MAX_BRANCHES], gain[BANK_MAX_BRANCHES];
};

static struct series series_of(const struct press *p)
{
    struct series s = {.count = p->bank.viscoelastic->branches};
    for (unsigned b = 0; b < s.count; b++) {
        s.decay[b] = p->bank.viscoelastic->branch[b].decay;
        s.gain[b] = p->bank.viscoelastic->branch[b].gain;
    }
    return s;
}

/* w after steps of u of the given sizes, the last one just done: the sum over the past, no recursion. */
static double hereditary(const struct series *s, const double *step, unsigned n)
{
    double w = 0;
    for (unsigned k = 0; k < n; k++) {
        double g = 1;
        for (unsigned b = 0; b < s->count; b++)
            g += s->gain[b] * (k + 1 == n ? 1 : s->decay[b] > 0 ? pow(s->decay[b], n - 1 - k) : 0);
        w += g * step[k];
    }
    return w;
}

static void ramp_step_and_rest_have_their_closed_forms(void **state)
{
    (void)state;
    const double g[2] = {0.3, 0.8}, tau[2] = {0.02, 0.4}, speed = 0.02, hold = 0.004;
    const struct bank_branch branches[2] = {branch(g[0], tau[0]), branch(g[1], tau[1])};
    struct press p;
    double worst = 0, first = 0;
    press_open(&p, branches, 2, 1, true);
    for (unsigned n = 1; n <= 400; n++) { /* ramp: w = v t + sum g tau v (1 - exp(-t/tau)) */
        double t = n * T, depth = speed * t, w = depth;
        for (int b = 0; b < 2; b++)
            w += g[b] * tau[b] * speed * -expm1(-t / tau[b]);
        push(&p, &depth);
        worst = fmax(worst, fabs(pressure(&p, 0) * p.C[0][0] / w - 1));
    }
    print_message("# ramp: off by %.1e\n", worst);
    assert_true(worst < 1e-4); /* decays are rounded to 2^-25: 1000 of them to 3e-5 */
    viscoelastic_forget(&p.effect, &p.points.tool[0]);
    worst = 0;
    for (unsigned n = 1; n <= 8000; n++) { /* within one tick to `hold`: g(t), that tick spread over itself */
        double t = n * T, w = hold;
        for (int b = 0; b < 2; b++)
            w += hold * g[b] * tau[b] / T * -expm1(-T / tau[b]) * exp(-(t - T) / tau[b]);
        push(&p, &hold);
        worst = fmax(worst, fabs(pressure(&p, 0) * p.C[0][0] / w - 1));
        first = n == 1 ? pressure(&p, 0) : first;
    }
    print_message("# step: off by %.1e; %.4f N at once, %.4f N at rest\n", worst, first, pressure(&p, 0));
    assert_true(worst < 1e-4);
    assert_true(fabs(pressure(&p, 0) * p.C[0][0] / hold - 1) < 1e-4); /* at rest: what the elastic body answers */
    free(p.bytes);
}

static void storage_and_loss_are_recovered_from_sines(void **state)
{
    (void)state;
    const double g[2] = {0.4, 0.9}, tau[2] = {0.01, 0.2}, C = 0.003;
    const struct bank_branch branches[3] = {branch(g[0], tau[0]), branch(g[1], tau[1]), dashpot(C)};
    struct press p;
    press_open(&p, branches, 3, 1, true);
    for (double hertz = 0.5; hertz < 20; hertz *= 2) {
        unsigned period = (unsigned)lround(1 / (hertz * T)), cycles = 3;
        double w = 2 * M_PI / (period * T), storage = 1, loss = w * C, in = 0, out = 0;
        for (int b = 0; b < 2; b++) {
            double x = w * tau[b];
            storage += g[b] * x * x / (1 + x * x);
            loss += g[b] * x / (1 + x * x);
        }
        viscoelastic_forget(&p.effect, &p.points.tool[0]);
        unsigned warm = period * (unsigned)ceil(2.0 / (period * T)); /* ten times the longest time */
        for (unsigned n = 0; n < warm + cycles * period; n++) {
            double depth = 0.005 + 0.001 * sin(w * n * T);
            push(&p, &depth);
            if (n < warm)
                continue;
            double f = pressure(&p, 0) * p.C[0][0] / 0.001 * 2 / (cycles * period);
            in += f * sin(w * n * T);
            out += f * cos(w * n * T);
        }
        print_message("# %5.1f Hz: G' off by %.2f %%, G'' by %.2f %%\n", hertz, 100 * (in / storage - 1),
                      100 * (out / loss - 1));
        assert_true(fabs(in / storage - 1) < 0.01 &&
                    fabs(out / loss - 1) < 0.01); /* (w T)^2/12, and the dashpot's lag */
    }
    free(p.bytes);
}

/* Cholesky in double. */
static void solve(unsigned n, double (*A)[CONTACT_MAX], const double *b, double *x)
{
    double L[CONTACT_MAX][CONTACT_MAX];
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) {
            double sum = A[i][j];
            for (unsigned k = 0; k < j; k++)
                sum -= L[i][k] * L[j][k];
            L[i][j] = i == j ? sqrt(sum) : sum / L[j][j];
        }
    for (unsigned i = 0; i < n; i++) {
        x[i] = b[i];
        for (unsigned k = 0; k < i; k++)
            x[i] -= L[i][k] * x[k];
        x[i] /= L[i][i];
    }
    for (unsigned i = n; i-- > 0;) {
        for (unsigned k = i + 1; k < n; k++)
            x[i] -= L[k][i] * x[k];
        x[i] /= L[i][i];
    }
}

static void several_contacts_answer_the_hereditary_integral(void **state)
{
    (void)state;
    enum { POINTS = 4, TICKS = 400 };
    const struct bank_branch branches[3] = {branch(0.5, 0.004), branch(1, 0.1), dashpot(0.002)};
    static double step[POINTS][TICKS];
    struct press p;
    press_open(&p, branches, 3, POINTS, true);
    const struct series s = series_of(&p);
    double worst = 0, largest = 0, depth[POINTS];
    random_seed("depths", 12);
    for (unsigned n = 0; n < TICKS; n++) {
        double w[POINTS], expected[POINTS];
        for (unsigned i = 0; i < POINTS; i++) {
            double next = 0.01 + (n > 0 ? 0.0005 * sin(0.07 * n * (i + 1)) + 0.00001 * random_range(-1, 1) : 0);
            step[i][n] = (double)(float)next - (n ? depth[i] : 0);
            depth[i] = (double)(float)next;
            w[i] = hereditary(&s, step[i], n + 1);
        }
        push(&p, depth);
        solve(POINTS, p.C, w, expected);
        for (unsigned i = 0; i < POINTS; i++) {
            assert_true(expected[i] > 0); /* all push: no inequality in this test */
            worst = fmax(worst, fabs(pressure(&p, i) - expected[i]));
            largest = fmax(largest, expected[i]);
        }
    }
    print_message("# off by %.1e of the largest force\n", worst / largest);
    /* float: C is known to 1e-7 of itself, and its condition here is below 100; 400 sums of memory */
    assert_true(worst < 1e-4 * largest);
    free(p.bytes);
}

/* One point is pressed and drawn back faster than the tissue follows: its force ends at 0, the tissue is then in front of the
 * tool and comes back as an unloaded body does (w = 0), and the tool meets it where it is. */
static void tissue_that_lags_behind_is_left_and_met_again(void **state)
{
    (void)state;
    const struct bank_branch branches[1] = {branch(1.5, 0.3)};
    struct press p;
    press_open(&p, branches, 1, 1, true);
    const struct series s = series_of(&p);
    static double step[2000];
    unsigned n = 0, alone = 0;
    double u = 0, lag = 0, off = 0, force_off = 0;
    for (; n < 1200; n++) {
        double depth = n < 300   ? 0.006
                       : n < 360 ? 0.006 - 0.0001 * (n - 299)
                       : n < 500 ? 1e-5
                                 : 1e-5 + 0.00001 * (n - 499);
        depth = (double)(float)depth;
        push(&p, &depth);
        /* reference: u = depth while that takes a force; else u such that w = 0 */
        step[n] = depth - u;
        double w = hereditary(&s, step, n + 1);
        if (w < 0) {
            step[n] = 0;
            step[n] = -hereditary(&s, step, n + 1) / (1 + s.gain[0]);
            w = 0;
            alone++;
        }
        u += step[n];
        lag = fmax(lag, u - depth);
        off = fmax(off, fabs(moved(&p, 0) - u));
        force_off = fmax(force_off, fabs(pressure(&p, 0) * p.C[0][0] - w));
        assert_true(pressure(&p, 0) >= 0);
    }
    print_message("# alone for %u ticks, up to %.2f mm in front; u off by %.1e m, p G by %.1e m\n", alone, 1e3 * lag,
                  off, force_off);
    assert_true(alone > 50 && lag > 1e-3 && alone < n - 400);
    assert_true(off < 1e-7 && force_off < 1e-6); /* 6 mm in float: 5e-10 each tick, 1200 ticks */
    free(p.bytes);
}

/* A second point comes upon tissue that the first has displaced: what it takes over is exact while their histories are
 * proportional. The reference follows both from the start. */
static void a_point_that_comes_later_knows_what_others_did(void **state)
{
    (void)state;
    const struct bank_branch branches[2] = {branch(0.8, 0.05), branch(0.5, 0.5)};
    struct press late, whole;
    press_open(&late, branches, 2, 2, true);
    press_open(&whole, branches, 2, 2, true);
    double worst = 0, largest = 0;
    bool both = false;
    for (unsigned n = 1; n <= 600; n++) {
        double depth[2] = {1e-5 * n, 1e-5 * n - 0.001}, always[2] = {depth[0], depth[1] > 0 ? depth[1] : 1e-9};
        push(&late, depth);
        push(&whole, always);
        for (unsigned i = 0; i < 2; i++)
            worst = fmax(worst, fabs(pressure(&late, i) - pressure(&whole, i)));
        largest = fmax(largest, pressure(&whole, 0));
        both = both || pressure(&whole, 1) > 0.01;
    }
    print_message("# off by %.1e of the largest force\n", worst / largest);
    assert_true(both && worst < 1e-4 * largest);
    free(late.bytes);
    free(whole.bytes);
}

/* Random branches, also dashpots and times far below and above a tick. */
static unsigned random_branches(struct bank_branch *branches, bool with_dashpot)
{
    unsigned count = 1 + random_below(3);
    for (unsigned b = 0; b < count; b++)
        branches[b] = with_dashpot && b == 0 ? dashpot(pow(10, random_range(-4, -1)))
                                             : branch(pow(10, random_range(-2, 1)), pow(10, random_range(-5, 4)));
    return count;
}

/* The work on the tissue by the trapezoidal rule, over points that are followed all the time and pushed now and then. */
static void no_motion_makes_energy_and_nothing_grows(void **state)
{
    (void)state;
    enum { POINTS = 5 };
    random_seed("motions", 13);
    double least = 1, most = 0, elastic = 0;
    for (int trial = 0; trial < 60; trial++) {
        struct bank_branch branches[3];
        unsigned count = random_branches(branches, trial % 5 == 0), apart = 0;
        bool plain = trial % 20 == 19; /* as good as elastic: nothing may be lost either */
        if (plain)
            branches[0] = branch(1e-6, 0.01), count = 1;
        struct press p;
        press_open(&p, branches, count, POINTS, trial % 2);
        double work = 0, through = 0, force[POINTS] = {0}, u[POINTS] = {0}, phase[POINTS], deepest = 0;
        for (unsigned i = 0; i < POINTS; i++)
            phase[i] = random_range(0, 6.28);
        double rate = random_range(0.005, 0.3);
        for (unsigned n = 0; n < 1500; n++) {
            double depth[POINTS];
            for (unsigned i = 0; i < POINTS; i++) {
                depth[i] = n < 1400 ? 0.003 * sin(rate * n + phase[i]) + 0.001 * random_range(-1, 1) : 0;
                depth[i] = fmax(depth[i], 1e-12); /* at the surface: no force, but in the set */
                deepest = fmax(deepest, depth[i]);
            }
            push(&p, depth);
            for (unsigned i = 0; i < POINTS; i++) {
                double f = pressure(&p, i), now = moved(&p, i);
                assert_true(isfinite(f) && f >= 0 && fabs(now) <= 2 * POINTS * deepest);
                apart += f == 0;
                work += (f + force[i]) / 2 * (now - u[i]);
                through += fabs((f + force[i]) / 2 * (now - u[i]));
                force[i] = f;
                u[i] = now;
            }
        }
        assert_true(apart > 500 && apart < 1500 * POINTS - 500);
        least = fmin(least, work / through);
        most = fmax(most, work / through);
        elastic = plain ? fmax(elastic, fabs(work) / through) : elastic;
        free(p.bytes);
    }
    print_message("# kept, of the work that went in and out: %.1e to %.2f; almost elastic %.1e\n", least, most,
                  elastic);
    /* Forces in float from depths of some mm, to 1e-5 of the largest: what the sums of 7500 such terms leave. */
    assert_true(least > -1e-4 && elastic < 1e-3 && most > 0.5);
}

/* With points that leave the surface and come again, what their tissue did meanwhile is an estimate: good for the points of a
 * rigid tool that goes in, rocks and comes out, rough for points that move each by itself. */
static double kept(bool rigid, double *mean)
{
    enum { POINTS = 5, TRIALS = 40 };
    double least = 1;
    *mean = 0;
    for (int trial = 0; trial < TRIALS; trial++) {
        struct bank_branch branches[3];
        unsigned count = random_branches(branches, trial % 5 == 0);
        struct press p;
        press_open(&p, branches, count, POINTS, false);
        double work = 0, through = 0, force[POINTS] = {0}, u[POINTS] = {0}, phase[POINTS], above[POINTS];
        for (unsigned i = 0; i < POINTS; i++) {
            phase[i] = random_range(0, 1.5);
            above[i] = i ? random_range(0, 0.003) : 0;
        }
        double rate = random_range(0.002, 0.05); /* to 24 cm/s */
        for (unsigned n = 0; n < 3000; n++) {
            double depth[POINTS], size = 0.005 * fmin(1e-3 * n, 1);
            for (unsigned i = 0; i < POINTS; i++) {
                depth[i] = rigid ? size * sin(rate * n) - above[i] + 0.1 * size * sin(0.3 * rate * n + phase[i])
                                 : size * sin(rate * n + phase[i]);
                depth[i] = n < 2900 ? depth[i] : -1e-3;
            }
            push(&p, depth);
            for (unsigned i = 0; i < POINTS; i++) {
                double f = pressure(&p, i), now = moved(&p, i);
                work += (f + force[i]) / 2 * (now - u[i]);
                through += fabs((f + force[i]) / 2 * (now - u[i]));
                force[i] = f;
                u[i] = now;
            }
        }
        least = fmin(least, work / through);
        *mean += work / through / TRIALS;
        free(p.bytes);
    }
    return least;
}

static void little_energy_is_made_by_leaving_and_coming_again(void **state)
{
    (void)state;
    double mean[2];
    random_seed("ways", 14);
    double single = kept(false, &mean[0]), rigid = kept(true, &mean[1]);
    print_message(
        "# kept, of the work that went in and out: a rigid tool at least %.1e, %.2f on average; points each by "
        "itself %.1e, %.2f\n",
        rigid, mean[1], single, mean[0]);
    assert_true(rigid > -0.05 && single > -0.05); /* what viscoelastic.md states */
}

static void ticks_without_a_sample_are_bridged_exactly_for_steady_motion(void **state)
{
    (void)state;
    const struct bank_branch branches[2] = {branch(0.6, 0.003), branch(0.7, 0.2)};
    struct press every, some;
    press_open(&every, branches, 2, 1, true);
    press_open(&some, branches, 2, 1, true);
    double worst = 0;
    const double none = 0;
    push(&every, &none);
    push(&some, &none);
    for (unsigned n = 1; n <= 300; n++) {
        double depth = 1e-5 * n;
        push(&every, &depth);
        if (n % 3) { /* lost */
            some.tick++;
            continue;
        }
        push(&some, &depth);
        worst = fmax(worst, fabs(pressure(&some, 0) / pressure(&every, 0) - 1));
    }
    print_message("# two of three ticks lost: off by %.1e\n", worst);
    assert_true(worst < 1e-4); /* as the ramp */
    free(every.bytes);
    free(some.bytes);
}

static void a_point_forgets_another_place_and_remembers_its_own(void **state)
{
    (void)state;
    const struct bank_branch branches[1] = {branch(2, 0.5)};
    for (int elsewhere = 0; elsewhere < 2; elsewhere++) {
        struct press p;
        press_open(&p, branches, 1, 2, true);
        double depth[2] = {0.004, -1}, off[2] = {-1, -1};
        for (unsigned n = 0; n < 500; n++)
            push(&p, depth);
        for (unsigned n = 0; n < 20; n++)
            push(&p, off);
        assert_true(moved(&p, 0) > 0.0003);
        uint32_t other = p.triangle[1];
        if (elsewhere)
            p.triangle[0] = other;
        depth[0] = 1e-4;
        push(&p, depth);
        if (elsewhere)
            assert_true(pressure(&p, 0) > 0); /* untouched tissue */
        else
            assert_true(pressure(&p, 0) == 0); /* the dent is deeper still */
        free(p.bytes);
    }
}

/* The whole way: counts of the encoders in, force of the tick out. The coupling's spring is in series. */
static void the_ticks_force_on_a_sinusoidal_press_has_both_moduli(void **state)
{
    (void)state;
    const double g = 0.7, tau = 0.03;
    struct bank_fixture_options o = bank_fixture_default;
    o.tip_points = 1;
    o.branches = 1;
    o.branch[0] = branch(g, tau);
    static struct bench b;
    bench_open(&b, &o);
    const double touch = 0.12 - o.tip_radius_m; /* insertion at which the tip meets the sphere's pole */
    bench_start(&b, 0, 0, touch - 0.002);
    for (int n = 0; n < 100; n++)
        bench_tick(&b, 0, 0, touch - 0.002 + 0.00007 * n);
    for (double hertz = 1; hertz < 9; hertz *= 2) {
        unsigned period = (unsigned)lround(1 / (hertz * T)), cycles = 4;
        double w = 2 * M_PI / (period * T), re[2] = {0}, im[2] = {0};
        for (unsigned n = 0; n < (cycles + 2) * period; n++) {
            bench_tick(&b, 0, 0, touch + 0.005 + 0.002 * sin(w * n * T));
            const struct contact_set *set = &b.node.controller.contact;
            assert_int_equal(set->count, 1);
            double x[2] = {set->contact[0].depth_m, set->contact[0].pressure_N};
            for (int k = 0; k < 2 && n >= 2 * period; k++) {
                re[k] += x[k] * sin(w * n * T);
                im[k] += x[k] * cos(w * n * T);
            }
        }
        /* depth / force = 1 / (K g*) + 1/k + epsilon; K from the contact's own elastic response */
        const struct contact_set *set = &b.node.controller.contact;
        float own[3];
        double response = 0, size = re[1] * re[1] + im[1] * im[1];
        contact_multiply(set, 0, 0, set->contact[0].normal, own);
        for (int a = 0; a < 3; a++)
            response += (double)set->contact[0].normal[a] * own[a];
        double c_re = (re[0] * re[1] + im[0] * im[1]) / size, c_im = (im[0] * re[1] - re[0] * im[1]) / size;
        c_re -= 1.0 / b.bank.contact->coupling_stiffness_N_m + b.bank.contact->regularisation_m_N;
        double all = c_re * c_re + c_im * c_im, storage = response * c_re / all, loss = -response * c_im / all;
        double x = w * tau, wanted[2] = {1 + g * x * x / (1 + x * x), g * x / (1 + x * x)};
        print_message("# %g Hz: G' off by %.2f %%, G'' by %.2f %%\n", hertz, 100 * (storage / wanted[0] - 1),
                      100 * (loss / wanted[1] - 1));
        assert_true(fabs(storage / wanted[0] - 1) < 0.01 && fabs(loss / wanted[1] - 1) < 0.01);
    }
    bench_close(&b);
}

static void damaged_sections_are_refused(void **state)
{
    (void)state;
    static const struct {
        unsigned word;
        uint32_t value;
        int status;
    } cases[] = {
        {0, 3, STATUS_BANK_NONFINITE},          {1, 0, STATUS_BANK_NONFINITE},
        {1, 0x7FC00000, STATUS_BANK_NONFINITE}, {2, 1, STATUS_BANK_NONFINITE},
        {4, 0x3F800000, STATUS_BANK_NONFINITE}, {4, 0xBF000000, STATUS_BANK_NONFINITE},
        {4, 0x7FC00000, STATUS_BANK_NONFINITE}, {5, 0, STATUS_BANK_NONFINITE},
        {5, 0x7F800000, STATUS_BANK_NONFINITE}, {5, 0x447A0001, STATUS_BANK_NONFINITE},
        {6, 0x7F800000, STATUS_BANK_NONFINITE}, {7, 0xBF800000, STATUS_BANK_NONFINITE},
    };
    struct bank_fixture_options o = bank_fixture_default;
    o.branches = 2;
    o.branch[0] = branch(0.5, 0.1);
    o.branch[1] = branch(0.5, 1);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        size_t length;
        struct bank_view view;
        unsigned char *bytes = bank_fixture(&o, &length);
        assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
        memcpy(bytes + bank_fixture_section(bytes, BANK_VISC)->offset + 4 * cases[k].word, &cases[k].value, 4);
        bank_fixture_seal(bytes, length);
        assert_int_equal(bank_view_open(&view, bytes, length), cases[k].status);
        assert_int_equal(view.fault_tag, BANK_VISC);
        free(bytes);
    }
    size_t length;
    struct bank_view view;
    unsigned char *bytes = bank_fixture(&o, &length);
    bank_fixture_section(bytes, BANK_VISC)->count = 1;
    bank_fixture_seal(bytes, length);
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_BANK_LENGTH);
    free(bytes);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ramp_step_and_rest_have_their_closed_forms),
        cmocka_unit_test(storage_and_loss_are_recovered_from_sines),
        cmocka_unit_test(several_contacts_answer_the_hereditary_integral),
        cmocka_unit_test(tissue_that_lags_behind_is_left_and_met_again),
        cmocka_unit_test(a_point_that_comes_later_knows_what_others_did),
        cmocka_unit_test(no_motion_makes_energy_and_nothing_grows),
        cmocka_unit_test(little_energy_is_made_by_leaving_and_coming_again),
        cmocka_unit_test(ticks_without_a_sample_are_bridged_exactly_for_steady_motion),
        cmocka_unit_test(a_point_forgets_another_place_and_remembers_its_own),
        cmocka_unit_test(the_ticks_force_on_a_sinusoidal_press_has_both_moduli),
        cmocka_unit_test(damaged_sections_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
