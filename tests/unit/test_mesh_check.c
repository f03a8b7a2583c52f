#include <math.h>

#include "mesh_fixture.h"

static void a_box_is_measured_exactly(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(4);
    struct mesh_report r;
    struct failure why;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(r.nodes, 125);
    assert_int_equal(r.tetrahedra, 384);
    assert_int_equal(r.surface_vertices, 98);   /* 125 - 3^3 */
    assert_int_equal(r.surface_triangles, 192); /* 6 sides x 16 squares x 2 */
    assert_int_equal(r.reoriented, 192);        /* three of the six permutations are odd */
    assert_int_equal(r.components, 1);
    assert_int_equal(r.genus, 0);
    assert_true(fabs(r.volume - 64) < 64 * 384 * 2.3e-16); /* one rounding per element */
    assert_true(fabs(r.extent[0] - 4) + fabs(r.extent[1] - 4) + fabs(r.extent[2] - 4) < 1e-15);
    /* angles of Kuhn's simplex: 45, 60 and 90 degrees; atan2 and the division round twice */
    assert_true(fabs(r.dihedral_min_deg - 45) < 1e-13 && fabs(r.dihedral_max_deg - 90) < 1e-13);
    size_t angles = 0;
    for (int i = 0; i < 18; i++)
        angles += r.dihedral_histogram[i];
    assert_int_equal(angles, 6 * 384);
    assert_true(r.edge_min == 1 && fabs(r.edge_max - sqrt(3)) < 1e-15);
    mesh_free(&mesh);
}

/* The volume by the divergence theorem over the surface, and the surface's own vector sum. */
static double enclosed(const struct mesh *mesh, const struct surface *s, double sum[3])
{
    double volume = 0;
    sum[0] = sum[1] = sum[2] = 0;
    for (size_t t = 0; t < s->triangle_count; t++) {
        const double *p[3];
        for (int k = 0; k < 3; k++)
            p[k] = mesh->nodes + 3 * (size_t)s->node[s->triangles[3 * t + k]];
        for (int k = 0; k < 3; k++) {
            int l = (k + 1) % 3, m = (k + 2) % 3;
            double normal = (p[1][l] - p[0][l]) * (p[2][m] - p[0][m]) - (p[1][m] - p[0][m]) * (p[2][l] - p[0][l]);
            sum[k] += normal / 2;
            volume += p[0][k] * normal / 6;
        }
    }
    return volume;
}

static void the_surface_is_closed_and_turned_outwards(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(3);
    struct mesh_report r;
    struct surface s;
    struct failure why;
    double sum[3];
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(mesh_surface(&mesh, &s, &why), 0);
    assert_true(fabs(enclosed(&mesh, &s, sum) - r.volume) < 1e-12);
    assert_true(fabs(sum[0]) + fabs(sum[1]) + fabs(sum[2]) < 1e-12);
    double area = 0;
    for (size_t v = 0; v < s.vertex_count; v++) {
        const double *n = s.normals + 3 * v, *x = mesh.nodes + 3 * (size_t)s.node[v];
        double outwards = n[0] * (x[0] - 1.5) + n[1] * (x[1] - 1.5) + n[2] * (x[2] - 1.5);
        assert_true(outwards > 0 && fabs(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-15);
        assert_int_equal(s.vertex_of[s.node[v]], v);
        assert_true(v == 0 || s.node[v] > s.node[v - 1]);
        area += s.areas[v];
    }
    assert_true(fabs(area - 54) < 1e-12);
    /* at a corner of a cube, angle weights make the normal the diagonal whatever the triangulation */
    const double *corner = s.normals + 3 * (size_t)s.vertex_of[63];
    for (int k = 0; k < 3; k++)
        assert_true(fabs(corner[k] - 1 / sqrt(3)) < 1e-15);
    surface_free(&s);
    mesh_free(&mesh);
}

static void check_neighbours(const struct surface *s)
{
    for (size_t i = 0; i < 3 * s->triangle_count; i++) {
        const uint32_t *v = s->triangles + i / 3 * 3, *w = s->triangles + 3 * (size_t)s->neighbours[i];
        uint32_t a = v[(i + 1) % 3], b = v[(i + 2) % 3];
        int back = 0;
        for (int k = 0; k < 3; k++)
            back += w[(k + 1) % 3] == b && w[(k + 2) % 3] == a && s->neighbours[3 * s->neighbours[i] + k] == i / 3;
        assert_int_equal(back, 1);
    }
}

static void neighbours_are_mutual_and_share_the_edge(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(3);
    struct mesh_report r;
    struct surface s;
    struct failure why;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(mesh_surface(&mesh, &s, &why), 0);
    check_neighbours(&s);
    surface_free(&s);
    mesh_free(&mesh);
}

static const double two[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1, 0.2, 0.2, 0.3};

static void flipped_elements_are_repaired_and_counted(void **state)
{
    (void)state;
    struct mesh mesh = mesh_of(two, 5, (const uint32_t[]){0, 2, 1, 3, 1, 2, 3, 4}, 2);
    struct mesh_report r;
    struct failure why;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(r.reoriented, 1);
    assert_int_equal(r.overlapping, 0);
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(r.reoriented, 0);
    mesh_free(&mesh);
}

static void a_fold_over_is_refused(void **state)
{
    (void)state; /* node 5 lies inside the first element: both lie on one side of the face 1 2 3 */
    struct mesh mesh = mesh_of(two, 6, (const uint32_t[]){0, 1, 2, 3, 5, 1, 2, 3}, 2);
    struct mesh_report r;
    struct failure why;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_INVERTED);
    assert_int_equal(r.overlapping, 1);
    mesh_free(&mesh);
}

