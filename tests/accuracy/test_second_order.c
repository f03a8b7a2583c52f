/* The second-order correction against the neo-Hookean body that it expands: off by the third order only, at any site and in
 * any direction; and how far that carries, beside linear elasticity and a polynomial in the force that is fitted to one
 * compression [C97 3.4.2]. TROCAR_LONG=1: bodies of the thesis' size, a table. */
#include "patch.h"
#include "refine.h"
#include "second_order.h"
#include "second_order_surface.h"

#include <gsl/gsl_multifit.h>

static const double EPSILON = 1e-6; /* m/N: nothing beside the bodies' 1e-2 */

/* A tool's mean displacement, its three components. */
struct tool {
    struct nonlinear_rows rows;
    size_t start[4];
    uint32_t *vertex;
    double *weight, direction[9], normal[3];
};

static void tool_at(const struct specimen *s, uint32_t triangle, double radius, struct tool *tool)
{
    static const double middle[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};
    struct failure why;
    struct patch p;
    must(patch_create(&s->mesh, &s->surface, triangle, middle, radius, &p, &why), &why);
    *tool = (struct tool){.vertex = room(3 * p.count * sizeof(uint32_t)), .weight = room(3 * p.count * sizeof(double))};
    for (size_t r = 0; r < 3; r++) {
        tool->start[r + 1] = (r + 1) * p.count;
        tool->direction[4 * r] = 1;
        memcpy(tool->vertex + r * p.count, p.vertex, p.count * sizeof *p.vertex);
        memcpy(tool->weight + r * p.count, p.weight, p.count * sizeof *p.weight);
    }
    memcpy(tool->normal, p.normal, sizeof p.normal);
    tool->rows = (struct nonlinear_rows){3, tool->start, tool->vertex, tool->weight, tool->direction};
    patch_free(&p);
}

static void tool_free(struct tool *tool)
{
    free(tool->vertex);
    free(tool->weight);
}

static bool is_free(const struct specimen *s, uint32_t triangle, double radius)
{
    struct tool tool;
    tool_at(s, triangle, radius, &tool);
    bool good = true;
    for (size_t k = 0; k < tool.start[1]; k++)
        good = good && !model_fixed_vertices(s->model)[tool.vertex[k]];
    tool_free(&tool);
    return good;
}

static double apart(const double p[3], const double q[3])
{
    return sqrt(pow(p[0] - q[0], 2) + pow(p[1] - q[1], 2) + pow(p[2] - q[2], 2)) /
           sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
}

static void linear_force(const struct second_order *site, const double d[3], double p[3])
{
    for (int a = 0; a < 3; a++)
        p[a] = site->A[a][0] * d[0] + site->A[a][1] * d[1] + site->A[a][2] * d[2];
}

