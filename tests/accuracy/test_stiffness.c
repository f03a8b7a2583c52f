/* Closed forms that linear tetrahedra must reproduce exactly, because the field is linear in each element. What remains is
 * rounding: the relative error of a solve is at most about cond(K) x 1.1e-16, and cond(K) of these specimens is below 1e6
 * (squared cells per side x stiffness ratio of the materials, or of volume to shear), so 1e-10 it is. */
#include "specimen.h"

static const double EXACT = 1e-10;

/* Stress of isotropic Hooke's law, written with E and nu. */
static void hooke(double E, double nu, double strain[3][3], double stress[3][3])
{
    double trace = strain[0][0] + strain[1][1] + strain[2][2];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            stress[a][b] = E / (1 + nu) * (strain[a][b] + (a == b ? nu / (1 - 2 * nu) * trace : 0));
}

/* Three nodes hold the six rigid motions and no more: the corner wholly, a node on the x axis in y and z, one on the y
 * axis in z. A displacement gradient with zeros below the diagonal satisfies them at any strain. */
static void check_patch(struct specimen *s, double E, double nu)
{
    specimen_material(s, "all", E, nu);
    specimen_fix(s, box(0, 0, 0, 0, 0, 0), "xyz");
    specimen_fix(s, box(1, 0, 0, 1, 0, 0), "yz");
    specimen_fix(s, box(0, 1, 0, 0, 1, 0), "z");
    specimen_model(s);
    size_t n = s->mesh.node_count;
    double *force = room(3 * n * sizeof *force), *u = room(3 * n * sizeof *u);
    double worst = 0;
    for (int state = 0; state < 6; state++) {
        static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
        double gradient[3][3] = {{0}}, strain[3][3], stress[3][3];
        gradient[row[state]][column[state]] = 0.01;
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                strain[a][b] = (gradient[a][b] + gradient[b][a]) / 2;
        hooke(E, nu, strain, stress);
        memset(force, 0, 3 * n * sizeof *force);
        traction(s, stress, NULL, force);
        specimen_solve(s, force, u);
        for (size_t i = 0; i < 3 * n; i++) {
            const double *x = s->mesh.nodes + 3 * (i / 3), *g = gradient[i % 3];
            worst = fmax(worst, fabs(u[i] - (g[0] * x[0] + g[1] * x[1] + g[2] * x[2])) / 0.01);
        }
    }
    print_message("# patch test, nu = %g: largest error %.1e of the largest displacement\n", nu, worst);
    assert_true(worst < EXACT);
    free(force);
    free(u);
}

static void patch_test_of_six_strain_states_is_exact_on_an_irregular_mesh(void **state)
{
    (void)state;
    uint64_t seed = 20240501;
    print_message("# seed %llu\n", (unsigned long long)seed);
    for (int renumbered = 0; renumbered < 2; renumbered++)
        for (int k = 0; k < 2; k++) {
            struct specimen s;
            specimen_block(&s, 4, 5, 4, 1, 1, 1);
            specimen_shake(&s, 0.2, 0.2, &seed);
            if (renumbered)
                specimen_renumber(&s, &seed);
            check_patch(&s, 4000, k ? 0.45 : 0.3);
            specimen_free(&s);
        }
}

static bool at_far_end(const double *x)
{
    return x[0] > 0.2 - 1e-9;
}

/* 0.2 x 0.05 x 0.04 m bar pulled by F at x = 0.2; returns the largest error of the field over F L / (E A). */
static double bar_error(double E, double nu, bool clamped)
{
    const double L = 0.2, A = 0.05 * 0.04, F = 0.7;
    uint64_t seed = 7;
    struct specimen s;
    specimen_block(&s, 8, 3, 2, L, 0.05, 0.04);
    specimen_shake(&s, 0.15, 0.016, &seed);
    specimen_material(&s, "all", E, nu);
    if (clamped)
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    else { /* rollers: the end slides in its plane, two sides in theirs */
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "x");
        specimen_fix(&s, box(0, 0, 0, 1, 0, 1), "y");
        specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "z");
    }
    specimen_model(&s);
    size_t n = s.mesh.node_count;
    double *force = room(3 * n * sizeof *force), *u = room(3 * n * sizeof *u), stress[3][3] = {{F / A}}, worst = 0;
    traction(&s, stress, at_far_end, force);
    specimen_solve(&s, force, u);
    double strain = F / (E * A);
    for (size_t i = 0; i < 3 * n; i++) {
        double expected = strain * s.mesh.nodes[i] * (i % 3 == 0 ? 1 : -nu);
        worst = fmax(worst, fabs(u[i] - expected) / (strain * L));
    }
    free(force);
    free(u);
    specimen_free(&s);
    return worst;
}

