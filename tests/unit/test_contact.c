/* The contact solver against the enumeration of all contact sets in double precision, and the assembled system against a
 * dense evaluation of the same compliance. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "bank_fixture.h"
#include "contact.h"
#include "random.h"

/* Gaussian elimination with pivoting on the subset; false when singular. */
static bool solve_double(const double *A, const double *d, unsigned m, unsigned set, double *p)
{
    unsigned index[16], n = 0;
    double M[16][17];
    for (unsigned i = 0; i < m; i++) {
        p[i] = 0;
        if (set >> i & 1)
            index[n++] = i;
    }
    for (unsigned i = 0; i < n; i++) {
        for (unsigned j = 0; j < n; j++)
            M[i][j] = A[index[i] * m + index[j]];
        M[i][n] = d[index[i]];
    }
    for (unsigned k = 0; k < n; k++) {
        unsigned best = k;
        for (unsigned i = k + 1; i < n; i++)
            if (fabs(M[i][k]) > fabs(M[best][k]))
                best = i;
        if (M[best][k] == 0)
            return false;
        for (unsigned j = 0; j <= n; j++) {
            double swap = M[k][j];
            M[k][j] = M[best][j];
            M[best][j] = swap;
        }
        for (unsigned i = k + 1; i < n; i++)
            for (unsigned j = n + 1; j-- > k;)
                M[i][j] -= M[i][k] / M[k][k] * M[k][j];
    }
    for (unsigned i = n; i-- > 0;) {
        double sum = M[i][n];
        for (unsigned j = i + 1; j < n; j++)
            sum -= M[i][j] * p[index[j]];
        p[index[i]] = sum / M[i][i];
    }
    return true;
}

/* The only p with p >= 0, A p - d >= 0, p.(A p - d) = 0. */
static void solve_by_enumeration(const double *A, const double *d, unsigned m, double *p)
{
    double best = INFINITY, q[16];
    for (unsigned set = 0; set < 1u << m; set++) {
        if (!solve_double(A, d, m, set, q))
            continue;
        double violation = 0;
        for (unsigned i = 0; i < m; i++) {
            double rest = -d[i];
            for (unsigned j = 0; j < m; j++)
                rest += A[i * m + j] * q[j];
            violation = fmax(violation, set >> i & 1 ? -q[i] * A[i * m + i] : -rest);
        }
        if (violation < best) {
            best = violation;
            memcpy(p, q, m * sizeof *p);
        }
    }
}

struct problem {
    unsigned m;
    double A[256], d[16];
    float Af[CONTACT_MAX][CONTACT_MAX], df[CONTACT_MAX];
};

/* Gram matrix of random vectors in `rank` dimensions plus epsilon: the fewer dimensions, the nearer to coincident. */
static void random_problem(struct problem *q, unsigned m, unsigned rank, double epsilon)
{
    double B[16][16];
    q->m = m;
    for (unsigned i = 0; i < m; i++)
        for (unsigned k = 0; k < rank; k++)
            B[i][k] = random_range(-1, 1) + (k == 0 ? 1.5 : 0); /* contacts of one tool push the same way */
    for (unsigned i = 0; i < m; i++) {
        q->d[i] = random_range(-2e-3, 20e-3);
        q->df[i] = (float)q->d[i];
        q->d[i] = q->df[i];
        for (unsigned j = 0; j < m; j++) {
            double sum = i == j ? epsilon : 0;
            for (unsigned k = 0; k < rank; k++)
                sum += 5e-3 * B[i][k] * B[j][k];
            q->Af[i][j] = (float)sum;
            q->A[i * m + j] = q->Af[i][j];
        }
    }
}

static void solver_agrees_with_the_enumeration_of_all_contact_sets(void **state)
{
    (void)state;
    random_seed("solver", 6);
    double worst = 0;
    unsigned most = 0;
    for (int n = 0; n < 20000; n++) {
        struct problem q;
        unsigned m = 1 + random_below(7);
        random_problem(&q, m, 1 + random_below(4), 1e-5);
        double want[16], sum = 0, wanted = 0, gap = 0;
        solve_by_enumeration(q.A, q.d, m, want);
        float p[CONTACT_MAX];
        uint32_t active = random_below(1u << m);
        bool cut;
        uint32_t factors =
            contact_solve((const float(*)[CONTACT_MAX])q.Af, q.df, m, CONTACT_MAX_FACTORS, &active, p, &cut);
        most = factors > most ? factors : most;
        assert_false(cut);
        /* The resultant is what the hand feels; the single pressures of coincident points are not determined. */
        for (unsigned i = 0; i < m; i++) {
            assert_true(p[i] >= 0);
            sum += p[i];
            wanted += want[i];
            double rest = -q.d[i];
            for (unsigned j = 0; j < m; j++)
                rest += q.A[i * m + j] * p[j];
            gap = fmax(gap, -rest);
        }
        assert_true(gap < 1e-6); /* no point sinks in by more than a micrometre of up to 20 mm */
        if (wanted > 0.01)
            worst = fmax(worst, fabs(sum - wanted) / wanted);
    }
    printf("# resultant against enumeration: %.3g relative; at most %u factorisations\n", worst, most);
    assert_true(worst < 1e-4); /* float32 with condition up to 1e4, forces of 0.1 to 10 N */
}