/* Halving the depth divides the linear error by 2 and the corrected one by 4. */
static void what_is_left_is_of_third_order(void **state)
{
    (void)state;
    for (int order = 0; order < 2; order++) {
        struct specimen s;
        struct failure why;
        struct nonlinear *n;
        uint64_t seed = 21;
        specimen_irregular(&s, 0.45, order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR, &seed);
        must(nonlinear_create(s.model, &n, &why), &why);
        double *u = room(model_unknowns(s.model) * sizeof *u);
        for (int site = 0; site < 3;) {
            uint32_t t = (uint32_t)(draw(&seed) * (double)s.surface.triangle_count);
            if (!is_free(&s, t, 0.04))
                continue;
            struct tool tool;
            struct second_order second;
            tool_at(&s, t, 0.04, &tool);
            must(second_order_find(s.model, 1, &tool.rows, EPSILON, &second, true, &why), &why);
            double direction[3], length = 0, error[2][2];
            for (int a = 0; a < 3; a++) {
                direction[a] = 2 * draw(&seed) - 1;
                length += direction[a] * direction[a];
            }
            for (int k = 0; k < 2; k++) {
                double depth = k ? 2.5e-4 : 5e-4, d[3], p[3] = {0}, linear[3], more[3];
                struct nonlinear_report report;
                memset(u, 0, model_unknowns(s.model) * sizeof *u);
                for (int a = 0; a < 3; a++)
                    d[a] = depth * direction[a] / sqrt(length);
                must(nonlinear_press(n, &tool.rows, EPSILON, d, u, p, &report, &why), &why);
                linear_force(&second, d, linear);
                second_order_force(&second, d, more);
                error[k][0] = apart(linear, p);
                for (int a = 0; a < 3; a++)
                    linear[a] += more[a];
                error[k][1] = apart(linear, p);
            }
            print_message("# order %d: linear %.2e, %.2e at half; second order %.2e, %.2e at half\n", order + 1,
                          error[0][0], error[1][0], error[0][1], error[1][1]);
            assert_true(error[0][1] < error[0][0] / 3);
            assert_true(fabs(error[0][0] / error[1][0] - 2) < 0.1);
            assert_true(fabs(error[0][1] / error[1][1] - 4) < 0.4);
            tool_free(&tool);
            site++;
        }
        free(u);
        nonlinear_free(n);
        specimen_free(&s);
    }
}

void openblas_set_num_threads(int threads); /* its header and GSL's do not agree */

enum { SITES_MAX = 6, DIRECTIONS = 5, DEPTHS = 3, DEGREE = 4, TRAINING = 6 };
static const double depth_share[DEPTHS] = {0.01, 0.02, 0.05};
static const char *const direction_name[DIRECTIONS] = {"pressed", "at 45 degrees", "sideways", "at 45 degrees out",
                                                       "pulled"};

/* Pressing, then turned away from it by 45 degrees each. */
static void direction_of(const double normal[3], int turn, double direction[3])
{
    double side[3], size = 0, angle = turn * acos(-1) / 4;
    int least = fabs(normal[0]) < fabs(normal[1]) ? (fabs(normal[0]) < fabs(normal[2]) ? 0 : 2)
                                                  : (fabs(normal[1]) < fabs(normal[2]) ? 1 : 2);
    for (int a = 0; a < 3; a++)
        side[a] = (a == least) - normal[least] * normal[a];
    for (int a = 0; a < 3; a++)
        size += side[a] * side[a];
    for (int a = 0; a < 3; a++)
        direction[a] = -cos(angle) * normal[a] + sin(angle) * side[a] / sqrt(size);
}

/* Q(f) = f + c2 f^2 + ... fitted to |force| over |linear force| of one compression. */
static void fit(const double *linear, const double *force, double c[DEGREE - 1])
{
    gsl_matrix *X = gsl_matrix_alloc(TRAINING, DEGREE - 1), *covariance = gsl_matrix_alloc(DEGREE - 1, DEGREE - 1);
    gsl_vector *y = gsl_vector_alloc(TRAINING), *b = gsl_vector_alloc(DEGREE - 1);
    gsl_multifit_linear_workspace *work = gsl_multifit_linear_alloc(TRAINING, DEGREE - 1);
    double chi;
    for (size_t k = 0; k < TRAINING; k++) {
        gsl_vector_set(y, k, force[k] - linear[k]);
        for (size_t j = 0; j < DEGREE - 1; j++)
            gsl_matrix_set(X, k, j, pow(linear[k], (double)j + 2));
    }
    gsl_multifit_linear(X, y, b, covariance, &chi, work);
    for (size_t j = 0; j < DEGREE - 1; j++)
        c[j] = gsl_vector_get(b, j);
    gsl_matrix_free(X);
    gsl_matrix_free(covariance);
    gsl_vector_free(y);
    gsl_vector_free(b);
    gsl_multifit_linear_free(work);
}

static double norm(const double p[3])
{
    return sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
}

struct table {
    double worst[3][DIRECTIONS][DEPTHS], mean[3][DIRECTIONS][DEPTHS];
};

