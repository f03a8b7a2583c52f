/* The reference of the comparison is itself compared: its complementarity solver with the enumeration of every set, and
 * its record of a run with what it promises. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fem_force.h"

static uint32_t random_state = 20240607;

static double uniform(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) / 16777216.0;
}

/* Gauss with pivoting on at most 8 unknowns. */
static void solve(uint32_t n, double *a, double *b)
{
    for (uint32_t k = 0; k < n; k++) {
        uint32_t best = k;
        for (uint32_t i = k + 1; i < n; i++)
            best = fabs(a[n * i + k]) > fabs(a[n * best + k]) ? i : best;
        for (uint32_t j = 0; j < n; j++) {
            double t = a[n * k + j];
            a[n * k + j] = a[n * best + j];
            a[n * best + j] = t;
        }
        double t = b[k];
        b[k] = b[best];
        b[best] = t;
        for (uint32_t i = k + 1; i < n; i++) {
            double f = a[n * i + k] / a[n * k + k];
            for (uint32_t j = k; j < n; j++)
                a[n * i + j] -= f * a[n * k + j];
            b[i] -= f * b[k];
        }
    }
    for (uint32_t k = n; k-- > 0;) {
        for (uint32_t j = k + 1; j < n; j++)
            b[k] -= a[n * k + j] * b[j];
        b[k] /= a[n * k + k];
    }
}

/* The one set whose forces are not negative and whose other contacts do not penetrate. */
static void enumerate(uint32_t m, const double *A, const double *d, double *p)
{
    double best = INFINITY;
    for (uint32_t set = 0; set < 1u << m; set++) {
        uint32_t index[8], n = 0;
        double a[64], b[8], q[8] = {0}, worst = 0;
        for (uint32_t i = 0; i < m; i++)
            if (set >> i & 1)
                index[n++] = i;
        for (uint32_t i = 0; i < n; i++) {
            b[i] = d[index[i]];
            for (uint32_t j = 0; j < n; j++)
                a[n * i + j] = A[m * index[i] + index[j]];
        }
        solve(n, a, b);
        for (uint32_t i = 0; i < n; i++)
            q[index[i]] = b[i];
        for (uint32_t i = 0; i < m; i++) {
            double w = -d[i];
            for (uint32_t j = 0; j < m; j++)
                w += A[m * i + j] * q[j];
            worst = fmax(worst, fmax(-q[i] * A[m * i + i], -w)); /* both in m */
        }
        if (worst < best) {
            best = worst;
            memcpy(p, q, m * sizeof *p);
        }
    }
}

static void solver_agrees_with_enumeration(void **state)
{
    (void)state;
    print_message("# seed %u\n", random_state);
    double worst = 0;
    for (int n = 0; n < 3000; n++) {
        uint32_t m = 1 + (uint32_t)(uniform() * 8) % 8;
        double B[64], A[64], d[8], p[8], q[8], largest = 0;
        /* Gram matrix of few vectors (contacts of one triangle) plus epsilon: as ill-conditioned as contacts are */
        uint32_t rank = 1 + (uint32_t)(uniform() * m);
        for (uint32_t i = 0; i < m * rank; i++)
            B[i] = 2 * uniform() - 1;
        for (uint32_t i = 0; i < m; i++) {
            d[i] = uniform() - 0.2;
            for (uint32_t j = 0; j < m; j++) {
                A[m * i + j] = i == j ? 1e-3 : 0;
                for (uint32_t k = 0; k < rank; k++)
                    A[m * i + j] += B[rank * i + k] * B[rank * j + k];
            }
        }
        struct failure why = {0};
        assert_int_equal(fem_complementarity(m, A, d, p, &why), STATUS_OK);
        enumerate(m, A, d, q);
        for (uint32_t i = 0; i < m; i++)
            largest = fmax(largest, fabs(q[i]));
        for (uint32_t i = 0; i < m; i++)
            worst = fmax(worst, fabs(p[i] - q[i]) / (largest > 0 ? largest : 1));
    }
    print_message("# largest difference %.1e\n", worst);
    /* condition at most trace/epsilon = 8e3: rounding of two direct solves, 1e4 x 1e-16, with a margin */
    assert_true(worst < 1e-10);
}

static void no_depth_is_no_force(void **state)
{
    (void)state;
    const double A[4] = {1, 0.5, 0.5, 1}, d[2] = {-1, -0.5};
    double p[2];
    struct failure why = {0};
    assert_int_equal(fem_complementarity(2, A, d, p, &why), STATUS_OK);
    assert_true(p[0] == 0 && p[1] == 0);
    assert_int_equal(fem_complementarity(0, A, d, p, &why), STATUS_OK);
}

/* 8 to 16 samples at equal distance however long the run, and the peak wherever it was. */
static void record_spreads_over_a_run_of_any_length(void **state)
{
    (void)state;
    static const uint64_t lengths[] = {1, 7, 15, 16, 17, 31, 33, 1000, 4097, 100000};
    for (size_t n = 0; n < sizeof lengths / sizeof lengths[0]; n++) {
        struct fem_record record;
        struct contact_set set = {.count = 1};
        fem_record_start(&record, 0);
        for (uint64_t t = 0; t < lengths[n]; t++) {
            set.force_N[0][0] = t == lengths[n] * 2 / 3 ? 5.0f : 1.0f;
            fem_record_tick(&record, &set, NULL, NULL, 10 + t);
        }
        assert_int_equal(record.contact_ticks, lengths[n]);
        assert_int_equal(record.peak[0].tick, 10 + lengths[n] * 2 / 3);
        assert_true(record.count <= FEM_SPREAD);
        assert_true(lengths[n] < 8 ? record.count == lengths[n] : record.count >= 8);
        for (size_t i = 0; i < record.count; i++)
            assert_int_equal(record.sample[i].tick, 10 + i * record.stride);
        assert_true(record.count * record.stride >= lengths[n]);
        fem_record_free(&record);
    }
    struct fem_record record;
    struct contact_set set = {.count = 1}, none = {0};
    fem_record_start(&record, 3);
    for (uint64_t t = 0; t < 100; t++) {
        fem_record_tick(&record, &none, NULL, NULL, t);
        fem_record_tick(&record, &set, NULL, NULL, t);
    }
    assert_int_equal(record.count, 34);
    fem_record_free(&record);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solver_agrees_with_enumeration),
        cmocka_unit_test(no_depth_is_no_force),
        cmocka_unit_test(record_spreads_over_a_run_of_any_length),
    };
    return cmocka_run_group_tests_name("force by full finite elements", tests, NULL, NULL);
}
