/* The third-party meshes: counts as their README states them, and laws that hold for every mesh. */
#include <math.h>

#include "mesh_fixture.h"

static const struct expected {
    const char *name;
    size_t nodes, tetrahedra, surface_vertices, labels, reoriented, genus;
    double low_deg, high_deg; /* the smallest dihedral angle lies between; 0, 0: not stated */
} files[] = {
    {"liver.msh", 181, 596, 0, 1, 0, 0, 0, 0},
    {"liver2.msh", 507, 1493, 0, 1, 0, 0, 0, 0},
    {"liver_smooth_412_1336.msh", 412, 1336, 347, 1, 0, 0, 0, 0},
    {"liver_smooth_1665_6691.msh", 1665, 6691, 1084, 1, 0, 0, 0, 0},
    {"liver_smooth_6267_29596.msh", 6267, 29596, 2910, 1, 0, 0, 0, 0},
    {"cylinder_8x30x6.msh", 1446, 6750, 0, 1, 0, 0, 0, 0},
    {"sphereInCube_3899.vtk", 956, 3899, 0, 2, 0, 0, 0, 0},
    {"torus_low_res.msh", 264, 862, 0, 1, 0, 1, 0, 0},
    {"Armadillo_Tetra_4406.vtu", 1446, 4406, 0, 1, 0, 0, 0.55, 0.65},
    {"Ossicles.vtu", 1733, 5058, 0, 1, 0, 0, 0.125, 0.135},
    {"liver_733.node", 175, 733, 0, 1, 371, 0, 0, 0},
    {"liver_733.ele", 175, 733, 0, 1, 371, 0, 0, 0},
    {"turtle-volumetric-heterogeneous.veg", 347, 1185, 0, 1, 0, 0, 0, 0},
    {"turtle-volumetric-heterogeneous.ortho.veg", 347, 1185, 0, 1, 0, 0, 0, 0},
    {"beam3_tet.veg", 208, 450, 0, 1, 0, 0, 0, 0},
};

/* Volume by the divergence theorem, and the sum of area vectors, over the surface about its first vertex. */
static void check_closed(const struct mesh *mesh, const struct mesh_report *r)
{
    struct surface s;
    struct failure why;
    double volume = 0, sum[3] = {0}, area = 0, shares = 0;
    assert_int_equal(mesh_surface(mesh, &s, &why), 0);
    const double *o = mesh->nodes + 3 * (size_t)s.node[0];
    for (size_t t = 0; t < s.triangle_count; t++) {
        double p[3][3], normal[3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                p[i][k] = mesh->nodes[3 * (size_t)s.node[s.triangles[3 * t + i]] + k] - o[k];
        for (int k = 0; k < 3; k++) {
            int l = (k + 1) % 3, m = (k + 2) % 3;
            normal[k] = (p[1][l] - p[0][l]) * (p[2][m] - p[0][m]) - (p[1][m] - p[0][m]) * (p[2][l] - p[0][l]);
            sum[k] += normal[k] / 2;
        }
        volume += (p[0][0] * normal[0] + p[0][1] * normal[1] + p[0][2] * normal[2]) / 6;
        area += sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) / 2;
        for (int k = 0; k < 3; k++) { /* neighbours are mutual and share the edge */
            const uint32_t *v = s.triangles + 3 * t, *w = s.triangles + 3 * (size_t)s.neighbours[3 * t + k];
            int back = 0;
            for (int j = 0; j < 3; j++)
                back += w[(j + 1) % 3] == v[(k + 2) % 3] && w[(j + 2) % 3] == v[(k + 1) % 3] &&
                        s.neighbours[3 * (size_t)s.neighbours[3 * t + k] + j] == t;
            assert_int_equal(back, 1);
        }
    }
    for (size_t v = 0; v < s.vertex_count; v++)
        shares += s.areas[v];
    double longest = fmax(r->extent[0], fmax(r->extent[1], r->extent[2]));
    /* each of n terms rounds by a few units of 1.1e-16 of at most (area x length); 16 is generous for the products */
    double rounding = 16 * 1.1e-16 * area * (double)s.triangle_count;
    assert_true(fabs(volume - r->volume) <= rounding * longest);
    assert_true(fabs(sum[0]) <= rounding && fabs(sum[1]) <= rounding && fabs(sum[2]) <= rounding);
    assert_true(fabs(shares - area) <= rounding);
    if (r->nonmanifold_edges == 0 && r->nonmanifold_vertices == 0 && r->components == 1)
        assert_int_equal((int64_t)s.vertex_count - (int64_t)s.triangle_count / 2, 2 - 2 * (int64_t)r->genus);
    surface_free(&s);
}

