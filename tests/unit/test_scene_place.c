#include <math.h>

#include "mesh_fixture.h"
#include "scene_fixture.h"

struct body {
    struct mesh mesh;
    struct surface surface;
    struct scene scene;
    bool *fixed;
    double extent;
};

static bool body_open(struct body *b, const char *name, double extent_m)
{
    const char *path = data_path(name);
    struct mesh_report report;
    struct failure why;
    if (!path)
        return false;
    scene_assume(path, extent_m, MESH_UNIT_NONE, &b->scene);
    if (mesh_read(path, 0, &b->mesh, &why) || mesh_check(&b->mesh, true, &report, &why) ||
        mesh_scale(&b->mesh, extent_m, MESH_UNIT_NONE, &why) || mesh_surface(&b->mesh, &b->surface, &why))
        fail_msg("%s: %s", name, why.cause);
    b->extent = extent_m;
    bool *inside = malloc(b->mesh.node_count);
    b->fixed = malloc(b->surface.vertex_count);
    size_t count;
    assert_int_equal(scene_select(&b->scene.fixed[0].where, &b->scene, &b->mesh, &b->surface, inside, &count, &why),
                     STATUS_OK);
    for (size_t v = 0; v < b->surface.vertex_count; v++)
        b->fixed[v] = inside[b->surface.node[v]];
    free(inside);
    return true;
}

static void body_close(struct body *b)
{
    free(b->fixed);
    surface_free(&b->surface);
    mesh_free(&b->mesh);
}

