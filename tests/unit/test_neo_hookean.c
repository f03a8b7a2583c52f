/* The correction for large displacements on the controller: a gradient of the potential that its section says, exact for one contact on
 * any coupling, continuous, growing with depth, and without work on closed ways; damaged sections are refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "random.h"
#include "tick_bench.h"

static const unsigned char power[BANK_CUBIC_TERMS][3] = {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}, {2, 1, 0}, {2, 0, 1},
                                                         {1, 2, 0}, {0, 2, 1}, {1, 0, 2}, {0, 1, 2}, {1, 1, 1}};

/* Points on a bank of the fixture, pushed without a collision: depths are given, anchors stay. */
struct press {
    unsigned char *bytes;
    struct bank_view bank;
    struct bank_contact contact; /* of the bank, changed by the test */
    struct row_cache rows;
    struct neo_hookean effect;
    struct contact_set linear, set; /* of the last push: before and after the correction */
    unsigned count;
    uint32_t triangle[CONTACT_MAX];
    float weights[CONTACT_MAX][3];
};

static void push(struct press *p, const double *depth_m)
{
    p->set.count = 0;
    for (unsigned i = 0; i < p->count; i++) {
        struct contact *c = &p->set.contact[p->set.count++];
        const uint16_t *v = p->bank.triangles[p->triangle[i]].vertex;
        *c = (struct contact){.point = i, .triangle = p->triangle[i], .depth_m = (float)depth_m[i]};
        for (int a = 0; a < 3; a++) {
            c->weights[a] = p->weights[i][a];
            c->normal[a] = c->pull[0][a] = p->bank.normals[3 * v[0] + a]; /* any unit vector will do */
        }
    }
    contact_assemble(&p->set, &p->rows, &p->bank);
    contact_push(&p->set, p->bank.contact);
    p->linear = p->set;
    neo_hookean_correct(&p->effect, &p->bank, &p->set);
}

/* `size`: of the coefficients, m/N2; `range_J`: of every vertex, a little different from each other. */
static void press_open(struct press *p, double size, double range_J, double coupling_N_m, unsigned points)
{
    struct bank_fixture_options o = bank_fixture_default;
    static struct bank_cubic cubic[200];
    size_t length;
    memset(p, 0, sizeof *p);
    for (size_t v = 0; v < 200; v++) {
        cubic[v] =
            (struct bank_cubic){.unit_m_N2 = (float)(size / 32767), .range_J = (float)(range_J * random_range(1, 1.3))};
        for (int k = 0; k < BANK_CUBIC_TERMS; k++)
            cubic[v].cubic[k] = (int16_t)random_range(-32767, 32767);
    }
    o.cubic = cubic;
    p->bytes = bank_fixture(&o, &length);
    assert_int_equal(bank_view_open(&p->bank, p->bytes, length), STATUS_OK);
    p->contact = *p->bank.contact;
    p->contact.coupling_stiffness_N_m = (float)coupling_N_m;
    p->bank.contact = &p->contact;
    assert_true(row_cache_start(&p->rows, &p->bank, NULL, 0));
    p->count = points;
    for (unsigned i = 0; i < points;) {
        uint32_t t = random_below(p->bank.triangle_count);
        const uint16_t *v = p->bank.triangles[t].vertex;
        bool good = p->bank.normals[3 * v[0] + 2] > 0.6f;
        for (int k = 0; k < 3; k++)
            good = good && p->bank.row_of[v[k]] != BANK_NONE;
        if (!good)
            continue;
        p->triangle[i] = t;
        p->weights[i][0] = (float)random_range(0.1, 0.5);
        p->weights[i][1] = (float)random_range(0.1, 0.5);
        p->weights[i][2] = 1 - p->weights[i][0] - p->weights[i][1];
        i++;
    }
}

static void press_close(struct press *p)
{
    free(p->bytes);
}

/* T and the range of one contact. */
static double form(const struct press *p, unsigned i, const double F[3], double *range_J)
{
    double T = 0;
    *range_J = 0;
    for (int c = 0; c < 3; c++) {
        const struct bank_cubic *at = &p->bank.neo_hookean->vertex[p->bank.triangles[p->triangle[i]].vertex[c]];
        *range_J += (double)p->weights[i][c] * (double)at->range_J;
        for (int k = 0; k < BANK_CUBIC_TERMS; k++) {
            double term = (double)p->weights[i][c] * (double)at->unit_m_N2 * at->cubic[k];
            for (int a = 0; a < 3; a++)
                term *= pow(F[a], power[k][a]);
            T += term;
        }
    }
    return T;
}

