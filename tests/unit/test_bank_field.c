/* The field that the host shows, against dense products with the whole compliance, and its behaviour on sets of contacts
 * that are nearly or exactly singular. */
#include <gsl/gsl_linalg.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <time.h>
#include <cmocka.h>

#include "bank.h"
#include "bank_fixture.h"
#include "random.h"

enum { MOST = 64 };

struct contacts {
    size_t count;
    uint32_t triangle[MOST];
    double weights[2 * MOST], displacement[3 * MOST];
};

static unsigned char *bytes;
static struct bank_view view;
static struct failure why;

static int setup(void **state)
{
    (void)state;
    size_t length;
    bytes = bank_fixture(NULL, &length);
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    free(bytes);
    return 0;
}

static void draw(struct contacts *c, size_t count)
{
    c->count = count;
    for (size_t k = 0; k < count; k++) {
        double a = random_unit(), b = random_unit();
        c->triangle[k] = random_below(view.triangle_count);
        c->weights[2 * k] = a + b > 1 ? 1 - a : a;
        c->weights[2 * k + 1] = a + b > 1 ? 1 - b : b;
        for (int a3 = 0; a3 < 3; a3++)
            c->displacement[3 * k + a3] = random_range(-0.005, 0.005);
    }
}

static double weight(const struct contacts *c, size_t k, int corner)
{
    return corner ? c->weights[2 * k + corner - 1] : 1 - c->weights[2 * k] - c->weights[2 * k + 1];
}

/* Interpolate a field at a contact; fixed vertices do not move. */
static void at_contact(const struct contacts *c, size_t k, const double *u, double out[3])
{
    for (int a = 0; a < 3; a++) {
        out[a] = 0;
        for (int i = 0; i < 3; i++)
            out[a] += weight(c, k, i) * u[3 * view.triangles[c->triangle[k]].vertex[i] + a];
    }
}

/* The whole compliance, 3 rows x 3 rows, and W, without any of the shortcuts. */
static void dense(const struct contacts *c, double *u, double *force)
{
    size_t n = 3 * view.row_count, m = 3 * c->count;
    gsl_matrix *G = gsl_matrix_alloc(n, n), *W = gsl_matrix_calloc(n, m), *GW = gsl_matrix_calloc(n, m),
               *A = gsl_matrix_calloc(m, m);
    for (uint32_t i = 0; i < view.row_count; i++)
        for (uint32_t j = 0; j < view.row_count; j++) {
            float block[9];
            bank_view_compliance(&view, i, j, block);
            for (int e = 0; e < 9; e++)
                gsl_matrix_set(G, 3 * i + e / 3, 3 * j + e % 3, (double)block[e]);
        }
    for (size_t k = 0; k < c->count; k++)
        for (int i = 0; i < 3; i++) {
            uint16_t row = view.row_of[view.triangles[c->triangle[k]].vertex[i]];
            for (int a = 0; row != BANK_NONE && a < 3; a++)
                *gsl_matrix_ptr(W, 3 * row + a, 3 * k + a) += weight(c, k, i);
        }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < m; j++)
            for (size_t k = 0; k < n; k++)
                *gsl_matrix_ptr(GW, i, j) += gsl_matrix_get(G, i, k) * gsl_matrix_get(W, k, j);
    for (size_t i = 0; i < m; i++)
        for (size_t j = 0; j < m; j++)
            for (size_t k = 0; k < n; k++)
                *gsl_matrix_ptr(A, i, j) += gsl_matrix_get(W, k, i) * gsl_matrix_get(GW, k, j);
    for (size_t i = 0; i < m; i++)
        *gsl_matrix_ptr(A, i, i) += (double)view.contact->regularisation_m_N;
    gsl_permutation *order = gsl_permutation_alloc(m);
    gsl_vector_const_view d = gsl_vector_const_view_array(c->displacement, m);
    gsl_vector_view p = gsl_vector_view_array(force, m);
    int sign;
    gsl_linalg_LU_decomp(A, order, &sign);
    gsl_linalg_LU_solve(A, order, &d.vector, &p.vector);
    memset(u, 0, 3 * view.vertex_count * sizeof *u);
    for (uint32_t v = 0; v < view.vertex_count; v++)
        for (int a = 0; view.row_of[v] != BANK_NONE && a < 3; a++)
            for (size_t k = 0; k < m; k++)
                u[3 * v + a] += gsl_matrix_get(GW, 3 * view.row_of[v] + a, k) * force[k];
    gsl_permutation_free(order);
    gsl_matrix_free(A);
    gsl_matrix_free(GW);
    gsl_matrix_free(W);
    gsl_matrix_free(G);
}

/* Largest difference over largest value. */
static double apart(const double *a, const double *b, size_t n)
{
    double difference = 0, size = 0;
    for (size_t k = 0; k < n; k++) {
        difference = fmax(difference, fabs(a[k] - b[k]));
        size = fmax(size, fabs(b[k]));
    }
    return difference / size;
}

