/* The weights of a tool on the surface, against integrals in closed form. */
#include "../accuracy/refine.h"
#include "patch.h"

static void centre_of(const struct specimen *s, uint32_t triangle, double centre[3])
{
    for (size_t a = 0; a < 3; a++) {
        centre[a] = 0;
        for (size_t k = 0; k < 3; k++)
            centre[a] +=
                s->mesh.nodes[3 * (size_t)s->surface.node[s->surface.triangles[3 * (size_t)triangle + k]] + a] / 3;
    }
}

/* Triangle whose centre is nearest. */
static uint32_t nearest(const struct specimen *s, double x, double y, double z)
{
    double least = INFINITY;
    uint32_t best = 0;
    for (uint32_t t = 0; t < s->surface.triangle_count; t++) {
        double c[3];
        centre_of(s, t, c);
        double d = (c[0] - x) * (c[0] - x) + (c[1] - y) * (c[1] - y) + (c[2] - z) * (c[2] - z);
        if (d < least) {
            least = d;
            best = t;
        }
    }
    return best;
}

static void block(struct specimen *s, size_t n, double thickness)
{
    struct failure why;
    specimen_block(s, n, n, 2, 0.2, 0.2, thickness);
    must(mesh_surface(&s->mesh, &s->surface, &why), &why);
}

static const double MIDDLE[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};

/* On a plane: resultant 1 at the centre, normal the plane's; the second moment is the kernel's a^2/3 plus what the hats add,
 * which the mesh bounds: the interpolation of r^2 is off by h^2/4 at most, h the longest edge. */
static void weights_have_the_resultant_the_centre_and_the_size_of_the_tool(void **state)
{
    (void)state;
    struct failure why;
    const double radius[3] = {0.03, 0.02, 0.01};
    for (size_t n = 8; n <= 32; n *= 2) {
        struct specimen s;
        block(&s, n, 0.1);
        for (int r = 0; r < 3; r++) {
            struct patch p;
            uint32_t t = nearest(&s, 0.11, 0.105, 0.1);
            must(patch_create(&s.mesh, &s.surface, t, MIDDLE, radius[r], &p, &why), &why);
            double sum = 0, first[3] = {0, 0, 0}, second = 0, c[3], h = 0.2 / (double)n * sqrt(2);
            centre_of(&s, t, c);
            for (size_t k = 0; k < p.count; k++) {
                const double *x = s.mesh.nodes + 3 * (size_t)s.surface.node[p.vertex[k]];
                assert_true(p.weight[k] > 0);
                assert_true(k == 0 || p.vertex[k] > p.vertex[k - 1]);
                sum += p.weight[k];
                for (int a = 0; a < 3; a++) {
                    first[a] += p.weight[k] * (x[a] - c[a]);
                    second += p.weight[k] * (x[a] - c[a]) * (x[a] - c[a]);
                    assert_true(fabs(p.centre_m[a] - c[a]) < 1e-15);
                }
            }
            print_message("# %2zu cells, radius %.0f mm: %3zu vertices, second moment %.3f of the kernel's\n", n,
                          1e3 * radius[r], p.count, 3 * second / (radius[r] * radius[r]));
            assert_true(fabs(sum - 1) < 1e-12);
            for (int a = 0; a < 3; a++)
                assert_true(fabs(first[a]) < 1e-3 * radius[r]); /* of the quadrature: patch.h */
            assert_true(second > radius[r] * radius[r] / 3 * 0.997 &&
                        second < radius[r] * radius[r] / 3 * 1.003 + h * h / 4);
            assert_true(fabs(p.normal[2] - 1) < 1e-12);
            patch_free(&p);
        }
        surface_free(&s.surface);
        mesh_free(&s.mesh);
    }
}

static void small_tool_is_a_point(void **state)
{
    (void)state;
    struct failure why;
    struct specimen s;
    block(&s, 8, 0.1);
    uint32_t t = nearest(&s, 0.1, 0.1, 0.1);
    const double at[3] = {0.5, 0.2, 0.3}, radius[3] = {1e-3, 1e-5, 1e-9};
    for (int r = 0; r < 3; r++) {
        struct patch p;
        must(patch_create(&s.mesh, &s.surface, t, at, radius[r], &p, &why), &why);
        assert_int_equal(p.count, 3);
        for (size_t k = 0; k < 3; k++)
            for (size_t i = 0; i < 3; i++)
                if (s.surface.triangles[3 * (size_t)t + i] == p.vertex[k]) /* inside the triangle the kernel is even */
                    assert_true(fabs(p.weight[k] - at[i]) < 1e-3);
        patch_free(&p);
    }
    surface_free(&s.surface);
    mesh_free(&s.mesh);
}

static void far_side_of_a_thin_body_is_not_pressed(void **state)
{
    (void)state;
    struct failure why;
    struct specimen s;
    struct patch p;
    block(&s, 16, 0.004);
    must(patch_create(&s.mesh, &s.surface, nearest(&s, 0.01, 0.1, 0.004), MIDDLE, 0.03, &p, &why), &why);
    for (size_t k = 0; k < p.count; k++)
        assert_true(s.mesh.nodes[3 * (size_t)s.surface.node[p.vertex[k]] + 2] > 0.0039);
    assert_true(p.normal[2] > 1 - 1e-12);
    patch_free(&p);
    surface_free(&s.surface);
    mesh_free(&s.mesh);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_have_the_resultant_the_centre_and_the_size_of_the_tool),
        cmocka_unit_test(small_tool_is_a_point),
        cmocka_unit_test(far_side_of_a_thin_body_is_not_pressed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