/* The potential's third order as a function of linear forces, in double precision and from its definition. */
static double potential(const struct press *p, const double *q)
{
    double F[3] = {0}, P = 0, Q = 0, T = 0, R = 0, range;
    for (unsigned c = 0; c < p->count; c++) {
        P += q[c];
        for (int a = 0; a < 3; a++)
            F[a] -= q[c] * (double)p->set.contact[c].normal[a];
        for (unsigned d = 0; d < p->count; d++) {
            double C = (double)p->linear.system[c][d];
            for (int a = 0; a < 3; a++)
                C -= (double)p->set.contact[c].normal[a] * (double)p->set.contact[d].normal[a] /
                     (double)p->contact.coupling_stiffness_N_m;
            Q += q[c] * C * q[d];
        }
    }
    for (unsigned c = 0; c < p->count; c++) {
        T += q[c] / P * form(p, c, F, &range);
        R += q[c] / P * range;
    }
    double s = fmin(1, sqrt(R / Q));
    return T * (3 * s - 3 * s * s + s * s * s);
}

/* By how much the depths were raised: what the corrected forces leave of A p' - d. */
static void raised(const struct press *p, const double *depth_m, double *g)
{
    for (unsigned c = 0; c < p->count; c++) {
        g[c] = -depth_m[c];
        for (unsigned d = 0; d < p->count; d++)
            g[c] += (double)p->linear.system[c][d] * (double)p->set.contact[d].pressure_N;
    }
}

static bool all_push(const struct press *p)
{
    for (unsigned c = 0; c < p->count; c++)
        if (!(p->set.contact[c].pressure_N > 0 && p->linear.contact[c].pressure_N > 0))
            return false;
    return true;
}

/* Forces whose depths lie anywhere but have all contacts push: depths of random forces. */
static void random_depths(const struct press *p, double force_N, double *depth_m)
{
    double q[CONTACT_MAX];
    for (unsigned c = 0; c < p->count; c++)
        q[c] = force_N * random_range(0.3, 1);
    for (unsigned c = 0; c < p->count; c++) {
        depth_m[c] = 0;
        for (unsigned d = 0; d < p->count; d++)
            depth_m[c] += (double)p->linear.system[c][d] * q[d];
    }
}

static void the_correction_is_the_gradient_of_its_potential(void **state)
{
    (void)state;
    random_seed("gradient", 11);
    unsigned beyond = 0, within = 0;
    for (int trial = 0; trial < 300; trial++) {
        struct press p;
        double depth[CONTACT_MAX], g[CONTACT_MAX], range = trial % 2 ? 1 : 1e-5;
        press_open(&p, 0.05, range, 1e7, 1 + random_below(8)); /* a hard coupling: nothing goes back */
        for (unsigned c = 0; c < p.count; c++)
            depth[c] = 1e-3;
        push(&p, depth); /* for the system */
        random_depths(&p, 0.03, depth);
        push(&p, depth);
        if (all_push(&p)) {
            double q[CONTACT_MAX], most = 0;
            raised(&p, depth, g);
            for (unsigned c = 0; c < p.count; c++) {
                q[c] = (double)p.linear.contact[c].pressure_N;
                most = fmax(most, fabs(depth[c]));
            }
            beyond += p.effect.beyond > 0;
            within += p.effect.beyond == 0;
            for (unsigned c = 0; c < p.count; c++) {
                double step = 1e-4 * q[c], kept = q[c], high, low;
                q[c] = kept + step;
                high = potential(&p, q);
                q[c] = kept - step;
                low = potential(&p, q);
                q[c] = kept;
                /* single precision resolves a depth to 1e-7 of the largest, and the system amplifies that hundredfold */
                assert_true(fabs(g[c] - (high - low) / (2 * step)) < 2e-5 * most + 1e-3 * fabs(g[c]));
            }
        }
        press_close(&p);
    }
    print_message("# %u trials within the range, %u beyond\n", within, beyond);
    assert_true(within > 50 && beyond > 50);
}