static double volume6(const double *a, const double *b, const double *c, const double *d)
{
    double u[3], v[3], w[3];
    for (int i = 0; i < 3; i++) {
        u[i] = b[i] - a[i];
        v[i] = c[i] - a[i];
        w[i] = d[i] - a[i];
    }
    return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

/* Where the segment of an instrument meets the body first, by signs of volumes: another method than the code's. */
static double first_hit(const struct body *b, const struct scene_instrument *s, double reach, size_t *triangle)
{
    double end[3], nearest = INFINITY;
    for (int i = 0; i < 3; i++)
        end[i] = s->trocar_m[i] + reach * s->axis[i];
    for (size_t t = 0; t < b->surface.triangle_count; t++) {
        const double *p[3];
        for (int k = 0; k < 3; k++)
            p[k] = &b->mesh.nodes[3 * b->surface.node[b->surface.triangles[3 * t + k]]];
        double x = volume6(s->trocar_m, end, p[0], p[1]), y = volume6(s->trocar_m, end, p[1], p[2]),
               z = volume6(s->trocar_m, end, p[2], p[0]);
        double above = volume6(p[0], p[1], p[2], s->trocar_m), below = volume6(p[0], p[1], p[2], end);
        bool through = (x >= 0 && y >= 0 && z >= 0) || (x <= 0 && y <= 0 && z <= 0);
        if (!through || (above > 0) == (below > 0) || above == below)
            continue;
        double at = reach * above / (above - below);
        if (at < nearest) {
            nearest = at;
            *triangle = t;
        }
    }
    return nearest;
}

static const struct {
    const char *file;
    double extent_m;
} bodies[] = {
    {"liver.msh", 0.214},
    {"liver2.msh", 0.214},
    {"liver_smooth_412_1336.msh", 0.214},
    {"liver_smooth_1665_6691.msh", 0.214},
    {"liver_smooth_6267_29596.msh", 0.214},
    {"cylinder_8x30x6.msh", 0.3},
    {"torus_low_res.msh", 0.2},
    {"sphereInCube_3899.vtk", 0.2},
    {"Armadillo_Tetra_4406.vtu", 0.2},
    {"Ossicles.vtu", 0.2},
    {"liver_733.node", 0.214},
    {"turtle-volumetric-heterogeneous.veg", 0.2},
    {"turtle-volumetric-heterogeneous.ortho.veg", 0.2},
    {"beam3_tet.veg", 0.2},
};

static double touch(const struct body *b, const struct scene_instrument *s, double hit[3], size_t *triangle)
{
    double at = first_hit(b, s, 1, triangle);
    for (int i = 0; i < 3; i++)
        hit[i] = s->trocar_m[i] + at * s->axis[i];
    return at;
}

static void placed_instruments_meet_free_tissue_within_reach(void **state)
{
    (void)state;
    size_t seen = 0;
    for (size_t k = 0; k < sizeof bodies / sizeof bodies[0]; k++) {
        struct body b = {0};
        if (!body_open(&b, bodies[k].file, bodies[k].extent_m))
            continue;
        seen++;
        scene_place_instruments(&b.scene, &b.mesh, &b.surface, b.fixed);
        const struct scene_instrument *s = &b.scene.instrument[0];
        assert_true(s->placed);
        assert_true(fabs(hypot(hypot(s->axis[0], s->axis[1]), s->axis[2]) - 1) < 1e-15);
        double hit[3], nearest_fixed = INFINITY;
        size_t triangle = 0;
        double at = touch(&b, s, hit, &triangle);
        for (int c = 0; c < 3 && at < INFINITY; c++)
            assert_false(b.fixed[b.surface.triangles[3 * triangle + c]]);
        for (size_t v = 0; v < b.surface.vertex_count; v++) {
            const double *x = &b.mesh.nodes[3 * b.surface.node[v]];
            if (b.fixed[v])
                nearest_fixed = fmin(nearest_fixed, hypot(hypot(x[0] - hit[0], x[1] - hit[1]), x[2] - hit[2]));
        }
        print_message("# %s: touches at %.3f m, %.0f %% of the extent from fixed vertices\n", bodies[k].file, at,
                      100 * nearest_fixed / b.extent);
        /* 30 mm before and 40 mm behind lie within the insertion range; 1e-9 m for two ways to compute the same point */
        assert_true(at - 0.030 >= s->length_min_m - 1e-9 && at + 0.040 <= s->length_max_m + 1e-9);
        assert_true(nearest_fixed >= 0.25 * b.extent);
        body_close(&b);
    }
    if (!seen) {
        print_message("# the folder of third-party meshes is not here\n");
        skip();
    }
}

static void placement_is_deterministic_and_leaves_placed_instruments(void **state)
{
    (void)state;
    struct body b = {.mesh = box_mesh(6), .extent = 0.06};
    struct mesh_report report;
    struct failure why;
    assert_int_equal(mesh_check(&b.mesh, false, &report, &why), STATUS_OK);
    assert_int_equal(mesh_scale(&b.mesh, 0, MESH_UNIT_CM, &why), STATUS_OK);
    assert_int_equal(mesh_surface(&b.mesh, &b.surface, &why), STATUS_OK);
    b.fixed = calloc(b.surface.vertex_count, 1);
    assert_int_equal(parse(scene_full, "", &b.scene, &why), STATUS_OK);
    struct scene first = b.scene, second = b.scene;
    scene_place_instruments(&first, &b.mesh, &b.surface, b.fixed);
    scene_place_instruments(&second, &b.mesh, &b.surface, b.fixed);
    assert_memory_equal(&first, &second, sizeof first);
    assert_memory_equal(&first.instrument[0], &b.scene.instrument[0], sizeof first.instrument[0]);
    assert_true(first.instrument[1].placed);

    /* Two unplaced ones do not touch the same spot. */
    b.scene.instrument[0].placed = false;
    scene_place_instruments(&b.scene, &b.mesh, &b.surface, b.fixed);
    double hit[2][3];
    for (int k = 0; k < 2; k++) {
        size_t triangle;
        assert_true(touch(&b, &b.scene.instrument[k], hit[k], &triangle) < INFINITY);
    }
    assert_true(hypot(hypot(hit[0][0] - hit[1][0], hit[0][1] - hit[1][1]), hit[0][2] - hit[1][2]) >= 0.15 * b.extent);
    body_close(&b);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(placed_instruments_meet_free_tissue_within_reach),
        cmocka_unit_test(placement_is_deterministic_and_leaves_placed_instruments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