static void compare(struct specimen *s, int sites, double extent_m, double radius_m, struct table *table)
{
    struct failure why;
    struct nonlinear *n;
    uint64_t seed = 3;
    double c[DEGREE - 1];
    *table = (struct table){0};
    must(nonlinear_create(s->model, &n, &why), &why);
    double *u = room(model_unknowns(s->model) * sizeof *u);
    for (int site = 0; site < sites;) {
        uint32_t t = (uint32_t)(draw(&seed) * (double)s->surface.triangle_count);
        if (!is_free(s, t, 2 * radius_m))
            continue;
        struct tool tool;
        struct second_order second;
        struct nonlinear_report report;
        tool_at(s, t, radius_m, &tool);
        must(second_order_find(s->model, 1, &tool.rows, EPSILON, &second, true, &why), &why);
        if (site == 0) { /* the training line */
            double linear[TRAINING], force[TRAINING], p[3] = {0};
            memset(u, 0, model_unknowns(s->model) * sizeof *u);
            for (int k = 0; k < TRAINING; k++) {
                double d[3], q[3];
                direction_of(tool.normal, 0, d);
                for (int a = 0; a < 3; a++)
                    d[a] *= extent_m * depth_share[DEPTHS - 1] * (k + 1) / TRAINING;
                must(nonlinear_press(n, &tool.rows, EPSILON, d, u, p, &report, &why), &why);
                linear_force(&second, d, q);
                linear[k] = norm(q);
                force[k] = norm(p);
            }
            fit(linear, force, c);
        }
        for (int turn = 0; turn < DIRECTIONS; turn++) {
            double p[3] = {0};
            memset(u, 0, model_unknowns(s->model) * sizeof *u);
            for (int k = 0; k < DEPTHS; k++) {
                double d[3], q[3][3], more[3], scale = 1;
                direction_of(tool.normal, turn, d);
                for (int a = 0; a < 3; a++)
                    d[a] *= extent_m * depth_share[k];
                must(nonlinear_press(n, &tool.rows, EPSILON, d, u, p, &report, &why), &why);
                linear_force(&second, d, q[0]);
                second_order_force(&second, d, more);
                for (int j = 0; j < DEGREE - 1; j++)
                    scale += c[j] * pow(norm(q[0]), j + 1);
                for (int a = 0; a < 3; a++) {
                    q[1][a] = scale * q[0][a];
                    q[2][a] = q[0][a] + more[a];
                }
                for (int way = 0; way < 3; way++) {
                    double error = apart(q[way], p);
                    table->mean[way][turn][k] += error / sites;
                    table->worst[way][turn][k] = fmax(table->worst[way][turn][k], error);
                }
            }
        }
        tool_free(&tool);
        site++;
    }
    free(u);
    nonlinear_free(n);
}

static void print(const char *name, int sites, const struct table *t)
{
    static const char *const way[3] = {"linear", "polynomial", "second order"};
    print_message("# %s: error of the force in %%, mean/worst of %d sites, at 1, 2 and 5 %% of the body's length\n",
                  name, sites);
    for (int turn = 0; turn < DIRECTIONS; turn++)
        for (int w = 0; w < 3; w++)
            print_message("#   %-18s %-13s %5.2f/%5.2f  %5.2f/%5.2f  %5.2f/%5.2f\n", w ? "" : direction_name[turn],
                          way[w], 100 * t->mean[w][turn][0], 100 * t->worst[w][turn][0], 100 * t->mean[w][turn][1],
                          100 * t->worst[w][turn][1], 100 * t->mean[w][turn][2], 100 * t->worst[w][turn][2]);
}

static bool data(struct specimen *s, const char *name, double extent_m)
{
    struct failure why;
    if (!specimen_data(s, name, 0.45))
        return false;
    must(mesh_scale(&s->mesh, extent_m, MESH_UNIT_NONE, &why), &why);
    specimen_clamp_end(s, 0, 0.12);
    s->scene.order = ELEMENT_QUADRATIC;
    specimen_model(s);
    return true;
}

