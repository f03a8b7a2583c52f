/* The slowest vibrations of a body against closed forms, and that taking them out of the compliance leaves no negative rest. */
#include <lapacke.h>

#include "modes.h"
#include "specimen.h"

static const double PI = 3.14159265358979323846, E_Pa = 4000, RHO = 1060;

/* A bar that can only move along itself: omega_k = (k - 1/2) pi sqrt(E / rho) / L. With lumped masses and n equal layers the
 * k-th is sin(x) / x of it, x = (k - 1/2) pi / (2 n), if a layer moves as a whole; that its tetrahedra let it warp softens it
 * by as much again at most. */
static void bar_vibrates_along_itself_at_its_closed_form(void **state)
{
    (void)state;
    enum { LAYERS = 40, COUNT = 3 };
    struct specimen s;
    struct failure why;
    struct modes modes;
    specimen_prism(&s, LAYERS, 0.4, 0.02);
    specimen_material(&s, "all", E_Pa, 0);
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    specimen_fix(&s, box(0, 0, 0, 1, 1, 1), "yz");
    specimen_model(&s);
    must(modes_find(s.model, COUNT, &modes, &why), &why);
    for (int k = 0; k < COUNT; k++) {
        double exact = (k + 0.5) * PI * sqrt(E_Pa / RHO) / 0.4, x = (k + 0.5) * PI / (2 * LAYERS);
        print_message("# mode %d: %.5f rad/s, closed form %.5f: %+.2g\n", k, modes.omega_rad_s[k], exact,
                      modes.omega_rad_s[k] / exact - 1);
        assert_true(modes.omega_rad_s[k] < exact);
        assert_true(modes.omega_rad_s[k] > exact * (1 - 2 * (1 - sin(x) / x)));
    }
    modes_free(&modes);
    specimen_free(&s);
}

/* A slender cantilever of square section, quadratic elements: omega = 1.8751^2 sqrt(E I / (rho A)) / L^2, twice (two
 * directions). Shear and rotary inertia lower it, in the first order of a wave of number 1.8751 / L (Timoshenko), by
 * (1.8751 h / L)^2 / 24 (1 + E / (kappa G)) = 0.12 % at L = 20 h and nu = 0; as much again is left to the clamp and the
 * elements. */
static void cantilever_swings_at_its_closed_form(void **state)
{
    (void)state;
    const double L = 0.4, h = 0.02, b = 1.875104;
    struct specimen s;
    struct failure why;
    struct modes modes;
    specimen_block(&s, 20, 2, 2, L, h, h);
    specimen_material(&s, "all", E_Pa, 0);
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    s.scene.order = ELEMENT_QUADRATIC;
    specimen_model(&s);
    must(modes_find(s.model, 2, &modes, &why), &why);
    double exact = b * b * sqrt(E_Pa * h * h / 12 / RHO) / (L * L);
    double slender = b * b * h * h / (24 * L * L) * (1 + 2 / (5.0 / 6.0));
    for (int k = 0; k < 2; k++) {
        print_message("# mode %d: %.5f rad/s, Euler and Bernoulli %.5f: %+.2g\n", k, modes.omega_rad_s[k], exact,
                      modes.omega_rad_s[k] / exact - 1);
        assert_true(fabs(modes.omega_rad_s[k] / exact - 1) < 2 * slender);
    }
    modes_free(&modes);
    specimen_free(&s);
}

static void compliance_without_its_modes_stays_positive(void **state)
{
    (void)state;
    for (int order = 0; order < 2; order++) {
        uint64_t seed = 5;
        struct specimen s;
        struct failure why;
        struct modes modes;
        struct compliance G;
        specimen_irregular(&s, 0.45, order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR, &seed);
        must(modes_find(s.model, MODES_MAX, &modes, &why), &why);
        must(compliance_build(s.model, true, &G, &why), &why);
        size_t n = 3 * G.rows, vertices = s.surface.vertex_count;
        double trace = 0, left = 0;
        for (size_t i = 0; i < n; i++)
            trace += G.G[i * n + i];
        for (size_t k = 0; k < modes.count; k++)
            for (size_t v = 0; v < vertices; v++)
                for (size_t w = 0; w < vertices; w++) {
                    if (G.row_of[v] == UINT32_MAX || G.row_of[w] == UINT32_MAX)
                        continue;
                    for (size_t a = 0; a < 3; a++)
                        for (size_t c = 0; c < 3; c++) {
                            size_t i = 3 * G.row_of[v] + a, j = 3 * G.row_of[w] + c;
                            if (i >= j)
                                G.G[j * n + i] -=
                                    modes.share[3 * (k * vertices + v) + a] * modes.share[3 * (k * vertices + w) + c];
                        }
                }
        double *value = room(n * sizeof *value);
        for (size_t i = 0; i < n; i++)
            left += G.G[i * n + i];
        assert_int_equal(LAPACKE_dsyev(LAPACK_COL_MAJOR, 'N', 'L', (int)n, G.G, (int)n, value), 0);
        print_message("# %s: %zu modes from %.3g Hz carry %.0f %% of the trace; smallest of what is left %.2g of the "
                      "largest\n",
                      model_discretisation(s.model), modes.count, modes.omega_rad_s[0] / (2 * PI),
                      100 * (1 - left / trace), value[0] / value[n - 1]);
        assert_true(value[0] >
                    -1e-9 * value[n - 1]); /* the modes' shapes stand to the root of their frequencies' 1e-9 */
        assert_true(left < 0.9 * trace);
        free(value);
        compliance_free(&G);
        modes_free(&modes);
        specimen_free(&s);
    }
}

static void weightless_body_has_no_modes(void **state)
{
    (void)state;
    uint64_t seed = 6;
    struct specimen s;
    struct failure why;
    struct modes modes;
    specimen_block(&s, 2, 2, 2, 0.1, 0.1, 0.1);
    specimen_shake(&s, 0.1, 0.05, &seed);
    specimen_material(&s, "all", E_Pa, 0.3);
    s.scene.material[0].rho_kg_m3 = 0;
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    specimen_model(&s);
    assert_int_equal(modes_find(s.model, 1, &modes, &why), STATUS_SCENE_VALUE);
    modes_free(&modes);
    specimen_free(&s);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bar_vibrates_along_itself_at_its_closed_form),
        cmocka_unit_test(cantilever_swings_at_its_closed_form),
        cmocka_unit_test(compliance_without_its_modes_stays_positive),
        cmocka_unit_test(weightless_body_has_no_modes),
    };
    return cmocka_run_group_tests_name("modes", tests, NULL, NULL);
}