/* C q = d - p/k, p = q + T'(q)/C: the root by bisection. */
static void one_contact_is_exact_on_any_coupling(void **state)
{
    (void)state;
    random_seed("coupling", 12);
    double largest = 0;
    for (int trial = 0; trial < 400; trial++) {
        struct press p;
        double depth = random_range(1e-4, 6e-3), k = exp(random_range(log(20), log(1e5)));
        press_open(&p, exp(random_range(log(1e-3), log(1))), 1e3, k, 1);
        push(&p, &depth);
        double C = (double)p.linear.system[0][0] - 1 / k, one = 1, low = 0, high = 2 * depth / C;
        double t = potential(&p, &one); /* T = t q^3 */
        double h = 3 * t * depth / (C * C);
        if (h > -0.2 && h < 0.5) { /* where the force grows */
            for (int turn = 0; turn < 100; turn++) {
                double q = (low + high) / 2, force = q + 3 * t * q * q / C;
                *(C * q + force / k < depth ? &low : &high) = q;
            }
            double force = low + 3 * t * low * low / C, got = (double)p.set.contact[0].pressure_N;
            assert_true(fabs(got - force) < 1e-5 * force); /* rounding */
            largest = fmax(largest, fabs(force / (double)p.linear.contact[0].pressure_N - 1));
            /* and what it says of the tissue is where the tissue is */
            double moved = 0;
            for (int a = 0; a < 3; a++)
                moved -= (double)p.set.contact[0].displacement_m[a] * (double)p.set.contact[0].normal[a];
            assert_true(fabs(moved - (depth - force / k)) <
                        2e-3 * depth); /* but for epsilon, 1e-3 of the typical compliance */
        }
        press_close(&p);
    }
    print_message("# corrections to %.0f %% of the force\n", 100 * largest);
    assert_true(largest > 0.2);
}

/* A range that is too large for the random forms would not be convex: find one that is, as the host does, by looking. */
static double convex_range(struct press *p)
{
    double least = 1, F[3], range;
    for (int k = 0; k < 2000; k++) {
        double q[CONTACT_MAX], P = 0, Q = 0, T = 0;
        memset(F, 0, sizeof F);
        for (unsigned c = 0; c < p->count; c++) {
            q[c] = random_range(0.01, 1);
            P += q[c];
            for (int a = 0; a < 3; a++)
                F[a] -= q[c] * (double)p->set.contact[c].normal[a];
            for (unsigned d = 0; d < c; d++)
                Q += 2 * q[c] * (double)p->linear.system[c][d] * q[d];
            Q += q[c] * (double)p->linear.system[c][c] * q[c];
        }
        for (unsigned c = 0; c < p->count; c++)
            T += q[c] / P * fabs(form(p, c, F, &range));
        least = fmin(least, pow(Q, 3) / pow(12 * T, 2)); /* |3 T| = Q / 4 */
    }
    return least;
}

static void set_range(struct press *p, double range_J)
{
    for (uint32_t v = 0; v < p->bank.vertex_count; v++)
        ((struct bank_cubic *)p->bank.neo_hookean->vertex)[v].range_J = (float)range_J;
    p->effect = (struct neo_hookean){0};
}

/* Deeper everywhere by the same: more force in all, from nothing to ten times the range, without a jump. */
static void force_grows_with_depth_and_does_not_jump(void **state)
{
    (void)state;
    random_seed("depth", 13);
    for (int trial = 0; trial < 60; trial++) {
        struct press p;
        double depth[CONTACT_MAX], last = 0, start[CONTACT_MAX];
        enum { STEPS = 1000 };
        press_open(&p, 0.3, 1, 1e4, 1 + random_below(8));
        for (unsigned c = 0; c < p.count; c++) {
            start[c] = random_range(0, 1e-3); /* they touch one after the other */
            depth[c] = 1e-3;
        }
        push(&p, depth);
        set_range(&p, convex_range(&p));
        double stiffness = 0;
        for (int k = 1; k <= STEPS; k++) {
            double sum = 0, work = 0;
            for (unsigned c = 0; c < p.count; c++)
                depth[c] = 0.02 * k / STEPS - start[c];
            push(&p, depth);
            for (unsigned c = 0; c < p.count; c++)
                sum += (double)p.set.contact[c].pressure_N;
            for (unsigned c = 0; c < p.count; c++)
                work += (double)p.linear.contact[c].pressure_N;
            stiffness = fmax(stiffness, work / depth[0] * (depth[0] > 2e-3)); /* of the linear force */
            assert_true(sum >= last * (1 - 1e-5));
            if (depth[0] > 2e-3)
                assert_true(sum - last < 6 * stiffness * 0.02 / STEPS + 1e-5 * last); /* a jump would be of any size */
            last = sum;
        }
        assert_true(p.effect.beyond > 0);
        press_close(&p);
    }
}

/* Round any closed way of the depths no work is left, as far as the trapezoidal rule and rounding tell. Where the correction changes
 * which contacts push, a third order may stay: as much as the square of its share of the force. */
