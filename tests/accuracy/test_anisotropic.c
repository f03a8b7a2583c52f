/* Materials with directions, against closed forms that start from the compliance (strain from stress, by the definition of
 * the engineering constants), while the program starts from its inverse. */
#include "hooke.h"
#include "model_state.h"
#include "specimen.h"

static const double EXACT = 1e-10; /* test_stiffness.c says why */

static const double E3[3] = {30e3, 12e3, 8e3}, nu3[3] = {0.35, 0.2, 0.4}, G3[3] = {5e3, 4e3, 3e3};

static struct scene_material orthotropic(void)
{
    struct scene_material m = {.label = "all",
                               .symmetry = SYMMETRY_ORTHOTROPIC,
                               .along = {2 / 3.0, 1 / 3.0, 2 / 3.0},
                               .across = {1 / 3.0, 2 / 3.0, -2 / 3.0},
                               .rho_kg_m3 = 1060};
    memcpy(m.orthotropic.E_Pa, E3, sizeof E3);
    memcpy(m.orthotropic.nu, nu3, sizeof nu3);
    memcpy(m.orthotropic.G_Pa, G3, sizeof G3);
    return m;
}

static struct scene_material transverse(double EL, double ET, double GLT, double nuLT, double nuTT, double x, double y,
                                        double z)
{
    return (struct scene_material){
        .label = "all",
        .symmetry = SYMMETRY_TRANSVERSE,
        .along = {x, y, z},
        .rho_kg_m3 = 1060,
        .orthotropic = {{EL, ET, ET}, {nuLT, nuLT, nuTT}, {GLT, GLT, ET / (2 * (1 + nuTT))}},
    };
}

/* Strain under a stress, both in the material's axes. */
static void comply(const struct scene_orthotropic *o, double s[3][3], double e[3][3])
{
    const double *E = o->E_Pa, *nu = o->nu, *G = o->G_Pa;
    e[0][0] = s[0][0] / E[0] - nu[0] / E[0] * s[1][1] - nu[1] / E[0] * s[2][2];
    e[1][1] = -nu[0] / E[0] * s[0][0] + s[1][1] / E[1] - nu[2] / E[1] * s[2][2];
    e[2][2] = -nu[1] / E[0] * s[0][0] - nu[2] / E[1] * s[1][1] + s[2][2] / E[2];
    e[0][1] = e[1][0] = s[0][1] / (2 * G[0]);
    e[0][2] = e[2][0] = s[0][2] / (2 * G[1]);
    e[1][2] = e[2][1] = s[1][2] / (2 * G[2]);
}

static void to_world(double axis[3][3], double local[3][3], double world[3][3])
{
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            world[a][b] = 0;
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    world[a][b] += axis[i][a] * axis[j][b] * local[i][j];
        }
}

/* K of the linear field with strain e is what its stress does on the surface, and nothing inside: on a linear triangle a
 * third of the traction to each corner, on a quadratic one a third to each middle. */
