/* Quadratic tetrahedra and their projection on the shown surface, against closed forms. */
#include "hooke.h"
#include "model_state.h"
#include "specimen.h"

static void position(const struct space *space, size_t node, double x[3])
{
    uint32_t ends[2];
    space_ends(space, node, ends);
    for (size_t a = 0; a < 3; a++)
        x[a] = (space->mesh->nodes[3 * (size_t)ends[0] + a] + space->mesh->nodes[3 * (size_t)ends[1] + a]) / 2;
}

/* Stiffness of one element in Voigt form, with shape functions differentiated by central differences (exact for degree 2
 * but for rounding) and the 4-point rule of degree 2: another way from shape to number. */
static double shape_function(size_t node, const double L[4])
{
    return node < 4 ? L[node] * (2 * L[node] - 1) : 4 * L[element_edge[node - 4][0]] * L[element_edge[node - 4][1]];
}

static void voigt_element(const struct element *e, double E_Pa, double nu, double Ke[30][30])
{
    const double a = 0.1381966011250105, b = 0.5854101966249685; /* (5 -+ sqrt 5) / 20 */
    double D[6][6] = {{0}}, scale = E_Pa / ((1 + nu) * (1 - 2 * nu)), lambda = scale * nu, volume[30] = {0};
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            D[i][j] = i < 3 && j < 3 ? scale * (i == j ? 1 - nu : nu) : i == j ? scale * (1 - 2 * nu) / 2 : 0;
    memset(Ke, 0, 900 * sizeof(double));
    for (int point = 0; point < 4; point++) {
        double B[6][30] = {{0}};
        for (size_t n = 0; n < 10; n++) {
            double g[3] = {0, 0, 0};
            for (int c = 0; c < 4; c++) { /* dN/dL_c, taking the four coordinates as independent */
                double up[4], down[4], h = 0.125;
                for (int k = 0; k < 4; k++)
                    up[k] = down[k] = k == point ? b : a;
                up[c] += h;
                down[c] -= h;
                for (int k = 0; k < 3; k++)
                    g[k] += (shape_function(n, up) - shape_function(n, down)) / (2 * h) * e->shape_1_m[c][k];
            }
            for (int k = 0; k < 3; k++) {
                B[k][3 * n + (size_t)k] = g[k];
                B[3 + k][3 * n + (size_t)((k + 1) % 3)] = g[k]; /* shears xy, yz, zx */
                B[3 + k][3 * n + (size_t)k] = g[(k + 1) % 3];
            }
        }
        for (int i = 0; i < 30; i++)
            for (int j = 0; j < 30; j++)
                for (int p = 0; p < 6; p++)
                    for (int q = 0; q < 6; q++)
                        Ke[i][j] += e->volume_m3 / 4 * B[p][i] * (D[p][q] - (p < 3 && q < 3) * lambda) * B[q][j];
        for (int i = 0; i < 30; i++)
            volume[i] += (B[0][i] + B[1][i] + B[2][i]) / 4;
    }
    for (int i = 0; i < 30; i++) /* the change of volume in the mean */
        for (int j = 0; j < 30; j++)
            Ke[i][j] += e->volume_m3 * lambda * volume[i] * volume[j];
}

static void element_stiffness_equals_a_quadrature_of_the_strains(void **state)
{
    (void)state;
    uint64_t seed = 3;
    double worst = 0;
    for (int trial = 0; trial < 20; trial++) {
        double x[12];
        for (int i = 0; i < 12; i++)
            x[i] = draw(&seed);
        struct element e = element_geometry(x, (const uint32_t[]){0, 1, 2, 3});
        if (e.volume_m3 < 0)
            e = element_geometry(x, (const uint32_t[]){0, 1, 3, 2});
        if (e.volume_m3 < 0.01)
            continue;
        double nu = trial % 2 ? 0.45 : 0.1, Ke[30][30], top = 0;
        struct hooke hooke = hooke_isotropic(4000, nu);
        voigt_element(&e, 4000, nu, Ke);
        for (size_t i = 0; i < 30; i++)
            top = fmax(top, Ke[i][i]);
        for (size_t j = 0; j < 10; j++)
            for (size_t k = 0; k < 10; k++) {
                double block[9] = {0};
                element_add_block(&e, &hooke, ELEMENT_QUADRATIC, j, k, block);
                for (size_t i = 0; i < 9; i++)
                    worst = fmax(worst, fabs(block[i] - Ke[3 * j + i / 3][3 * k + i % 3]) / top);
            }
    }
    print_message("# largest difference %.1e of the largest entry\n", worst);
    assert_true(worst < 1e-13); /* some hundred roundings of 1.1e-16 */
}