static void every_volume_is_read_with_its_counts(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        const struct expected *x = &files[i];
        const char *path = data_path(x->name);
        struct mesh mesh;
        struct mesh_report r;
        struct failure why;
        if (!path) {
            print_message("# %s is not there: skipped\n", x->name);
            continue;
        }
        if (mesh_read(path, 0, &mesh, &why) != 0 || mesh_check(&mesh, false, &r, &why) != 0)
            fail_msg("%s: %s: %s", x->name, why.place, why.cause);
        assert_int_equal(r.nodes, x->nodes);
        assert_int_equal(r.tetrahedra, x->tetrahedra);
        assert_int_equal(mesh.label_count, x->labels);
        assert_int_equal(r.reoriented, x->reoriented);
        assert_int_equal(r.genus, x->genus);
        assert_int_equal(r.components, 1);
        assert_int_equal(r.duplicate_nodes + r.duplicate_elements + r.unused_nodes + r.degenerate + r.overlapping, 0);
        if (x->surface_vertices)
            assert_int_equal(r.surface_vertices, x->surface_vertices);
        if (x->high_deg > 0)
            assert_true(r.dihedral_min_deg > x->low_deg && r.dihedral_min_deg < x->high_deg);
        if (strstr(x->name, "turtle")) /* the sets stand in files that are not there: said, not hidden */
            assert_non_null(strstr(mesh.warning, "shellElementList.txt"));
        else
            assert_string_equal(mesh.warning, "");
        check_closed(&mesh, &r);
        mesh_free(&mesh);
    }
}

static void the_bad_one_is_refused_for_what_is_wrong_with_it(void **state)
{
    (void)state;
    const char *path = data_path("6_tetra_bad.msh");
    struct mesh mesh;
    struct mesh_report r;
    struct failure why;
    if (!path)
        skip();
    assert_int_equal(mesh_read(path, 0, &mesh, &why), 0);
    /* one of six is inverted, which is repaired; but each touches the others at single nodes only: a chain of joints */
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_NONMANIFOLD);
    assert_int_equal(r.reoriented, 1);
    assert_int_equal(r.components, 1);
    assert_int_equal(r.nonmanifold_vertices, 5);
    assert_non_null(strstr(why.cause, "6 parts"));
    mesh_free(&mesh);
}

static void a_material_is_read_from_cell_scalars(void **state)
{
    (void)state;
    const char *path = data_path("sphereInCube_3899.vtk");
    struct mesh mesh;
    struct failure why;
    double volume[2] = {0};
    if (!path)
        skip();
    assert_int_equal(mesh_read(path, 0, &mesh, &why), 0);
    for (size_t e = 0; e < mesh.tetrahedron_count; e++) {
        const uint32_t *c = mesh.tetrahedra + 4 * e;
        double a[3][3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                a[i][k] = mesh.nodes[3 * (size_t)c[i + 1] + k] - mesh.nodes[3 * (size_t)c[0] + k];
        volume[mesh.labels[e] == mesh.label[1].number] +=
            fabs(a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) + a[0][1] * (a[1][2] * a[2][0] - a[1][0] * a[2][2]) +
                 a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0])) /
            6;
    }
    assert_true(fabs(volume[0] + volume[1] - 1e-3) < 1e-9); /* a cube of 0.1, printed with about 6 digits */
    mesh_free(&mesh);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_volume_is_read_with_its_counts),
        cmocka_unit_test(the_bad_one_is_refused_for_what_is_wrong_with_it),
        cmocka_unit_test(a_material_is_read_from_cell_scalars),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