/* Both are doubles from the same float32 blocks: the condition of A, below 2e4 by epsilon, times 2^-53 times the sizes. */
static void field_and_forces_are_those_of_the_whole_matrix(void **state)
{
    (void)state;
    random_seed("dense", 1);
    static const size_t counts[] = {1, 2, 3, 7, 16};
    double *u = malloc(3 * view.vertex_count * sizeof *u), *want = malloc(3 * view.vertex_count * sizeof *want);
    for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++) {
        struct contacts c;
        double force[3 * MOST], want_force[3 * MOST];
        draw(&c, counts[k]);
        assert_int_equal(field_from_contacts(&view, c.count, c.triangle, c.weights, c.displacement, u, force, &why), 0);
        dense(&c, want, want_force);
        assert_true(apart(force, want_force, 3 * c.count) < 1e-9);
        assert_true(apart(u, want, 3 * view.vertex_count) < 1e-9);
    }
    free(u);
    free(want);
}

/* u + epsilon p = d at every contact: the surface follows the contacts to within the declared pad. */
static void the_surface_follows_the_contacts(void **state)
{
    (void)state;
    random_seed("follow", 2);
    double *u = malloc(3 * view.vertex_count * sizeof *u), epsilon = (double)view.contact->regularisation_m_N;
    for (int round = 0; round < 50; round++) {
        struct contacts c;
        double force[3 * MOST], moved[3];
        draw(&c, 1 + random_below(16));
        assert_int_equal(field_from_contacts(&view, c.count, c.triangle, c.weights, c.displacement, u, force, &why), 0);
        for (size_t k = 0; k < c.count; k++) {
            at_contact(&c, k, u, moved);
            for (int a = 0; a < 3; a++)
                assert_true(fabs(moved[a] + epsilon * force[3 * k + a] - c.displacement[3 * k + a]) < 1e-12);
        }
        for (uint32_t v = 0; v < view.vertex_count; v++)
            for (int a = 0; a < 3; a++)
                assert_true(view.row_of[v] != BANK_NONE || u[3 * v + a] == 0);
    }
    free(u);
}

/* The same place many times, and depths that contradict each other: forces stay below |d| / epsilon, as theory says. */
static void coincident_and_contradicting_contacts_stay_bounded(void **state)
{
    (void)state;
    random_seed("coincident", 3);
    double *u = malloc(3 * view.vertex_count * sizeof *u), epsilon = (double)view.contact->regularisation_m_N;
    for (int round = 0; round < 50; round++) {
        struct contacts c;
        double force[3 * MOST], size = 0, pushed = 0;
        draw(&c, 2 + random_below(MOST - 1));
        for (size_t k = 1; k < c.count; k++) {
            c.triangle[k] = c.triangle[0];
            if (round % 2)
                memcpy(&c.weights[2 * k], c.weights, 2 * sizeof c.weights[0]);
        }
        assert_int_equal(field_from_contacts(&view, c.count, c.triangle, c.weights, c.displacement, u, force, &why), 0);
        for (size_t k = 0; k < 3 * c.count; k++) {
            size += c.displacement[k] * c.displacement[k];
            pushed += force[k] * force[k];
            assert_true(isfinite(force[k]));
        }
        assert_true(sqrt(pushed) <= 1.001 * sqrt(size) / epsilon);
        for (uint32_t v = 0; v < 3 * view.vertex_count; v++)
            assert_true(isfinite(u[v]));
    }
    free(u);
}

static void what_frames_may_bring_is_refused(void **state)
{
    (void)state;
    double *u = malloc(3 * view.vertex_count * sizeof *u), w[2] = {0.2, 0.2}, d[3] = {0, 0, 0.001};
    uint32_t t = view.triangle_count;
    assert_int_equal(field_from_contacts(&view, 0, NULL, NULL, NULL, u, NULL, &why), STATUS_OK);
    for (uint32_t v = 0; v < 3 * view.vertex_count; v++)
        assert_true(u[v] == 0);
    assert_int_equal(field_from_contacts(&view, 1, &t, w, d, u, NULL, &why), STATUS_BUS_FRAME);
    t = 0;
    d[1] = NAN;
    assert_int_equal(field_from_contacts(&view, 1, &t, w, d, u, NULL, &why), STATUS_BUS_FRAME);
    d[1] = 0;
    w[0] = INFINITY;
    assert_int_equal(field_from_contacts(&view, 1, &t, w, d, u, NULL, &why), STATUS_BUS_FRAME);
    w[0] = 0.2;
    assert_int_equal(field_from_contacts(&view, MOST + 1, &t, w, d, u, NULL, &why), STATUS_BUS_FRAME);
    free(u);
}

/* Processor time of the call at display rate, for the record: nothing is asserted about a clock. */
static void cost_is_printed(void **state)
{
    (void)state;
    random_seed("cost", 4);
    double *u = malloc(3 * view.vertex_count * sizeof *u);
    struct contacts c;
    clock_t started = clock();
    for (int round = 0; round < 200; round++) {
        draw(&c, 7);
        assert_int_equal(field_from_contacts(&view, 7, c.triangle, c.weights, c.displacement, u, NULL, &why), 0);
    }
    print_message("# %u vertices, 7 contacts: %.3f ms\n", view.vertex_count,
                  1e3 * (double)(clock() - started) / CLOCKS_PER_SEC / 200);
    free(u);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(field_and_forces_are_those_of_the_whole_matrix),
        cmocka_unit_test(the_surface_follows_the_contacts),
        cmocka_unit_test(coincident_and_contradicting_contacts_stay_bounded),
        cmocka_unit_test(what_frames_may_bring_is_refused),
        cmocka_unit_test(cost_is_printed),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