static void three_elements_at_a_face_are_refused(void **state)
{
    (void)state;
    struct mesh mesh = mesh_of(two, 6, (const uint32_t[]){0, 1, 2, 3, 4, 1, 2, 3, 5, 1, 2, 3}, 3);
    struct mesh_report r;
    struct failure why;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_INVERTED);
    mesh_free(&mesh);
}

static void a_degenerate_element_is_refused(void **state)
{
    (void)state;
    const double flat[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1};
    struct mesh mesh = mesh_of(flat, 5, (const uint32_t[]){0, 1, 2, 4, 0, 1, 2, 3}, 2);
    struct mesh_report r;
    struct failure why;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_DEGENERATE);
    assert_int_equal(r.degenerate, 1);
    assert_non_null(strstr(why.cause, "number 2"));
    mesh_free(&mesh);
    mesh = mesh_of(flat, 5, (const uint32_t[]){0, 1, 2, 2}, 1); /* a corner twice */
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_DEGENERATE);
    mesh_free(&mesh);
}

static void a_sliver_is_not_degenerate(void **state)
{
    (void)state; /* V / l^3 of about 1e-7 / 6: a hundred times the limit */
    const double thin[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1e-6};
    struct mesh mesh = mesh_of(thin, 4, (const uint32_t[]){0, 1, 2, 3}, 1);
    struct mesh_report r;
    struct failure why;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_true(r.dihedral_min_deg < 1e-3 && r.dihedral_min_deg > 0);
    mesh_free(&mesh);
}

static void duplicates_and_unused_nodes_are_removed(void **state)
{
    (void)state; /* node 5 = node 1 again, node 6 stands alone; the third element repeats the first, reordered */
    const double nodes[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1, 1, 0, 0, 9, 9, 9};
    struct mesh mesh = mesh_of(nodes, 7, (const uint32_t[]){0, 1, 2, 3, 5, 2, 3, 4, 3, 5, 2, 0}, 3);
    struct mesh_report r;
    struct failure why;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(r.duplicate_nodes, 1);
    assert_int_equal(r.unused_nodes, 1);
    assert_int_equal(r.duplicate_elements, 1);
    assert_int_equal(r.nodes, 7);
    assert_int_equal(mesh.node_count, 5);
    assert_int_equal(mesh.tetrahedron_count, 2);
    assert_true(r.maximum[0] == 1); /* the node that stands alone does not count */
    mesh_free(&mesh);
}

static void two_pieces_are_an_error_unless_allowed(void **state)
{
    (void)state;
    const double nodes[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 5, 0, 0, 6, 0, 0, 5, 1, 0, 5, 0, 1};
    struct mesh mesh = mesh_of(nodes, 8, (const uint32_t[]){0, 1, 2, 3, 4, 5, 6, 7}, 2);
    struct mesh_report r;
    struct failure why;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_COMPONENTS);
    assert_int_equal(r.components, 2);
    assert_int_equal(mesh_check(&mesh, true, &r, &why), 0);
    mesh_free(&mesh);
}

static void a_hinge_at_an_edge_or_a_node_is_refused(void **state)
{
    (void)state;
    const double nodes[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, -1, 0, 0, 0, -1, 0, 0, 0, -1};
    struct mesh_report r;
    struct failure why;
    struct mesh mesh = mesh_of(nodes, 7, (const uint32_t[]){0, 1, 2, 3, 0, 3, 4, 5}, 2); /* share the edge 0 3 */
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_NONMANIFOLD);
    assert_int_equal(r.nonmanifold_edges, 1);
    assert_int_equal(r.components, 1);
    mesh_free(&mesh);
    mesh = mesh_of(nodes, 7, (const uint32_t[]){0, 1, 2, 3, 0, 4, 5, 6}, 2); /* share the node 0 */
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_NONMANIFOLD);
    assert_int_equal(r.nonmanifold_edges, 0);
    assert_int_equal(r.nonmanifold_vertices, 1);
    mesh_free(&mesh);
}

