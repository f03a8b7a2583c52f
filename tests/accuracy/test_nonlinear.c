/* The neo-Hookean reference against what is known of it: forces are the derivative of the energy and the tangent theirs, at
 * any deformation; rotations cost nothing; a bar stretches as the closed form says; a homogeneous deformation is an
 * equilibrium on an irregular mesh; small depths give the linear solver's forces; deep ones and inverted starts are found or
 * refused. */
#include "nonlinear.h"
#include "neo_hookean.h"
#include "space.h"
#include "specimen.h"

static const double EPSILON = 1e-7; /* m/N of a tool's spring: nothing beside the bodies' 1e-2 */

static uint32_t vertex_of(const struct specimen *s, uint32_t node)
{
    for (uint32_t v = 0; v < s->surface.vertex_count; v++)
        if (s->surface.node[v] == node)
            return v;
    fail_msg("node %u is not on the surface", node);
    return 0;
}

/* One element, pushed about at random but not inverted. */
static void forces_and_tangent_are_derivatives(void **state)
{
    (void)state;
    uint64_t seed = 11;
    for (int order = 0; order < 2; order++)
        for (int trial = 0; trial < 20; trial++) {
            double x[12] = {0, 0, 0, 0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01};
            static const uint32_t corner[4] = {0, 1, 2, 3};
            for (int i = 0; i < 12; i++)
                x[i] += 0.002 * (2 * draw(&seed) - 1);
            struct element e = element_geometry(x, corner);
            struct lame material = lame_from_young(4000, 0.3 + 0.19 * draw(&seed));
            enum element_order o = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
            size_t n = 3 * element_nodes(o), nodes = n / 3;
            double u[30], f[30], plus[30], minus[30], tangent[900], size = 0, stiff = 0;
            for (size_t i = 0; i < n; i++)
                u[i] = 0.0008 * (2 * draw(&seed) - 1);
            double energy = neo_hookean_element(&e, material, o, u, f, tangent, NULL);
            assert_true(isfinite(energy) && energy > 0);
            for (size_t i = 0; i < n; i++)
                size = fmax(size, fabs(f[i]));
            for (size_t i = 0; i < 9 * nodes * nodes; i++)
                stiff = fmax(stiff, fabs(tangent[i]));
            const double h = 1e-7; /* differences of order h^2 / 0.01^2, rounding 1e-16 0.01 / h: both below 1e-9 */
            for (size_t i = 0; i < n; i++) {
                double kept = u[i];
                u[i] = kept + h;
                double more = neo_hookean_element(&e, material, o, u, plus, NULL, NULL);
                u[i] = kept - h;
                double less = neo_hookean_element(&e, material, o, u, minus, NULL, NULL);
                u[i] = kept;
                assert_true(fabs((more - less) / (2 * h) - f[i]) < 1e-6 * size);
                for (size_t k = 0; k < n; k++) {
                    double entry = tangent[9 * (nodes * (k / 3) + i / 3) + 3 * (k % 3) + i % 3];
                    assert_true(fabs((plus[k] - minus[k]) / (2 * h) - entry) < 1e-6 * stiff);
                    assert_true(fabs(entry - tangent[9 * (nodes * (i / 3) + k / 3) + 3 * (i % 3) + k % 3]) <
                                1e-12 * stiff);
                }
            }
        }
}

static void a_rotation_costs_nothing_and_an_inversion_everything(void **state)
{
    (void)state;
    double x[12] = {0, 0, 0, 0.01, 0, 0, 0.002, 0.01, 0, 0.001, 0.003, 0.01}, u[30], f[30];
    static const uint32_t corner[4] = {0, 1, 2, 3};
    struct element e = element_geometry(x, corner);
    struct lame material = lame_from_young(4000, 0.45);
    double R[3][3] = {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}};
    for (size_t j = 0; j < 10; j++) {
        double at[3];
        for (int a = 0; a < 3; a++)
            at[a] = j < 4 ? x[3 * j + (size_t)a]
                          : (x[3 * element_edge[j - 4][0] + a] + x[3 * element_edge[j - 4][1] + a]) / 2;
        for (int a = 0; a < 3; a++)
            u[3 * j + (size_t)a] = R[a][0] * at[0] + R[a][1] * at[1] + R[a][2] * at[2] - at[a];
    }
    for (int order = 0; order < 2; order++) {
        enum element_order o = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        assert_true(fabs(neo_hookean_element(&e, material, o, u, f, NULL, NULL)) < 1e-14 * 4000 * 1e-6);
        for (size_t i = 0; i < 3 * element_nodes(o); i++)
            assert_true(fabs(f[i]) < 1e-13 * 4000 * 1e-4);
        double flat[30];
        for (size_t i = 0; i < 30; i++)
            flat[i] = i % 3 == 2 ? -0.03 * (i == 11 || i / 3 == 6 || i / 3 >= 8) : 0;
        assert_true(isinf(neo_hookean_element(&e, material, o, flat, NULL, NULL, NULL)));
    }
}