/* Energy of the variation of the pressure within the elements under pure bending, tr eps = (1 - 2 nu) y: lambda/2 times its
 * square, whose mean over a tetrahedron is that of its corners' deviations over 20. */
static double pressure_variation(const struct mesh *mesh, struct lame material, double nu)
{
    double sum = 0;
    for (size_t t = 0; t < mesh->tetrahedron_count; t++) {
        double y[4], mean = 0, square = 0;
        for (size_t k = 0; k < 4; k++) {
            y[k] = mesh->nodes[3 * (size_t)mesh->tetrahedra[4 * t + k] + 1];
            mean += y[k] / 4;
        }
        for (size_t k = 0; k < 4; k++)
            square += (y[k] - mean) * (y[k] - mean) / 20;
        sum += element_geometry(mesh->nodes, mesh->tetrahedra + 4 * t).volume_m3 * square;
    }
    return material.lambda_Pa / 2 * (1 - 2 * nu) * (1 - 2 * nu) * sum;
}

/* Pure bending [u = kappa (x y, -(x^2 + nu (y^2 - z^2)) / 2, -nu y z)] has a quadratic displacement and no load but on the
 * ends: at nu = 0 quadratic elements must carry it without a residual; linear ones leave one. At nu = 0.45 they lack the
 * energy of the pressure's variation within each, and nothing else. */
static void pure_bending_is_carried_but_for_the_pressure_within_elements(void **state)
{
    (void)state;
    uint64_t seed = 11;
    for (int round = 0; round < 3; round++) {
        const int order = round > 0;
        const double nu = round == 1 ? 0 : 0.45;
        struct specimen s;
        specimen_block(&s, 5, 4, 4, 0.25, 0.2, 0.2);
        specimen_shake(&s, 0.2, 0.05, &seed);
        specimen_material(&s, "all", 4000, nu);
        /* held so loosely that K remains what it is */
        s.scene.ligament_count = 3;
        for (int a = 0; a < 3; a++) {
            s.scene.ligament[a].where = box(0, 0, 0, 1, 1, 1);
            s.scene.ligament[a].stiffness_N_m = 1e-14;
            s.scene.ligament[a].direction[a] = 1;
        }
        s.scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        specimen_model(&s);
        const struct space *space = &s.model->space;
        size_t n = model_unknowns(s.model);
        assert_int_equal(n, 3 * space->node_count);
        double *u = room(n * sizeof *u), *f = room(n * sizeof *f), inside = 0, ends = 0, energy = 0;
        for (size_t k = 0; k < space->node_count; k++) {
            double x[3];
            position(space, k, x);
            x[1] -= 0.1;
            x[2] -= 0.1;
            u[3 * k] = x[0] * x[1];
            u[3 * k + 1] = -(x[0] * x[0] + nu * (x[1] * x[1] - x[2] * x[2])) / 2;
            u[3 * k + 2] = -nu * x[1] * x[2];
        }
        model_multiply(s.model, u, f);
        for (size_t i = 0; i < n; i++) {
            double x[3];
            energy += u[i] * f[i] / 2;
            position(space, i / 3, x);
            if (x[0] < 1e-9 || x[0] > 0.25 - 1e-9)
                ends = fmax(ends, fabs(f[i]));
            else
                inside = fmax(inside, fabs(f[i]));
        }
        /* E/2 int y^2, with y from -0.1 to 0.1 */
        double exact = 4000.0 / 2 * 0.25 * 0.2 * 0.2 * 0.2 * 0.2 / 12;
        double lacking = order ? pressure_variation(&s.mesh, lame_from_young(4000, nu), nu) : 0;
        print_message("# %s, nu = %.2f: residual %.1e of the load on the ends, energy %.6f of the exact one\n",
                      model_discretisation(s.model), nu, inside / ends, energy / exact);
        if (order) {
            assert_true(fabs(energy + lacking - exact) < 1e-11 * exact); /* terms 100 times the sum cancel */
            assert_true(nu > 0 || inside < 1e-11 * ends);
        } else
            assert_true(inside > 1e-2 * ends);
        free(u);
        free(f);
        specimen_free(&s);
    }
}