static void closed_ways_do_no_work(void **state)
{
    (void)state;
    unsigned same = 0;
    double other = 0;
    random_seed("closed", 14);
    for (int trial = 0; trial < 40; trial++) {
        struct press p;
        enum { STEPS = 4000 };
        double depth[CONTACT_MAX], start[CONTACT_MAX], size[CONTACT_MAX], phase[CONTACT_MAX], last[CONTACT_MAX] = {0};
        double work = 0, spent = 0, before[CONTACT_MAX] = {0};
        press_open(&p, 0.05, trial % 2 ? 1 : 1e-5, 1e7, 2 + random_below(5));
        for (unsigned c = 0; c < p.count; c++)
            depth[c] = 1e-3;
        push(&p, depth);
        random_depths(&p, 0.03, start);
        set_range(&p, convex_range(&p));
        unsigned changed = 0;
        double share = 0;
        for (unsigned c = 0; c < p.count; c++) {
            size[c] = start[c] * random_range(0.05, 0.2);
            phase[c] = random_range(0, 6.283);
        }
        for (int k = 0; k <= STEPS; k++) {
            for (unsigned c = 0; c < p.count; c++)
                depth[c] = start[c] + size[c] * sin(6.283185307179586 * k / STEPS + phase[c]);
            push(&p, depth);
            changed += p.set.active != p.linear.active;
            share = fmax(share, fabs((double)p.effect.share[0]));
            for (unsigned c = 0; c < p.count; c++) {
                double now = (double)p.set.contact[c].pressure_N, part = (now + last[c]) / 2 * (depth[c] - before[c]);
                work += k > 0 ? part : 0;
                spent += k > 0 ? fabs(part) : 0;
                last[c] = now;
                before[c] = depth[c];
            }
        }
        same += changed == 0;
        other = fmax(other, changed ? fabs(work) / spent : 0);
        assert_true(fabs(work) < (changed ? share * share : 1e-5) * spent);
        press_close(&p);
    }
    print_message("# %u ways on one set of contacts; %.2f %% of the work at most where sets change\n", same,
                  100 * other);
    assert_true(same > 10);
}

static void damaged_sections_are_refused(void **state)
{
    (void)state;
    static const struct {
        unsigned word;
        uint32_t value;
        int status;
    } cases[] = {
        {0, 0, STATUS_BANK_NONFINITE},           {0, 0x7FC00000, STATUS_BANK_NONFINITE},
        {1, 1, STATUS_BANK_NONFINITE},           {4, 0xBF000000, STATUS_BANK_NONFINITE},
        {4, 0x7FC00000, STATUS_BANK_NONFINITE},  {4, 0x7F800000, STATUS_BANK_NONFINITE},
        {5, 0, STATUS_BANK_NONFINITE},           {5, 0x7FC00000, STATUS_BANK_NONFINITE},
        {12, 0x80000000, STATUS_BANK_NONFINITE},
    };
    static struct bank_cubic cubic[200];
    struct bank_fixture_options o = bank_fixture_default;
    struct bank_view view;
    size_t length;
    for (size_t v = 0; v < 200; v++)
        cubic[v] = (struct bank_cubic){.unit_m_N2 = 1, .range_J = 1};
    o.cubic = cubic;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        unsigned char *bytes = bank_fixture(&o, &length);
        assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
        memcpy(bytes + bank_fixture_section(bytes, BANK_NEOH)->offset + 4 * cases[k].word, &cases[k].value, 4);
        bank_fixture_seal(bytes, length);
        assert_int_equal(bank_view_open(&view, bytes, length), cases[k].status);
        assert_int_equal(view.fault_tag, BANK_NEOH);
        free(bytes);
    }
    unsigned char *bytes = bank_fixture(&o, &length);
    bank_fixture_section(bytes, BANK_NEOH)->count--;
    bank_fixture_seal(bytes, length);
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_BANK_LENGTH);
    free(bytes);
    o.friction_mu = 0.3; /* both: not yet */
    bytes = bank_fixture(&o, &length);
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_BANK_SECTION);
    assert_int_equal(view.fault_tag, BANK_NEOH);
    free(bytes);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_correction_is_the_gradient_of_its_potential),
        cmocka_unit_test(one_contact_is_exact_on_any_coupling),
        cmocka_unit_test(force_grows_with_depth_and_does_not_jump),
        cmocka_unit_test(closed_ways_do_no_work),
        cmocka_unit_test(damaged_sections_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