/* Lateral stretch of a bar pulled to `stretch`, its sides free: mu (b^2 - 1) + lambda ln(stretch b^2) = 0. */
static double lateral(struct lame m, double stretch)
{
    double low = 0.3, high = 3;
    for (int k = 0; k < 200; k++) {
        double b = (low + high) / 2;
        *(m.mu_Pa * (b * b - 1) + m.lambda_Pa * log(stretch * b * b) > 0 ? &high : &low) = b;
    }
    return low;
}

static struct nonlinear_rows rows_of(const struct specimen *s, size_t count, const uint32_t *node, size_t *start,
                                     uint32_t *vertex, double *weight, double *direction, int axis)
{
    for (size_t r = 0; r < count; r++) {
        start[r] = r;
        vertex[r] = vertex_of(s, node[r]);
        weight[r] = 1;
        for (int a = 0; a < 3; a++)
            direction[3 * r + (size_t)a] = a == axis;
    }
    start[count] = count;
    return (struct nonlinear_rows){count, start, vertex, weight, direction};
}

/* A bar on rollers, its far end moved along by prescribed displacements of its nodes: force = area mu (s - 1/s) +
 * area lambda ln(s b^2)/s, also where it is compressed to six tenths. */
static void a_bar_stretches_as_the_closed_form_says(void **state)
{
    (void)state;
    static const double stretch[] = {0.6, 0.8, 1.25, 1.8};
    const double L = 0.06, W = 0.02, nu = 0.4;
    for (size_t k = 0; k < 4; k++) {
        struct specimen s;
        struct failure why;
        uint64_t seed = 3;
        specimen_block(&s, 3, 2, 2, L, W, W);
        specimen_shake(&s, 0.15, 0.01, &seed);
        specimen_material(&s, "all", 4000, nu);
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "x");
        specimen_fix(&s, box(0, 0, 0, 1, 0, 1), "y");
        specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "z");
        specimen_model(&s);
        struct nonlinear *n;
        must(nonlinear_create(s.model, &n, &why), &why);
        uint32_t node[9], vertex[9];
        size_t start[10], count = 0;
        double weight[9], direction[27], d[9], p[9] = {0}, total = 0;
        for (uint32_t i = 0; i < s.mesh.node_count; i++)
            if (s.mesh.nodes[3 * i] > L - 1e-9)
                node[count++] = i;
        assert_int_equal(count, 9);
        struct nonlinear_rows rows = rows_of(&s, count, node, start, vertex, weight, direction, 0);
        double *u = room(model_unknowns(s.model) * sizeof *u);
        struct nonlinear_report report;
        for (size_t r = 0; r < count; r++)
            d[r] = (stretch[k] - 1) * L;
        must(nonlinear_press(n, &rows, EPSILON, d, u, p, &report, &why), &why);
        for (size_t r = 0; r < count; r++)
            total += p[r];
        struct lame m = lame_from_young(4000, nu);
        double b = lateral(m, stretch[k]), x = stretch[k];
        double force = W * W * (m.mu_Pa * (x - 1 / x) + m.lambda_Pa * log(x * b * b) / x);
        print_message("# stretched to %.2f: %.6f N, closed form %.6f N, %zu iterations in %zu parts\n", x, total, force,
                      report.iterations, report.parts);
        /* the tool's springs give way by epsilon p, some 1e-6 of the length */
        assert_true(fabs(total / force - 1) < 1e-5);
        assert_true(fabs(report.least_volume - x * b * b) < 1e-5);
        nonlinear_free(n);
        free(u);
        specimen_free(&s);
    }
}