static double patch_error(const struct scene_material *material, enum element_order order, uint64_t *seed)
{
    struct specimen s;
    specimen_block(&s, 3, 4, 3, 1, 1, 1);
    specimen_shake(&s, 0.2, 0.25, seed);
    specimen_renumber(&s, seed);
    s.scene.material[s.scene.material_count++] = *material;
    s.scene.order = order;
    for (int a = 0; a < 3; a++) { /* held so loosely that K remains what it is */
        struct scene_ligament *ligament = &s.scene.ligament[s.scene.ligament_count++];
        ligament->where = box(0, 0, 0, 1, 1, 1);
        ligament->stiffness_N_m = 1e-30;
        ligament->direction[a] = 1;
    }
    specimen_model(&s);
    const struct space *space = &s.model->space;
    size_t n = model_unknowns(s.model);
    assert_int_equal(n, 3 * space->node_count);
    double axis[3][3], worst = 0, *u = room(n * sizeof *u), *f = room(n * sizeof *f), *expected = room(n * sizeof *u);
    const double *a1 = material->along, *a2 = material->across;
    if (material->symmetry == SYMMETRY_ORTHOTROPIC)
        for (int a = 0; a < 3; a++) {
            axis[0][a] = a1[a];
            axis[1][a] = a2[a];
            axis[2][a] = a1[(a + 1) % 3] * a2[(a + 2) % 3] - a1[(a + 2) % 3] * a2[(a + 1) % 3];
        }
    else
        assert_true(hooke_axes(a1, NULL, axis));
    for (int state = 0; state < 6; state++) {
        static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
        double stress[3][3] = {{0}}, strain[3][3], world_stress[3][3], world_strain[3][3], top = 0;
        stress[row[state]][column[state]] = stress[column[state]][row[state]] = 1000;
        comply(&material->orthotropic, stress, strain);
        to_world(axis, stress, world_stress);
        to_world(axis, strain, world_strain);
        memset(expected, 0, n * sizeof *expected);
        for (size_t k = 0; k < space->node_count; k++) {
            uint32_t ends[2];
            space_ends(space, k, ends);
            for (size_t a = 0; a < 3; a++) {
                u[3 * k + a] = 0;
                for (size_t b = 0; b < 3; b++)
                    u[3 * k + a] += world_strain[a][b] *
                                    (s.mesh.nodes[3 * (size_t)ends[0] + b] + s.mesh.nodes[3 * (size_t)ends[1] + b]) / 2;
            }
        }
        if (order == ELEMENT_LINEAR)
            traction(&s, world_stress, NULL, expected);
        else
            for (size_t t = 0; t < s.surface.triangle_count; t++) {
                uint32_t node[3];
                const double *x[3];
                for (size_t k = 0; k < 3; k++) {
                    node[k] = s.surface.node[s.surface.triangles[3 * t + k]];
                    x[k] = s.mesh.nodes + 3 * (size_t)node[k];
                }
                for (size_t a = 0; a < 3; a++) {
                    size_t b = (a + 1) % 3, c = (a + 2) % 3;
                    double area =
                        ((x[1][b] - x[0][b]) * (x[2][c] - x[0][c]) - (x[1][c] - x[0][c]) * (x[2][b] - x[0][b])) / 2;
                    for (size_t k = 0; k < 3; k++)
                        for (size_t r = 0; r < 3; r++)
                            expected[3 * (size_t)space_middle(space, node[k], node[(k + 1) % 3]) + r] +=
                                world_stress[r][a] * area / 3;
                }
            }
        model_multiply(s.model, u, f);
        for (size_t i = 0; i < n; i++)
            top = fmax(top, fabs(expected[i]));
        for (size_t i = 0; i < n; i++)
            worst = fmax(worst, fabs(f[i] - expected[i]) / top);
    }
    free(u);
    free(f);
    free(expected);
    specimen_free(&s);
    return worst;
}

static void uniform_stress_is_carried_exactly_in_either_order(void **state)
{
    (void)state;
    uint64_t seed = 20250203;
    print_message("# seed %llu\n", (unsigned long long)seed);
    struct scene_material material[2] = {orthotropic(), transverse(40e3, 9e3, 6e3, 0.4, 0.5, 0.6, 0, 0.8)};
    for (int m = 0; m < 2; m++)
        for (int order = 0; order < 2; order++) {
            double worst = patch_error(&material[m], order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR, &seed);
            print_message("# %s, P%d: %.1e of the largest force\n", m ? "transverse" : "orthotropic", order + 1, worst);
            assert_true(worst < 1e-12); /* as in test_quadratic.c: cancelling sums of some hundred terms */
        }
}

static bool at_far_end(const double *x)
{
    return x[0] > 0.2 - 1e-9;
}