static void coincident_points_share_the_load_and_stay_finite(void **state)
{
    (void)state;
    for (unsigned m = 2; m <= CONTACT_MAX; m++) {
        struct problem q = {.m = m};
        for (unsigned i = 0; i < m; i++) {
            q.df[i] = 0.01f + 1e-4f * (float)(i % 2); /* a 0.1 mm contradiction at one place */
            for (unsigned j = 0; j < m; j++)
                q.Af[i][j] = 5e-3f + (i == j ? 5e-6f : 0);
        }
        float p[CONTACT_MAX], sum = 0;
        uint32_t active = 0;
        bool cut;
        contact_solve((const float(*)[CONTACT_MAX])q.Af, q.df, m, CONTACT_MAX_FACTORS, &active, p, &cut);
        assert_false(cut);
        for (unsigned i = 0; i < m; i++) {
            assert_true(isfinite(p[i]) && p[i] >= 0);
            sum += p[i];
        }
        assert_true(sum > 1.99f && sum < 2.03f); /* depth over compliance: 10.0..10.1 mm / 5 mm/N */
    }
}

static void full_sets_stop_within_the_bound_and_warm_starts_within_two(void **state)
{
    (void)state;
    random_seed("bound", 7);
    uint32_t most = 0, warm_most = 0;
    for (int n = 0; n < 20000; n++) {
        struct problem q;
        random_problem(&q, CONTACT_MAX, 2 + random_below(6), 5e-6);
        float p[CONTACT_MAX], again[CONTACT_MAX];
        uint32_t active = (uint32_t)random_bits();
        bool cut;
        uint32_t factors =
            contact_solve((const float(*)[CONTACT_MAX])q.Af, q.df, CONTACT_MAX, CONTACT_MAX_FACTORS, &active, p, &cut);
        assert_true(factors <= CONTACT_MAX_FACTORS);
        for (unsigned i = 0; i < CONTACT_MAX; i++)
            assert_true(isfinite(p[i]) && p[i] >= 0);
        most = factors > most ? factors : most;
        if (cut)
            continue;
        uint32_t warm = contact_solve((const float(*)[CONTACT_MAX])q.Af, q.df, CONTACT_MAX, CONTACT_MAX_FACTORS,
                                      &active, again, &cut);
        warm_most = warm > warm_most ? warm : warm_most;
    }
    printf("# 16 contacts: at most %u factorisations cold, %u from the last answer\n", most, warm_most);
    assert_true(warm_most <= 2);
}

/* The objective of the answer, 1/2 p.A p - d.p, in double. */
static double energy(const struct problem *q, const float *p)
{
    double sum = 0;
    for (unsigned i = 0; i < q->m; i++) {
        sum -= q->d[i] * p[i];
        for (unsigned j = 0; j < q->m; j++)
            sum += 0.5 * p[i] * q->A[i * q->m + j] * p[j];
    }
    return sum;
}

static void every_bound_of_steps_is_kept_and_more_steps_are_never_worse(void **state)
{
    (void)state;
    random_seed("steps", 9);
    unsigned cuts = 0;
    for (int n = 0; n < 2000; n++) {
        struct problem q;
        random_problem(&q, 2 + random_below(15), 2 + random_below(6), 5e-6);
        uint32_t first = (uint32_t)random_bits();
        double before = 0;
        for (uint32_t steps = 1; steps <= CONTACT_MAX_FACTORS; steps++) {
            float p[CONTACT_MAX];
            uint32_t active = first;
            bool cut;
            uint32_t factors = contact_solve((const float(*)[CONTACT_MAX])q.Af, q.df, q.m, steps, &active, p, &cut);
            assert_true(factors <= steps);
            for (unsigned i = 0; i < q.m; i++)
                assert_true(isfinite(p[i]) && p[i] >= 0);
            double after = energy(&q, p);
            /* rounding moves p by up to 2^-24 times the condition of 1e4, a thousandth of the energy */
            assert_true(after <= before + 1e-3 * fabs(before) + 1e-9);
            before = after;
            cuts += cut;
        }
    }
    printf("# %u answers were cut short\n", cuts);
    assert_true(cuts > 1000);
}

static void nothing_pushes_when_no_depth_is_positive(void **state)
{
    (void)state;
    struct problem q;
    random_problem(&q, 5, 3, 1e-5);
    for (unsigned i = 0; i < 5; i++)
        q.df[i] = -0.001f;
    float p[CONTACT_MAX];
    uint32_t active = 31;
    bool cut;
    contact_solve((const float(*)[CONTACT_MAX])q.Af, q.df, 5, CONTACT_MAX_FACTORS, &active, p, &cut);
    assert_false(cut);
    for (unsigned i = 0; i < 5; i++)
        assert_true(p[i] == 0);
}