/* Sticking tools at three points of an irregular body, whose depth goes to 0: model_constrained. The difference falls with
 * the depth, so what is left at 1e-3 of a tenth of a percent is the second order. */
static void small_depths_give_the_linear_forces(void **state)
{
    (void)state;
    for (int order = 0; order < 2; order++) {
        struct specimen s;
        struct failure why;
        uint64_t seed = 5;
        memset(&s, 0, sizeof s);
        specimen_block(&s, 4, 3, 3, 0.1, 0.08, 0.08);
        specimen_shake(&s, 0.2, 0.025, &seed);
        specimen_material(&s, "all", 4000, 0.45);
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
        s.scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        s.scene.ligament_count = 1;
        s.scene.ligament[0] = (struct scene_ligament){
            .where = box(0, 0, 0.08, 1, 1, 0.08), .stiffness_N_m = 30, .direction = {0.6, 0, 0.8}};
        specimen_model(&s);
        struct nonlinear *n;
        must(nonlinear_create(s.model, &n, &why), &why);
        uint32_t vertex[9], three[27];
        size_t start[10];
        double weight[9], threes[27] = {0}, direction[27] = {0}, d[9], p[9], linear[9];
        for (size_t r = 0; r < 9; r++) {
            uint32_t v = (uint32_t)(7 + 11 * (r / 3)) % s.surface.vertex_count;
            while (model_fixed_vertices(s.model)[v])
                v++;
            start[r] = r;
            vertex[r] = three[3 * r] = three[3 * r + 1] = three[3 * r + 2] = v;
            weight[r] = threes[3 * r] = 1;
            direction[3 * r + r % 3] = 1;
        }
        start[9] = 9;
        struct nonlinear_rows rows = {9, start, vertex, weight, direction};
        double *u = room(model_unknowns(s.model) * sizeof *u), last = INFINITY;
        for (double depth = 1e-4; depth > 1e-7; depth /= 10) {
            struct nonlinear_report report;
            double apart = 0, size = 0;
            memset(u, 0, model_unknowns(s.model) * sizeof *u);
            memset(p, 0, sizeof p);
            for (size_t r = 0; r < 9; r++)
                d[r] = depth * (r % 2 ? 1 : -0.7);
            must(nonlinear_press(n, &rows, EPSILON, d, u, p, &report, &why), &why);
            must(model_constrained(s.model, 9, three, threes, direction, EPSILON, d, linear, NULL, &why), &why);
            for (size_t r = 0; r < 9; r++) {
                apart += (p[r] - linear[r]) * (p[r] - linear[r]);
                size += linear[r] * linear[r];
            }
            apart = sqrt(apart / size);
            print_message("# order %d, %g m: forces differ by %.1e (%zu iterations)\n", order + 1, depth, apart,
                          report.iterations);
            assert_true(apart < 20 * depth / 0.025); /* second order: strain, of depth over an element's size */
            assert_true(apart < 0.2 * last);
            last = apart;
        }
        assert_true(last < 1e-4);
        nonlinear_free(n);
        free(u);
        specimen_free(&s);
    }
}