/* The work of a unit force on a vertex in any affine displacement is that of a point force: resultant, moment, and no
 * widening. And the mean of what the vertices show is the mean displacement, for any quadratic one. */
static void forces_on_vertices_are_statically_point_forces(void **state)
{
    (void)state;
    uint64_t seed = 21;
    struct specimen s;
    specimen_irregular(&s, 0.45, ELEMENT_QUADRATIC, &seed);
    const struct space *space = &s.model->space;
    const struct projection *R = &s.model->projection;
    double worst = 0;
    for (size_t v = 0; v < s.surface.vertex_count; v++) {
        double sum = 0, moment[3] = {0, 0, 0};
        for (size_t k = R->start[v]; k < R->start[v + 1]; k++) {
            double x[3];
            position(space, R->node[k], x);
            sum += R->weight[k];
            for (size_t a = 0; a < 3; a++)
                moment[a] += R->weight[k] * (x[a] - s.mesh.nodes[3 * (size_t)s.surface.node[v] + a]);
        }
        worst = fmax(worst, fabs(sum - 1));
        for (size_t a = 0; a < 3; a++)
            worst = fmax(worst, fabs(moment[a]) / 0.25);
    }
    print_message("# resultant and first moment: %.1e\n", worst);
    assert_true(worst < 1e-14); /* some twenty roundings of 1.1e-16 */

    double mean = 0, exact = 0, area = 0;
    double *u = room(space->node_count * sizeof *u);
    for (size_t n = 0; n < space->node_count; n++)
        u[n] = draw(&seed);
    for (size_t v = 0; v < s.surface.vertex_count; v++)
        for (size_t k = R->start[v]; k < R->start[v + 1]; k++)
            mean += s.surface.areas[v] * R->weight[k] * u[R->node[k]];
    for (size_t t = 0; t < s.surface.triangle_count; t++) { /* the middles alone carry the integral, a third each */
        const uint32_t *v = s.surface.triangles + 3 * t;
        double e[2][3], normal = 0;
        for (size_t k = 0; k < 2; k++)
            for (size_t a = 0; a < 3; a++)
                e[k][a] = s.mesh.nodes[3 * (size_t)s.surface.node[v[k + 1]] + a] -
                          s.mesh.nodes[3 * (size_t)s.surface.node[v[0]] + a];
        for (size_t a = 0; a < 3; a++)
            normal += pow(e[0][(a + 1) % 3] * e[1][(a + 2) % 3] - e[0][(a + 2) % 3] * e[1][(a + 1) % 3], 2);
        area += sqrt(normal) / 2;
        for (size_t k = 0; k < 3; k++)
            exact += sqrt(normal) / 6 * u[space_middle(space, s.surface.node[v[k]], s.surface.node[v[(k + 1) % 3]])];
    }
    print_message("# mean displacement: %.1e\n", fabs(mean - exact) / area);
    assert_true(fabs(mean - exact) < 1e-13 * area);
    free(u);
    specimen_free(&s);
}

