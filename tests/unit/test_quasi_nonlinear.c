/* The quasi-non-linear correction on the controller: the curve's force on any coupling against a root in double precision, the tangent
 * beyond its range, growth with depth, proportions; and damaged sections. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "random.h"
#include "tick_bench.h"

static const struct bank_quasi_nonlinear stiffening = {.sample_per_tool = 2,
                                                       .Q = {0.3f, {0.2f, 0.3f, -0.1f, 0, 0.05f}}};
static const struct bank_quasi_nonlinear softening = {.sample_per_tool = 0.5f, .Q = {0.1f, {0.12f, -0.06f, 0.01f}}};

/* The curve in double precision, term by term. */
static double curve(const struct bank_curve *c, double x)
{
    double s = x / (double)c->range, y = 0, slope = 0, at = fmin(s, 1);
    for (int k = 1; k <= BANK_CURVE_DEGREE; k++) {
        y += (double)c->coefficient[k - 1] * pow(at, k);
        slope += k * (double)c->coefficient[k - 1] * pow(at, k - 1);
    }
    return y + slope * (s - at);
}

struct press {
    unsigned char *bytes;
    struct bank_view bank;
    struct bank_contact contact; /* of the bank, changed by the test */
    struct row_cache rows;
    struct quasi_nonlinear effect;
    struct contact_set linear, set; /* of the last push: before and after the correction */
    unsigned count;
};

static void press_open(struct press *p, const struct bank_quasi_nonlinear *curves, double coupling_N_m, unsigned points)
{
    struct bank_fixture_options o = bank_fixture_default;
    size_t length;
    memset(p, 0, sizeof *p);
    o.curves = curves;
    p->bytes = bank_fixture(&o, &length);
    assert_int_equal(bank_view_open(&p->bank, p->bytes, length), STATUS_OK);
    p->contact = *p->bank.contact;
    p->contact.coupling_stiffness_N_m = (float)coupling_N_m;
    p->bank.contact = &p->contact;
    assert_true(row_cache_start(&p->rows, &p->bank, NULL, 0));
    p->count = points;
}

/* Triangles 7 apart around the top, one normal each. */
static void push(struct press *p, double depth_m)
{
    p->set.count = 0;
    for (uint32_t t = 0; t < p->bank.triangle_count && p->set.count < p->count; t += 3) {
        const uint16_t *v = p->bank.triangles[t].vertex;
        if (p->bank.normals[3 * v[0] + 2] < 0.7f)
            continue;
        struct contact *c = &p->set.contact[p->set.count];
        *c = (struct contact){.point = p->set.count,
                              .triangle = t,
                              .weights = {0.3f, 0.3f, 0.4f},
                              .depth_m = (float)(depth_m * (1 - 0.05 * p->set.count))};
        for (int a = 0; a < 3; a++)
            c->normal[a] = c->pull[0][a] = p->bank.normals[3 * v[0] + a];
        p->set.count++;
    }
    contact_assemble(&p->set, &p->rows, &p->bank);
    contact_push(&p->set, p->bank.contact);
    p->linear = p->set;
    quasi_nonlinear_correct(&p->effect, &p->bank, &p->set);
}

static double size(const float v[3])
{
    return sqrt((double)v[0] * (double)v[0] + (double)v[1] * (double)v[1] + (double)v[2] * (double)v[2]);
}