/* The system that contact_update assembles, from the bank's blocks in double precision and plain loops. */
static void assembled_force_and_displacement_agree_with_a_dense_evaluation(void **state)
{
    (void)state;
    random_seed("assembly", 8);
    size_t length;
    unsigned char *bytes = bank_fixture(NULL, &length);
    struct bank_view bank;
    assert_int_equal(bank_view_open(&bank, bytes, length), STATUS_OK);
    static struct row_cache plain;
    assert_true(row_cache_start(&plain, &bank, NULL, 0));
    double epsilon = bank.contact->regularisation_m_N, k = bank.contact->coupling_stiffness_N_m, worst = 0, worst_u = 0;
    for (int n = 0; n < 300; n++) {
        unsigned m = 1 + random_below(8), split = random_below(m + 1); /* the points of two tools */
        struct collide points = {.count = m, .tool = {{.count = split}, {.first = split, .count = m - split}}};
        for (unsigned i = 0; i < m; i++) {
            struct collide_point *p = &points.point[i];
            double w1 = random_unit(), w2 = random_unit() * (1 - w1), length_n = 0;
            p->touching = true;
            p->triangle = random_below(bank.triangle_count);
            p->weights[1] = (float)w1, p->weights[2] = (float)w2, p->weights[0] = 1 - p->weights[1] - p->weights[2];
            p->depth_m = (float)random_range(1e-4, 5e-3);
            double normal[3];
            for (int a = 0; a < 3; a++) {
                normal[a] = random_range(-1, 1);
                length_n += normal[a] * normal[a];
            }
            for (int a = 0; a < 3; a++)
                p->normal[a] = (float)(normal[a] / sqrt(length_n));
        }
        static struct contact_set s;
        memset(&s, 0, sizeof s);
        contact_update(&s, &plain, &bank, &points);
        assert_int_equal(s.count, m);

        double g[8][8][3], A[64], d[8], p[16], force[2][3] = {{0}}, scale = 0;
        for (unsigned c = 0; c < m; c++)
            for (unsigned e = 0; e < m; e++) {
                const struct contact *at = &s.contact[c], *from = &s.contact[e];
                double own = 0;
                A[c * m + e] = 0;
                for (int a = 0; a < 3; a++) {
                    g[c][e][a] = 0;
                    for (int i = 0; i < 3; i++)
                        for (int j = 0; j < 3; j++) {
                            uint16_t row = bank.row_of[bank.triangles[at->triangle].vertex[i]];
                            uint16_t column = bank.row_of[bank.triangles[from->triangle].vertex[j]];
                            float block[9];
                            if (row == BANK_NONE || column == BANK_NONE)
                                continue;
                            bank_view_compliance(&bank, row, column, block);
                            for (int b = 0; b < 3; b++)
                                g[c][e][a] +=
                                    (double)at->weights[i] * from->weights[j] * block[3 * a + b] * from->normal[b];
                        }
                    own += at->normal[a] * g[c][e][a];
                    A[c * m + e] += at->normal[a] * g[c][e][a];
                    if ((c < split) == (e < split))
                        A[c * m + e] += at->normal[a] * from->normal[a] / k;
                }
                if (c == e)
                    A[c * m + e] += epsilon * fmax(1, own / bank.contact->typical_compliance_m_N);
                d[c] = at->depth_m;
            }
        solve_by_enumeration(A, d, m, p);
        for (unsigned c = 0; c < m; c++) {
            double u = 0, difference = 0;
            for (int a = 0; a < 3; a++) {
                force[c >= split][a] += p[c] * s.contact[c].normal[a];
                double want = -epsilon * p[c] * s.contact[c].normal[a];
                for (unsigned e = 0; e < m; e++)
                    want -= g[c][e][a] * p[e];
                u = fmax(u, fabs(want));
                difference = fmax(difference, fabs(want - s.contact[c].displacement_m[a]));
            }
            worst_u = fmax(worst_u, difference / fmax(u, 1e-4));
            scale += p[c];
        }
        for (int t = 0; t < 2; t++)
            for (int a = 0; a < 3; a++) {
                worst = fmax(worst, fabs(force[t][a] - s.force_N[t][a]) / fmax(scale, 1e-3));
                assert_true(fabs(s.proxy_offset_m[t][a] * k - s.force_N[t][a]) < 1e-5 * fmax(1, scale));
            }
    }
    printf("# single against double: force %.3g, displacement %.3g relative\n", worst, worst_u);
    assert_true(worst < 1e-4 && worst_u < 1e-3);
    free(bytes);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solver_agrees_with_the_enumeration_of_all_contact_sets),
        cmocka_unit_test(coincident_points_share_the_load_and_stay_finite),
        cmocka_unit_test(full_sets_stop_within_the_bound_and_warm_starts_within_two),
        cmocka_unit_test(every_bound_of_steps_is_kept_and_more_steps_are_never_worse),
        cmocka_unit_test(nothing_pushes_when_no_depth_is_positive),
        cmocka_unit_test(assembled_force_and_displacement_agree_with_a_dense_evaluation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