/* A ligament keeps its stiffness when its vertices hand shares to the middles between them. */
static void ligament_keeps_its_stiffness(void **state)
{
    (void)state;
    struct specimen s;
    specimen_block(&s, 3, 3, 3, 0.1, 0.1, 0.1);
    specimen_material(&s, "all", 4000, 0.45);
    for (int a = 0; a < 3; a++) {
        s.scene.ligament[a].where = a == 0   ? box(0, 0, 0, 0, 1, 1)
                                    : a == 1 ? box(0, 0, 0, 0.04, 1, 0)
                                             : box(0, 0, 0, 0, 0, 0);
        s.scene.ligament[a].stiffness_N_m = 100 * (a + 1);
        s.scene.ligament[a].direction[a] = 2;
    }
    s.scene.ligament_count = 3;
    s.scene.ligament[3] = s.scene.ligament[1];
    s.scene.ligament[3].where = box(0.1, 0, 0, 0.1, 1, 1);
    s.scene.ligament[4] = s.scene.ligament[2];
    s.scene.ligament[4].where = box(0, 0.1, 0, 1, 0.1, 1);
    s.scene.ligament_count = 5;
    s.scene.order = ELEMENT_QUADRATIC;
    specimen_model(&s);
    const double expected[3] = {100, 400, 600};
    size_t n = model_unknowns(s.model);
    double *u = room(n * sizeof *u), *f = room(n * sizeof *f);
    for (size_t a = 0; a < 3; a++) {
        double work = 0;
        for (size_t i = 0; i < n; i++)
            u[i] = i % 3 == a;
        model_multiply(s.model, u, f);
        for (size_t i = 0; i < n; i++)
            work += u[i] * f[i];
        assert_true(fabs(work / expected[a] - 1) < 1e-12); /* element forces of 1 kN/m cancel */
    }
    free(u);
    free(f);
    specimen_free(&s);
}

/* Spread by area: on a face with small triangles at one end and large ones at the other the resultant of a uniform
 * motion passes through the middle of the face, not through the mean of its nodes (here at a third). */
static void ligament_pulls_at_the_middle_of_its_patch(void **state)
{
    (void)state;
    for (int order = 0; order < 2; order++) {
        struct specimen s;
        specimen_block(&s, 5, 3, 3, 0.1, 0.1, 0.1);
        for (size_t n = 0; n < s.mesh.node_count; n++)
            s.mesh.nodes[3 * n] *= s.mesh.nodes[3 * n] / 0.1;
        specimen_material(&s, "all", 4000, 0.45);
        for (int a = 0; a < 3; a++) {
            s.scene.ligament[a].where = a == 2 ? box(0, 0, 0, 1, 1, 0) : box(0, 0, 0, 1, 1, 1);
            s.scene.ligament[a].stiffness_N_m = 300;
            s.scene.ligament[a].direction[a] = 1;
        }
        s.scene.ligament_count = 3;
        s.scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        specimen_model(&s);
        size_t n = model_unknowns(s.model);
        double *u = room(n * sizeof *u), *f = room(n * sizeof *f), moment = 0;
        for (size_t i = 2; i < n; i += 3)
            u[i] = 1;
        model_multiply(s.model, u, f); /* a translation: the springs alone answer */
        for (size_t i = 2; i < n; i += 3) {
            double x[3];
            position(&s.model->space, i / 3, x);
            moment += x[0] * f[i];
        }
        print_message("# order %d: resultant at x = %.12g m\n", order + 1, moment / 300);
        assert_true(fabs(moment / 300 / 0.05 - 1) < 1e-12); /* element forces of 1 kN/m cancel */
        free(u);
        free(f);
        specimen_free(&s);
    }
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(element_stiffness_equals_a_quadrature_of_the_strains),
        cmocka_unit_test(pure_bending_is_carried_but_for_the_pressure_within_elements),
        cmocka_unit_test(forces_on_vertices_are_statically_point_forces),
        cmocka_unit_test(ligament_keeps_its_stiffness),
        cmocka_unit_test(ligament_pulls_at_the_middle_of_its_patch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