/* C q = d - p/k with p = Q(a q)/a: the root by bisection. */
static void one_contact_has_the_curves_force_on_any_coupling(void **state)
{
    (void)state;
    random_seed("curve", 21);
    unsigned beyond = 0;
    for (int trial = 0; trial < 300; trial++) {
        const struct bank_quasi_nonlinear *curves = trial % 2 ? &stiffening : &softening;
        struct press p;
        double depth = random_range(1e-5, 6e-3), k = exp(random_range(log(50), log(1e6)));
        press_open(&p, curves, k, 1);
        push(&p, depth);
        double C = (double)p.linear.system[0][0] - 1 / k, a = (double)curves->sample_per_tool, low = 0,
               high = depth / C;
        for (int turn = 0; turn < 100; turn++) {
            double q = (low + high) / 2;
            *(C * q + curve(&curves->Q, a * q) / a / k < depth ? &low : &high) = q;
        }
        double force = curve(&curves->Q, a * low) / a;
        beyond += p.effect.beyond;
        /* eight steps leave nothing of single precision's 1e-7 but where a coupling takes most of the depth: 1e-5 */
        assert_true(fabs(size(p.set.force_N[0]) - force) < 1e-5 * force + 1e-9);
        assert_true(fabs((double)p.set.contact[0].pressure_N - force) < 1e-5 * force + 1e-9);
        assert_true(fabs(size(p.effect.linear_N[0]) - size(p.linear.force_N[0])) == 0);
        assert_true(fabs(size(p.set.proxy_offset_m[0]) * k - force) < 1e-5 * force + 1e-9);
        free(p.bytes);
    }
    print_message("# %u of 300 beyond the range\n", beyond);
    assert_true(beyond > 30 && beyond < 270);
}

static void several_keep_their_proportions_and_force_grows(void **state)
{
    (void)state;
    for (int trial = 0; trial < 8; trial++) {
        struct press p;
        double last = 0, step = 1e-5;
        press_open(&p, trial % 2 ? &stiffening : &softening, 1200, 1 + (unsigned)trial);
        for (int k = 1; k < 600; k++) {
            push(&p, step * k);
            double force = size(p.set.force_N[0]), linear = size(p.linear.force_N[0]), sum[3] = {0};
            assert_true(force > last);
            if (k > 1) /* no jump: at most twice the first step's slope, */
                assert_true(force - last <
                            8 * force / k + 1e-6); /* as neither curve is steeper than 4 times its mean */
            for (uint32_t c = 0; c < p.set.count; c++)
                for (int a = 0; a < 3; a++)
                    sum[a] += (double)p.set.contact[c].pressure_N * (double)p.set.contact[c].normal[a];
            for (int a = 0; a < 3; a++)
                assert_true(fabs(sum[a] - (double)p.set.force_N[0][a]) < 1e-5 * force);
            for (uint32_t c = 0; c < p.set.count; c++)
                assert_true(fabs((double)p.set.contact[c].pressure_N * linear -
                                 (double)p.linear.contact[c].pressure_N * force) < 1e-5 * linear * force);
            last = force;
        }
        assert_true(p.effect.beyond > 0);
        free(p.bytes);
    }
}

static void damaged_sections_are_refused(void **state)
{
    (void)state;
    static const struct {
        unsigned word;
        uint32_t value;
    } cases[] = {
        {0, 2},
        {1, 0},
        {1, 0x7FC00000},
        {2, 0},
        {2, 0xBF000000},
        {2, 0x7F800000},
        {3, 0},
        {3, 0x7FC00000},
        {4, 0x7F800000},
        {5, 0xC1200000}, /* turns */
        {0, 1 /* no P */},
    };
    struct bank_fixture_options o = bank_fixture_default;
    struct bank_view view;
    size_t length;
    o.curves = &stiffening;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        unsigned char *bytes = bank_fixture(&o, &length);
        assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
        memcpy(bytes + bank_fixture_section(bytes, BANK_QNLC)->offset + 4 * cases[k].word, &cases[k].value, 4);
        bank_fixture_seal(bytes, length);
        assert_int_equal(bank_view_open(&view, bytes, length), STATUS_BANK_NONFINITE);
        assert_int_equal(view.fault_tag, BANK_QNLC);
        free(bytes);
    }
    unsigned char *bytes = bank_fixture(&o, &length);
    bank_fixture_section(bytes, BANK_QNLC)->count = 2;
    bank_fixture_seal(bytes, length);
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_BANK_LENGTH);
    free(bytes);
    o.grasp_slip_N = 1; /* both: not yet */
    bytes = bank_fixture(&o, &length);
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_BANK_SECTION);
    assert_int_equal(view.fault_tag, BANK_QNLC);
    free(bytes);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_contact_has_the_curves_force_on_any_coupling),
        cmocka_unit_test(several_keep_their_proportions_and_force_grows),
        cmocka_unit_test(damaged_sections_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