/* A bar on rollers pulled along x: the strains along x, y, z, found at the far corner. */
static void pull(const struct scene_material *material, enum element_order order, double strain[3], double *spread)
{
    const double L[3] = {0.2, 0.05, 0.04}, F = 0.7;
    struct specimen s;
    specimen_block(&s, 6, 2, 2, L[0], L[1], L[2]);
    s.scene.material[s.scene.material_count++] = *material;
    s.scene.order = order;
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "x");
    specimen_fix(&s, box(0, 0, 0, 1, 0, 1), "y");
    specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "z");
    specimen_model(&s);
    size_t n = model_unknowns(s.model);
    double *f = room(n * sizeof *f), *u = room(n * sizeof *u), *nodal = room(3 * s.mesh.node_count * sizeof *nodal);
    double stress[3][3] = {{F / (L[1] * L[2])}};
    if (order == ELEMENT_LINEAR) {
        traction(&s, stress, at_far_end, nodal);
        for (size_t i = 0; i < 3 * s.mesh.node_count; i++)
            if (model_unknown(s.model, i / 3, (int)(i % 3)) >= 0)
                f[model_unknown(s.model, i / 3, (int)(i % 3))] += nodal[i];
    } else { /* a third of each triangle's traction to each of its middles */
        traction(&s, stress, at_far_end, nodal);
        for (size_t t = 0; t < s.surface.triangle_count; t++)
            for (size_t k = 0; k < 3; k++) {
                uint32_t a = s.surface.node[s.surface.triangles[3 * t + k]];
                uint32_t b = s.surface.node[s.surface.triangles[3 * t + (k + 1) % 3]];
                uint32_t c = s.surface.node[s.surface.triangles[3 * t + (k + 2) % 3]];
                if (at_far_end(s.mesh.nodes + 3 * (size_t)a) && at_far_end(s.mesh.nodes + 3 * (size_t)b) &&
                    at_far_end(s.mesh.nodes + 3 * (size_t)c)) /* all triangles of the end are alike */
                    f[model_unknown(s.model, space_middle(&s.model->space, a, b), 0)] += F / 8 / 3;
            }
    }
    struct failure why;
    must(model_solve(s.model, 1, f, u, &why), &why);
    size_t corner = s.mesh.node_count - 1;
    for (int a = 0; a < 3; a++)
        strain[a] = u[model_unknown(s.model, corner, a)] / L[a] / (F / (L[1] * L[2]));
    *spread = 0;
    for (size_t i = 0; i < 3 * s.mesh.node_count; i++) {
        int32_t unknown = model_unknown(s.model, i / 3, (int)(i % 3));
        double x = s.mesh.nodes[i], got = unknown < 0 ? 0 : u[unknown] / (F / (L[1] * L[2]));
        *spread = fmax(*spread, fabs(got - strain[i % 3] * x) / (fabs(strain[0]) * L[0]));
    }
    free(f);
    free(u);
    free(nodal);
    specimen_free(&s);
}

static void bar_along_and_across_its_fibres_has_E_L_and_E_T(void **state)
{
    (void)state;
    const double EL = 40e3, ET = 9e3, GLT = 6e3, nLT = 0.4, nTT = 0.5;
    for (int order = 0; order < 2; order++) {
        enum element_order o = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        double e[3], spread, worst = 0;
        struct scene_material along = transverse(EL, ET, GLT, nLT, nTT, 1, 0, 0);
        struct scene_material across = transverse(EL, ET, GLT, nLT, nTT, 0, 1, 0);
        pull(&along, o, e, &spread);
        const double lengthwise[3] = {1 / EL, -nLT / EL, -nLT / EL};
        for (int a = 0; a < 3; a++)
            worst = fmax(worst, fabs(e[a] / lengthwise[a] - 1));
        worst = fmax(worst, spread);
        pull(&across, o, e, &spread);
        const double crosswise[3] = {1 / ET, -nLT / EL, -nTT / ET};
        for (int a = 0; a < 3; a++)
            worst = fmax(worst, fabs(e[a] / crosswise[a] - 1));
        worst = fmax(worst, spread);
        print_message("# bar along and across, P%d: %.1e\n", order + 1, worst);
        assert_true(worst < EXACT);
    }
}

/* Off the axis: 1/E = cos^4/E_L + sin^4/E_T + (1/G_LT - 2 nu_LT/E_L) sin^2 cos^2 (Jones 2.6), on three held nodes so that
 * the block may also shear. */