static void bar_under_axial_load_stretches_by_FL_over_EA(void **state)
{
    (void)state;
    double clamped = bar_error(4000, 0, true), rollers = bar_error(4000, 0.3, false);
    print_message("# bar: clamped, nu = 0: %.1e; on rollers, nu = 0.3: %.1e\n", clamped, rollers);
    assert_true(clamped < EXACT);
    assert_true(rollers < EXACT);
}

/* Confined between rollers on all sides: modulus E (1 - nu) / ((1 + nu)(1 - 2 nu)), also close to incompressible. */
static void oedometric_bar_has_the_confined_modulus(void **state)
{
    (void)state;
    const double L = 0.2, A = 0.05 * 0.04, F = 0.7, E = 4000;
    const double nus[3] = {0.3, 0.45, 0.4999};
    for (int k = 0; k < 3; k++) {
        double nu = nus[k];
        struct specimen s;
        specimen_block(&s, 8, 3, 2, L, 0.05, 0.04);
        specimen_material(&s, "all", E, nu);
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "x");
        specimen_fix(&s, box(0, 0, 0, 1, 0, 1), "y");
        specimen_fix(&s, box(0, 0.05, 0, 1, 0.05, 1), "y");
        specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "z");
        specimen_fix(&s, box(0, 0, 0.04, 1, 1, 0.04), "z");
        specimen_model(&s);
        size_t n = s.mesh.node_count;
        double *force = room(3 * n * sizeof *force), *u = room(3 * n * sizeof *u), stress[3][3] = {{F / A}}, worst = 0;
        traction(&s, stress, at_far_end, force);
        specimen_solve(&s, force, u);
        double strain = F / (A * E * (1 - nu) / ((1 + nu) * (1 - 2 * nu)));
        for (size_t i = 0; i < 3 * n; i++)
            worst = fmax(worst, fabs(u[i] - (i % 3 == 0 ? strain * s.mesh.nodes[i] : 0)) / (strain * L));
        print_message("# confined bar, nu = %g: %.1e\n", nu, worst);
        assert_true(worst < EXACT);
        free(force);
        free(u);
        specimen_free(&s);
    }
}

static void two_layers_in_series_add_their_compliances(void **state)
{
    (void)state;
    const double L1 = 0.05, L2 = 0.15, A = 0.05 * 0.04, F = 0.7, E1 = 4000, E2 = 90000;
    struct specimen s;
    specimen_block(&s, 8, 3, 2, L1 + L2, 0.05, 0.04);
    s.mesh.label_count = 2;
    s.mesh.label[0].number = 1;
    s.mesh.label[1].number = 2;
    for (size_t t = 0; t < s.mesh.tetrahedron_count; t++) {
        double x = 0;
        for (size_t k = 0; k < 4; k++)
            x += s.mesh.nodes[3 * (size_t)s.mesh.tetrahedra[4 * t + k]] / 4;
        s.mesh.labels[t] = x < L1 ? 1 : 2;
    }
    specimen_material(&s, "1", E1, 0);
    specimen_material(&s, "2", E2, 0);
    s.scene.material[1].rho_kg_m3 = 2000;
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    specimen_model(&s);
    size_t n = s.mesh.node_count;
    double *force = room(3 * n * sizeof *force), *u = room(3 * n * sizeof *u), stress[3][3] = {{F / A}}, worst = 0;
    traction(&s, stress, at_far_end, force);
    specimen_solve(&s, force, u);
    double end = F / A * (L1 / E1 + L2 / E2);
    for (size_t i = 0; i < 3 * n; i++) {
        double x = s.mesh.nodes[i], expected = F / A * (fmin(x, L1) / E1 + fmax(x - L1, 0) / E2);
        worst = fmax(worst, fabs(u[i] - (i % 3 == 0 ? expected : 0)) / end);
    }
    double mass = A * (L1 * 1060 + L2 * 2000);
    print_message("# two layers: %.1e; mass error %.1e\n", worst, fabs(model_mass(s.model) / mass - 1));
    assert_true(worst < EXACT);
    assert_true(fabs(model_mass(s.model) / mass - 1) < 1e-13); /* 288 additions of 1.1e-16 */
    free(force);
    free(u);
    specimen_free(&s);
}