static void it_carries_farther_than_a_polynomial(void **state)
{
    (void)state;
    struct specimen s;
    struct table t;
    int sites = getenv("TROCAR_LONG") ? SITES_MAX : 2;
    if (!data(&s, "liver_smooth_412_1336.msh", 0.13))
        skip();
    compare(&s, sites, 0.13, 0.02, &t);
    print("liver_smooth_412_1336 of 0.13 m, tool of 20 mm", sites, &t);
    for (int turn = 0; turn < DIRECTIONS; turn++)
        for (int k = 0; k < DEPTHS; k++) {
            assert_true(t.worst[2][turn][k] < t.worst[0][turn][k]);
            assert_true(t.worst[2][turn][k] < t.worst[1][turn][k]);
            /* what is left is a third order, of the size of the square of what the second brought */
            assert_true(t.worst[2][turn][k] < 3 * pow(t.worst[0][turn][k], 2));
        }
    specimen_free(&s);
    if (!getenv("TROCAR_LONG"))
        return;
    static const char *const large[] = {"cylinder_8x30x6.msh", "liver_smooth_1665_6691.msh"};
    for (int k = 0; k < 2; k++) {
        if (!data(&s, large[k], 0.28))
            continue;
        compare(&s, sites, 0.28, 0.02, &t);
        print(large[k], sites, &t);
        specimen_free(&s);
    }
}

/* Root mean square of T and of what interpolation leaves of it, over the free vertices and some directions. */
static double left_by(const struct second_order_surface *few, const struct second_order_surface *all)
{
    double difference = 0, size = 0;
    uint64_t seed = 4;
    for (size_t v = 0; v < all->vertices; v++)
        for (int k = 0; k < 6; k++) {
            struct second_order site = {.A = {{0}}};
            double f[3] = {2 * draw(&seed) - 1, 2 * draw(&seed) - 1, 2 * draw(&seed) - 1}, T[2];
            memcpy(site.cubic, few->cubic[v], sizeof site.cubic);
            T[0] = second_order_energy(&site, f);
            memcpy(site.cubic, all->cubic[v], sizeof site.cubic);
            T[1] = second_order_energy(&site, f);
            difference += (T[0] - T[1]) * (T[0] - T[1]);
            size += T[1] * T[1];
        }
    return sqrt(difference / size);
}

/* Cost is in proportion to the sites: three right-hand sides each and a pass over the elements. */
static void fewer_sites_leave_more(void **state)
{
    (void)state;
    enum { WAYS = 3 };
    static const size_t sites[WAYS] = {50, 100, 200};
    struct specimen s;
    struct failure why;
    struct second_order_surface all, few;
    double last = INFINITY;
    if (!data(&s, "liver_smooth_412_1336.msh", 0.13))
        skip();
    must(second_order_surface_find(s.model, &s.mesh, &s.surface, 0.01, 0, true, &all, &why), &why);
    print_message("# %zu vertices, %zu solved: the cubic energy of a tool of 10 mm\n", all.vertices, all.solved);
    for (int k = 0; k < WAYS; k++) {
        must(second_order_surface_find(s.model, &s.mesh, &s.surface, 0.01, sites[k], true, &few, &why), &why);
        double left = left_by(&few, &all);
        print_message("#   %3zu sites, %4zu solves: %.1f %% of it is lost between them\n", few.solved, 3 * few.solved,
                      100 * left);
        assert_true(few.solved <= sites[k] && left < last);
        last = left;
        second_order_surface_free(&few);
    }
    second_order_surface_free(&all);
    specimen_free(&s);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    openblas_set_num_threads(1); /* small factors: threads would wait for each other */
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_left_is_of_third_order),
        cmocka_unit_test(it_carries_farther_than_a_polynomial),
        cmocka_unit_test(fewer_sites_leave_more),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