static void bar_at_an_angle_has_the_modulus_of_the_closed_form(void **state)
{
    (void)state;
    const double EL = 40e3, ET = 9e3, GLT = 6e3, nLT = 0.4, nTT = 0.5;
    for (int step = 0; step <= 6; step++) {
        double t = M_PI / 12 * step, c = cos(t), d = sin(t);
        double expected =
            pow(c, 4) / EL + pow(d, 4) / ET + (1 / GLT - 2 * nLT / EL) * c * c * d * d; /* strain of unit stress */
        struct specimen s;
        specimen_block(&s, 2, 2, 2, 1, 1, 1);
        s.scene.material[s.scene.material_count++] = transverse(EL, ET, GLT, nLT, nTT, c, d, 0);
        specimen_fix(&s, box(0, 0, 0, 0, 0, 0), "xyz");
        specimen_fix(&s, box(1, 0, 0, 1, 0, 0), "yz");
        specimen_fix(&s, box(0, 1, 0, 0, 1, 0), "z");
        specimen_model(&s);
        double *force = room(3 * s.mesh.node_count * sizeof *force), *u = room(3 * s.mesh.node_count * sizeof *u);
        double stress[3][3] = {{1}};
        traction(&s, stress, NULL, force);
        specimen_solve(&s, force, u);
        size_t at = 0; /* the node at (1, 0, 0) */
        for (size_t n = 0; n < s.mesh.node_count; n++)
            if (s.mesh.nodes[3 * n] == 1 && s.mesh.nodes[3 * n + 1] == 0 && s.mesh.nodes[3 * n + 2] == 0)
                at = n;
        print_message("# %2d degrees: E = %.1f Pa, closed form %.1f Pa\n", 15 * step, 1 / u[3 * at], 1 / expected);
        assert_true(fabs(u[3 * at] / expected - 1) < EXACT);
        free(force);
        free(u);
        specimen_free(&s);
    }
}

/* Equal constants in all directions are the isotropic material, tensor by tensor, whatever the axes. */
static void equal_constants_are_isotropic_up_to_incompressibility(void **state)
{
    (void)state;
    static const double nus[4] = {0, 0.3, 0.49, 0.49999};
    for (int k = 0; k < 4; k++) {
        double E = 4000, nu = nus[k], G = E / (2 * (1 + nu)), worst = 0;
        struct scene scene = {0};
        struct scene_material m = transverse(E, E, G, nu, nu, 0.48, 0.6, 0.64);
        struct hooke hooke, isotropic = hooke_isotropic(E, nu);
        struct failure why;
        must(hooke_of_material(&scene, &m, NULL, &hooke, &why), &why);
        for (int v = 0; v < 6; v++)
            for (int w = 0; w < 6; w++) {
                double lambda = isotropic.lame.lambda_Pa, mu = isotropic.lame.mu_Pa;
                double expected = (v < 3 && w < 3 ? lambda : 0) + (v == w ? (v < 3 ? 2 * mu : mu) : 0);
                worst = fmax(worst, fabs(hooke.C[v][w] - expected) / (lambda + 2 * mu));
            }
        print_message("# nu = %g: %.1e of lambda + 2 mu\n", nu, worst);
        assert_true(worst < 1e-15 / (1 - 2 * nu)); /* D loses its digits as 1 - 2 nu */
    }
}

/* K is symmetric to rounding and positive: every random displacement costs energy. */
static void stiffness_is_symmetric_and_positive(void **state)
{
    (void)state;
    uint64_t seed = 5;
    print_message("# seed %llu\n", (unsigned long long)seed);
    for (int order = 0; order < 2; order++) {
        struct specimen s;
        specimen_block(&s, 3, 3, 3, 0.1, 0.1, 0.1);
        specimen_shake(&s, 0.2, 0.03, &seed);
        s.scene.material[s.scene.material_count++] = orthotropic();
        s.scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
        specimen_model(&s);
        struct element e = element_geometry(s.mesh.nodes, s.mesh.tetrahedra);
        struct hooke hooke;
        struct failure why;
        must(hooke_of_material(&s.scene, &s.scene.material[0], NULL, &hooke, &why), &why);
        size_t nodes = element_nodes(s.scene.order);
        for (size_t j = 0; j < nodes; j++)
            for (size_t k = 0; k < nodes; k++) {
                double one[9] = {0}, other[9] = {0}, top = 0;
                element_add_block(&e, &hooke, s.scene.order, j, k, one);
                element_add_block(&e, &hooke, s.scene.order, k, j, other);
                for (int i = 0; i < 9; i++)
                    top = fmax(top, fabs(one[i]));
                for (int a = 0; a < 3; a++)
                    for (int b = 0; b < 3; b++)
                        assert_true(fabs(one[3 * a + b] - other[3 * b + a]) <= 1e-14 * top);
            }
        size_t n = model_unknowns(s.model);
        double *x = room(n * sizeof *x), *Kx = room(n * sizeof *Kx);
        for (int trial = 0; trial < 20; trial++) {
            double energy = 0;
            for (size_t i = 0; i < n; i++)
                x[i] = draw(&seed) - 0.5;
            model_multiply(s.model, x, Kx);
            for (size_t i = 0; i < n; i++)
                energy += x[i] * Kx[i];
            assert_true(energy > 0);
        }
        struct compliance c;
        must(compliance_build(s.model, true, &c, &why), &why); /* the Schur path factors it */
        compliance_free(&c);
        free(x);
        free(Kx);
        specimen_free(&s);
    }
}