static void ligament_and_bar_in_series_add_their_compliances(void **state)
{
    (void)state;
    const double L = 0.2, w = 0.05, A = w * w / 2, E = 4000, F = 0.3, k = 37;
    struct specimen s;
    specimen_prism(&s, 9, L, w);
    specimen_material(&s, "all", E, 0);
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "yz");
    s.scene.ligament_count = 1;
    s.scene.ligament[0] = (struct scene_ligament){.where = box(0, 0, 0, 0, 1, 1),
                                                  .stiffness_N_m = k,
                                                  .direction = {-1, 0, 0}}; /* a line: its sign does not matter */
    specimen_model(&s);
    size_t n = s.mesh.node_count;
    double *force = room(3 * n * sizeof *force), *u = room(3 * n * sizeof *u), stress[3][3] = {{F / A}}, worst = 0;
    traction(&s, stress, at_far_end, force);
    specimen_solve(&s, force, u);
    for (size_t i = 0; i < 3 * n; i++) {
        double expected = i % 3 == 0 ? F / k + F * s.mesh.nodes[i] / (E * A) : 0;
        worst = fmax(worst, fabs(u[i] - expected) / (F / k + F * L / (E * A)));
    }
    print_message("# bar on a ligament: %.1e\n", worst);
    assert_true(worst < EXACT);
    free(force);
    free(u);
    specimen_free(&s);
}

/* The matrix itself: K of a linear field is the consistent traction, so that nothing depends on the solver. */
static void stiffness_is_symmetric_and_blind_to_rigid_motion(void **state)
{
    (void)state;
    uint64_t seed = 99;
    struct specimen s;
    specimen_block(&s, 3, 4, 3, 1, 1, 1);
    specimen_shake(&s, 0.2, 0.25, &seed);
    specimen_material(&s, "all", 4000, 0.45);
    /* one spring far softer than rounding matters holds nothing: every component stays an unknown */
    for (int a = 0; a < 3; a++) {
        struct scene_ligament *ligament = &s.scene.ligament[s.scene.ligament_count++];
        ligament->where = box(0, 0, 0, 1, 1, 1);
        ligament->stiffness_N_m = 1e-30;
        ligament->direction[a] = 1;
    }
    specimen_model(&s);
    size_t n = model_unknowns(s.model);
    assert_int_equal(n, 3 * s.mesh.node_count);
    double *x = room(n * sizeof *x), *y = room(n * sizeof *y), *Kx = room(n * sizeof *Kx), *Ky = room(n * sizeof *Ky);
    for (size_t i = 0; i < n; i++) {
        x[i] = draw(&seed) - 0.5;
        y[i] = draw(&seed) - 0.5;
    }
    model_multiply(s.model, x, Kx);
    model_multiply(s.model, y, Ky);
    double a = 0, b = 0, energy = 0, stiffest = 0;
    for (size_t i = 0; i < n; i++) {
        a += y[i] * Kx[i];
        b += x[i] * Ky[i];
        energy += x[i] * Kx[i];
        stiffest = fmax(stiffest, fabs(Kx[i]));
    }
    assert_true(fabs(a - b) < 1e-13 * energy);
    for (int motion = 0; motion < 6; motion++) {
        for (size_t i = 0; i < n; i++) {
            const double *p = s.mesh.nodes + 3 * (i / 3);
            size_t c = i % 3, axis = (size_t)motion % 3;
            if (motion < 3)
                x[i] = c == axis;
            else
                x[i] = c == (axis + 1) % 3 ? -p[(axis + 2) % 3] : c == (axis + 2) % 3 ? p[(axis + 1) % 3] : 0;
        }
        model_multiply(s.model, x, Kx);
        for (size_t i = 0; i < n; i++)
            assert_true(fabs(Kx[i]) < 1e-13 * stiffest); /* sums of about 50 products of entries up to `stiffest` */
    }
    free(x);
    free(y);
    free(Kx);
    free(Ky);
    specimen_free(&s);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(patch_test_of_six_strain_states_is_exact_on_an_irregular_mesh),
        cmocka_unit_test(bar_under_axial_load_stretches_by_FL_over_EA),
        cmocka_unit_test(oedometric_bar_has_the_confined_modulus),
        cmocka_unit_test(two_layers_in_series_add_their_compliances),
        cmocka_unit_test(ligament_and_bar_in_series_add_their_compliances),
        cmocka_unit_test(stiffness_is_symmetric_and_blind_to_rigid_motion),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