/* u = (F - I) x on the whole boundary of an irregular block: the inside follows, and every J is det F. */
static void a_homogeneous_deformation_is_an_equilibrium(void **state)
{
    (void)state;
    static const double G[3][3] = {{0.15, 0.3, -0.1}, {0, -0.2, 0.25}, {0, 0, 0.1}};
    double F[3][3];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            F[a][b] = G[a][b] + (a == b);
    double J = F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1]) - F[0][1] * (F[1][0] * F[2][2] - F[1][2] * F[2][0]) +
               F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
    for (int order = 0; order < 2; order++) {
        struct specimen s;
        struct failure why;
        uint64_t seed = 9;
        specimen_block(&s, 3, 3, 3, 0.03, 0.03, 0.03);
        specimen_shake(&s, 0.25, 0.01, &seed);
        specimen_material(&s, "all", 4000, 0.45);
        specimen_fix(&s, box(0, 0, 0, 0, 0, 0), "xyz");
        specimen_fix(&s, box(0.03, 0, 0, 0.03, 0, 0), "yz");
        specimen_fix(&s, box(0, 0.03, 0, 0, 0.03, 0), "z");
        s.scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        specimen_model(&s);
        struct nonlinear *n;
        must(nonlinear_create(s.model, &n, &why), &why);
        size_t unknowns = model_unknowns(s.model);
        double *u = room(unknowns * sizeof *u), *f = room(unknowns * sizeof *f), most = 0, inside = 0;
        struct space space;
        must(space_create(&s.mesh, s.scene.order, &space, &why), &why);
        for (size_t i = 0; i < 3 * space.node_count; i++) {
            uint32_t ends[2];
            space_ends(&space, i / 3, ends);
            int32_t unknown = model_unknown(s.model, i / 3, (int)(i % 3));
            for (int b = 0; b < 3 && unknown >= 0; b++)
                u[unknown] +=
                    G[i % 3][b] * (s.mesh.nodes[3 * ends[0] + (size_t)b] + s.mesh.nodes[3 * ends[1] + (size_t)b]) / 2;
        }
        assert_true(nonlinear_force(n, u, f));
        for (size_t i = 0; i < 3 * space.node_count; i++) {
            uint32_t ends[2];
            space_ends(&space, i / 3, ends);
            int32_t unknown = model_unknown(s.model, i / 3, (int)(i % 3));
            bool within = true;
            for (int b = 0; b < 3; b++) {
                double x = (s.mesh.nodes[3 * ends[0] + (size_t)b] + s.mesh.nodes[3 * ends[1] + (size_t)b]) / 2;
                within = within && x > 1e-9 && x < 0.03 - 1e-9;
            }
            if (unknown < 0)
                continue;
            most = fmax(most, fabs(f[unknown]));
            inside = within ? fmax(inside, fabs(f[unknown])) : inside;
        }
        print_message("# order %d: J %.4f, force inside %.1e of %.1e N at the boundary\n", order + 1, J, inside, most);
        assert_true(inside < 1e-12 * most);
        space_free(&space);
        nonlinear_free(n);
        free(f);
        free(u);
        specimen_free(&s);
    }
}

static void what_cannot_be_is_refused(void **state)
{
    (void)state;
    struct specimen s;
    struct failure why;
    specimen_block(&s, 2, 2, 2, 0.02, 0.02, 0.02);
    specimen_material(&s, "all", 4000, 0.45);
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    specimen_model(&s);
    struct nonlinear *n;
    must(nonlinear_create(s.model, &n, &why), &why);
    uint32_t node[9], vertex[9];
    size_t start[10], count = 0;
    double weight[9], direction[27], d[9], p[9] = {0};
    for (uint32_t i = 0; i < s.mesh.node_count; i++)
        if (s.mesh.nodes[3 * i] > 0.02 - 1e-9)
            node[count++] = i;
    struct nonlinear_rows rows = rows_of(&s, count, node, start, vertex, weight, direction, 0);
    double *u = room(model_unknowns(s.model) * sizeof *u);
    struct nonlinear_report report;
    for (size_t r = 0; r < count; r++)
        d[r] = -0.03; /* through its own support, held by springs so stiff that it cannot stay outside */
    assert_int_equal(nonlinear_press(n, &rows, 1e-12, d, u, p, &report, &why), STATUS_MODEL_NONLINEAR);
    for (size_t i = 0; i < model_unknowns(s.model); i++)
        assert_true(isfinite(u[i]));
    assert_true(nonlinear_force(n, u, u));
    nonlinear_free(n);
    free(u);
    specimen_free(&s);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forces_and_tangent_are_derivatives),
        cmocka_unit_test(a_rotation_costs_nothing_and_an_inversion_everything),
        cmocka_unit_test(a_bar_stretches_as_the_closed_form_says),
        cmocka_unit_test(a_homogeneous_deformation_is_an_equilibrium),
        cmocka_unit_test(small_depths_give_the_linear_forces),
        cmocka_unit_test(what_cannot_be_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