/* Work of a pressure on the middle of a clamped cube's top. */
static double work(const struct scene_material *material, enum element_order order, size_t cells)
{
    struct specimen s;
    specimen_block(&s, cells, cells, cells, 0.1, 0.1, 0.1);
    s.scene.material[s.scene.material_count++] = *material;
    s.scene.order = order;
    specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "xyz");
    specimen_model(&s);
    size_t n = model_unknowns(s.model);
    double *f = room(n * sizeof *f), *u = room(n * sizeof *u), sum = 0;
    for (size_t v = 0; v < s.surface.vertex_count; v++) { /* a smooth bump, the same on every mesh */
        const double *x = s.mesh.nodes + 3 * (size_t)s.surface.node[v];
        if (x[2] > 0.1 - 1e-9)
            model_load(s.model, (uint32_t)v, 2,
                       -s.surface.areas[v] * pow(sin(M_PI * x[0] / 0.1) * sin(M_PI * x[1] / 0.1), 2), f);
    }
    struct failure why;
    must(model_solve(s.model, 1, f, u, &why), &why);
    for (size_t i = 0; i < n; i++)
        sum += f[i] * u[i];
    free(f);
    free(u);
    specimen_free(&s);
    return sum;
}

/* Fibres three times as stiff: incompressible at nu_LT = 1/2, nu_TT = 1 - E_T / (2 E_L) = 5/6. The error of a coarse mesh
 * stays what it is for an isotropic material as near to incompressible; a factor of 1.5 is left for the fibres' own error. */
static void nearly_incompressible_fibres_are_as_accurate_as_isotropic_tissue(void **state)
{
    (void)state;
    struct scene_material isotropic = {.label = "all", .E_Pa = 4000, .nu = 0.4999, .rho_kg_m3 = 1060};
    struct scene_material fibres = transverse(12000, 4000, 1500, 0.4999, 0.8331, 0.6, 0, 0.8);
    const struct scene_material *material[2] = {&isotropic, &fibres};
    double error[2][2];
    for (int m = 0; m < 2; m++) {
        double finest = work(material[m], ELEMENT_QUADRATIC, 10);
        for (int order = 0; order < 2; order++)
            error[m][order] = fabs(work(material[m], order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR, 6) / finest - 1);
        print_message("# %s: 6 against 10 cells: P1 %.1f %%, P2 %.2f %%\n", m ? "fibres" : "isotropic",
                      100 * error[m][0], 100 * error[m][1]);
    }
    assert_true(error[1][1] < 1.5 * error[0][1]);
    assert_true(error[1][1] < error[1][0] / 4); /* P1 locks, P2 does not */
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(uniform_stress_is_carried_exactly_in_either_order),
        cmocka_unit_test(bar_along_and_across_its_fibres_has_E_L_and_E_T),
        cmocka_unit_test(bar_at_an_angle_has_the_modulus_of_the_closed_form),
        cmocka_unit_test(equal_constants_are_isotropic_up_to_incompressibility),
        cmocka_unit_test(stiffness_is_symmetric_and_positive),
        cmocka_unit_test(nearly_incompressible_fibres_are_as_accurate_as_isotropic_tissue),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