/* Keep the cubes of a box for which keep(x, y, z) holds. */
static struct mesh carve(int n, bool (*keep)(int, int, int))
{
    struct mesh mesh = box_mesh(n);
    size_t kept = 0;
    for (size_t e = 0; e < mesh.tetrahedron_count; e++) {
        int c = (int)(e / 6);
        if (!keep(c % n, c / n % n, c / n / n))
            continue;
        memmove(mesh.tetrahedra + 4 * kept, mesh.tetrahedra + 4 * e, 4 * sizeof *mesh.tetrahedra);
        mesh.labels[kept++] = mesh.labels[e];
    }
    mesh.tetrahedron_count = kept;
    return mesh;
}

static bool ring(int x, int y, int z)
{
    return z == 1 && (x != 1 || y != 1);
}

static bool hollow(int x, int y, int z)
{
    return x != 1 || y != 1 || z != 1;
}

/* All but two cubes that touch along an edge: a body whose surface pinches at one edge inside a whole. */
static bool pinched(int x, int y, int z)
{
    return !(x == 0 && y == 0 && z == 1) && !(x == 1 && y == 1 && z == 1);
}

static void topology_of_a_ring_a_shell_and_a_pinch(void **state)
{
    (void)state;
    struct mesh_report r;
    struct failure why;
    struct mesh mesh = carve(3, ring);
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(r.genus, 1);
    mesh_free(&mesh);
    mesh = carve(3, hollow);
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(r.genus, 0); /* two spheres: Euler characteristic 4 */
    assert_int_equal(r.components, 1);
    assert_true(fabs(r.volume - 26) < 1e-12);
    mesh_free(&mesh);
    mesh = carve(3, pinched);
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(r.nonmanifold_edges, 1);
    struct surface s;
    assert_int_equal(mesh_surface(&mesh, &s, &why), 0);
    check_neighbours(&s);
    surface_free(&s);
    mesh_free(&mesh);
}

static void impossible_meshes_are_refused(void **state)
{
    (void)state;
    struct mesh_report r;
    struct failure why;
    struct mesh mesh = mesh_of(two, 5, (const uint32_t[]){0, 1, 2, 7}, 1);
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_INDEX);
    mesh.tetrahedra[3] = 3;
    mesh.nodes[2] = NAN;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_NONFINITE);
    mesh.tetrahedron_count = 0;
    assert_int_equal(mesh_check(&mesh, false, &r, &why), STATUS_MESH_EMPTY);
    mesh_free(&mesh);
}

static void the_scale_is_explicit(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2);
    struct failure why;
    assert_int_equal(mesh_scale(&mesh, 0, MESH_UNIT_NONE, &why), STATUS_MESH_SIZE);
    assert_int_equal(mesh_scale(&mesh, -1, MESH_UNIT_M, &why), STATUS_MESH_SIZE);
    assert_int_equal(mesh_scale(&mesh, NAN, MESH_UNIT_M, &why), STATUS_MESH_SIZE);
    assert_int_equal(mesh_scale(&mesh, 0, MESH_UNIT_MM, &why), 0);
    assert_true(fabs(mesh.nodes[3 * 26] - 2e-3) < 1e-18);
    assert_int_equal(mesh_scale(&mesh, 0.214, MESH_UNIT_MM, &why), 0);
    assert_true(fabs(mesh.nodes[3 * 26] - 0.214) < 1e-16);
    mesh_free(&mesh);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_box_is_measured_exactly),
        cmocka_unit_test(the_surface_is_closed_and_turned_outwards),
        cmocka_unit_test(neighbours_are_mutual_and_share_the_edge),
        cmocka_unit_test(flipped_elements_are_repaired_and_counted),
        cmocka_unit_test(a_fold_over_is_refused),
        cmocka_unit_test(three_elements_at_a_face_are_refused),
        cmocka_unit_test(a_degenerate_element_is_refused),
        cmocka_unit_test(a_sliver_is_not_degenerate),
        cmocka_unit_test(duplicates_and_unused_nodes_are_removed),
        cmocka_unit_test(two_pieces_are_an_error_unless_allowed),
        cmocka_unit_test(a_hinge_at_an_edge_or_a_node_is_refused),
        cmocka_unit_test(topology_of_a_ring_a_shell_and_a_pinch),
        cmocka_unit_test(impossible_meshes_are_refused),
        cmocka_unit_test(the_scale_is_explicit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
