/* Materials by a table of intensities, and directions that are node data: from each kind of file, against the same body
 * with labels, or with one direction for all. */
#include <unistd.h>

#include "bank.h"
#include "mesh_data.h"
#include "specimen.h"

enum format { GMSH, VTK, VTU, CSV, FORMATS };
static const char *const file_name[FORMATS] = {"a.msh", "a.vtk", "a.vtu", "b.msh"};
static char folder[] = "/tmp/trocar-tissue-XXXXXX";

static const double THRESHOLD = 0.0437; /* m along x: no element's mean is near it */

static double intensity(const double *x)
{
    return 1000 * x[0] - 20;
}

/* Label 2 where the mean intensity of the corners is above that of the threshold. */
static void label_by_place(struct mesh *mesh)
{
    mesh->label_count = 2;
    mesh->label[0].number = 1;
    mesh->label[1].number = 2;
    for (size_t e = 0; e < mesh->tetrahedron_count; e++) {
        double mean = 0;
        for (int k = 0; k < 4; k++)
            mean += mesh->nodes[3 * (size_t)mesh->tetrahedra[4 * e + (size_t)k]] / 4;
        mesh->labels[e] = mean > THRESHOLD ? 2 : 1;
    }
}

static FILE *create(const char *name)
{
    char path[200];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    return out;
}

/* Nodes 100, 103, ... in the Gmsh file: numbers are not places. `hole`: this node has no value. */
static void write_gmsh(const struct mesh *mesh, const char *name, bool data, bool labels, size_t hole)
{
    FILE *out = create(name);
    size_t n = mesh->node_count;
    fprintf(out, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n%zu\n", n);
    for (size_t i = 0; i < n; i++)
        fprintf(out, "%zu %.17g %.17g %.17g\n", 100 + 3 * i, mesh->nodes[3 * i], mesh->nodes[3 * i + 1],
                mesh->nodes[3 * i + 2]);
    fprintf(out, "$EndNodes\n$Elements\n%zu\n", mesh->tetrahedron_count);
    for (size_t e = 0; e < mesh->tetrahedron_count; e++) {
        const uint32_t *v = mesh->tetrahedra + 4 * e;
        fprintf(out, "%zu 4 2 %d 1 %u %u %u %u\n", e + 1, labels ? (int)mesh->labels[e] : 1, 100 + 3 * v[0],
                100 + 3 * v[1], 100 + 3 * v[2], 100 + 3 * v[3]);
    }
    fprintf(out, "$EndElements\n");
    if (data) {
        fprintf(out, "$NodeData\n1\n\"HU\"\n1\n0.0\n3\n0\n1\n%zu\n", n - (hole < n));
        for (size_t i = n; i-- > 0;)
            if (i != hole)
                fprintf(out, "%zu %.17g\n", 100 + 3 * i, intensity(mesh->nodes + 3 * i));
        fprintf(out, "$EndNodeData\n$NodeData\n1\n\"fibres\"\n1\n0.0\n3\n0\n3\n%zu\n", n);
        for (size_t i = 0; i < n; i++) /* the sign of an axis means nothing */
            fprintf(out, "%zu %s\n", 100 + 3 * i, i % 3 ? "3 0 4" : "-6 0 -8");
        fprintf(out, "$EndNodeData\n");
    }
    fclose(out);
}

static void write_numbers(FILE *out, const struct mesh *mesh, int what)
{
    for (size_t i = 0; i < (what == 2 || what == 3 ? mesh->tetrahedron_count : mesh->node_count); i++)
        switch (what) {
        case 0:
            fprintf(out, "%.17g %.17g %.17g\n", mesh->nodes[3 * i], mesh->nodes[3 * i + 1], mesh->nodes[3 * i + 2]);
            break;
        case 1:
            fprintf(out, "%.17g\n", intensity(mesh->nodes + 3 * i));
            break;
        case 2: {
            const uint32_t *v = mesh->tetrahedra + 4 * i;
            fprintf(out, "%u %u %u %u\n", v[0], v[1], v[2], v[3]);
            break;
        }
        case 3:
            fprintf(out, "%zu\n", 4 * (i + 1));
            break;
        default:
            fprintf(out, "%s\n", i % 3 ? "3 0 4" : "-6 0 -8");
        }
}

static void write_vtk(const struct mesh *mesh)
{
    FILE *out = create("a.vtk");
    fprintf(out, "# vtk DataFile Version 3.0\nbody\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS %zu double\n",
            mesh->node_count);
    write_numbers(out, mesh, 0);
    fprintf(out, "CELLS %zu %zu\n", mesh->tetrahedron_count, 5 * mesh->tetrahedron_count);
    for (size_t e = 0; e < mesh->tetrahedron_count; e++) {
        const uint32_t *v = mesh->tetrahedra + 4 * e;
        fprintf(out, "4 %u %u %u %u\n", v[0], v[1], v[2], v[3]);
    }
    fprintf(out, "CELL_TYPES %zu\n", mesh->tetrahedron_count);
    for (size_t e = 0; e < mesh->tetrahedron_count; e++)
        fprintf(out, "10\n");
    fprintf(out, "POINT_DATA %zu\nSCALARS HU double 1\nLOOKUP_TABLE default\n", mesh->node_count);
    write_numbers(out, mesh, 1);
    fprintf(out, "VECTORS fibres double\n");
    write_numbers(out, mesh, 4);
    fclose(out);
}

static void write_vtu(const struct mesh *mesh)
{
    FILE *out = create("a.vtu");
    fprintf(out,
            "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\"><UnstructuredGrid>\n"
            "<Piece NumberOfPoints=\"%zu\" NumberOfCells=\"%zu\"><PointData>\n"
            "<DataArray type=\"Float64\" Name=\"HU\" format=\"ascii\">\n",
            mesh->node_count, mesh->tetrahedron_count);
    write_numbers(out, mesh, 1);
    fprintf(out,
            "</DataArray><DataArray type=\"Float64\" Name=\"fibres\" NumberOfComponents=\"3\" format=\"ascii\">\n");
    write_numbers(out, mesh, 4);
    fprintf(out, "</DataArray></PointData><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" "
                 "format=\"ascii\">\n");
    write_numbers(out, mesh, 0);
    fprintf(out, "</DataArray></Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">\n");
    write_numbers(out, mesh, 2);
    fprintf(out, "</DataArray><DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">\n");
    write_numbers(out, mesh, 3);
    fprintf(out, "</DataArray><DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">\n");
    for (size_t e = 0; e < mesh->tetrahedron_count; e++)
        fprintf(out, "10\n");
    fprintf(out, "</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>\n");
    fclose(out);
}

/* Rows in another order, coordinates with 9 digits, a row that belongs to no node; `hole` is left out. */
static void write_csv(const struct mesh *mesh, size_t hole, const char *extra)
{
    FILE *out = create("ct.csv");
    fprintf(out, "# sampled at the nodes\nx, y, z, HU\n");
    for (size_t i = mesh->node_count; i-- > 0;) {
        const double *x = mesh->nodes + 3 * i;
        if (i != hole)
            fprintf(out, "%.9g, %.9g, %.9g, %.17g\n", x[0], x[1], x[2], intensity(x));
    }
    fprintf(out, "7, 7, 7, 1e6\n%s", extra);
    fclose(out);
}

static void body_mesh(struct specimen *s)
{
    uint64_t seed = 8;
    specimen_block(s, 4, 4, 4, 0.1, 0.1, 0.1);
    specimen_shake(s, 0.2, 0.025, &seed);
    specimen_renumber(s, &seed);
    label_by_place(&s->mesh);
}

static const char head[] = "scene: s\nbody:\n  mesh: {file: %s, unit: m, order: linear}\n";
static const char held[] = "  fixed: [{box: {from: [0, 0, 0], to: [0, 0.1, 0.1]}}]\n";
static const char soft[] = "E: 4 kPa, nu: 0.45, rho: 1000 kg/m3}\n", stiff[] = "E: 20 kPa, nu: 0.3, rho: 1100 kg/m3}\n";
static const char fibres[] =
    "transverse: {E_L: 30 kPa, E_T: 10 kPa, G_LT: 4 kPa, nu_LT: 0.4, nu_TT: 0.6}, rho: 1000 kg/m3, along: ";

static int open_body(const char *file, const char *more, struct body *body, struct failure *why)
{
    char text[3000], path[200];
    struct scene scene;
    int n = snprintf(text, sizeof text, head, file);
    snprintf(text + n, sizeof text - (size_t)n, "%s%s", more, held);
    snprintf(path, sizeof path, "%s/s.yaml", folder);
    memset(why, 0, sizeof *why);
    int status = scene_parse(text, strlen(text), path, &scene, why);
    return status ? status : body_from_scene(&scene, body, NULL, why);
}

static void compliance_of(const char *file, const char *more, struct compliance *c, double *mass)
{
    struct body body;
    struct failure why;
    must(open_body(file, more, &body, &why), &why);
    must(compliance_build(body.model, true, c, &why), &why);
    *mass = model_mass(body.model);
    body_close(&body);
}

static void intensities_give_the_bank_that_labels_give(void **state)
{
    (void)state;
    char labels[600], tissue[800];
    struct compliance wanted;
    double mass;
    snprintf(labels, sizeof labels, "  materials:\n    - {label: 1, %s    - {label: 2, %s", soft, stiff);
    compliance_of("labels.msh", labels, &wanted, &mass);
    for (int f = 0; f < FORMATS; f++) {
        struct compliance c;
        double own_mass;
        snprintf(tissue, sizeof tissue,
                 "  intensities: {array: HU%s}\n  materials:\n    - {intensity: %.17g..1000, %s    - {intensity: "
                 "-1000..%.17g, %s",
                 f == CSV ? ", file: ct.csv" : "", 1000 * THRESHOLD - 20, stiff, 1000 * THRESHOLD - 20, soft);
        compliance_of(file_name[f], tissue, &c, &own_mass);
        assert_int_equal(c.rows, wanted.rows);
        assert_memory_equal(c.G, wanted.G, 9 * c.rows * c.rows * sizeof *c.G);
        assert_true(own_mass == mass);
        compliance_free(&c);
        /* a range wins over none, so that one material may take the rest */
        snprintf(tissue, sizeof tissue,
                 "  intensities: {array: HU%s}\n  materials:\n    - {%s    - {intensity: %.17g..1e6, %s",
                 f == CSV ? ", file: ct.csv" : "", soft, 1000 * THRESHOLD - 20, stiff);
        compliance_of(file_name[f], tissue, &c, &own_mass);
        assert_memory_equal(c.G, wanted.G, 9 * c.rows * c.rows * sizeof *c.G);
        compliance_free(&c);
    }
    compliance_free(&wanted);
}

static void directions_at_the_nodes_are_axes_without_a_sign(void **state)
{
    (void)state;
    char text[800];
    struct compliance wanted;
    double mass, top = 0;
    snprintf(text, sizeof text, "  materials: [{%s[3, 0, 4]}]\n", fibres);
    compliance_of("labels.msh", text, &wanted, &mass);
    for (size_t i = 0; i < 9 * wanted.rows * wanted.rows; i++)
        top = fmax(top, i / (3 * wanted.rows) >= i % (3 * wanted.rows) ? fabs(wanted.G[i]) : 0);
    for (int f = 0; f < CSV; f++) {
        struct compliance c;
        double worst = 0;
        snprintf(text, sizeof text, "  materials: [{%s{array: fibres}}]\n", fibres);
        compliance_of(file_name[f], text, &c, &mass);
        for (size_t i = 0; i < 9 * c.rows * c.rows; i++)
            if (i / (3 * c.rows) == i % (3 * c.rows)) /* the diagonal, whichever half is stored */
                worst = fmax(worst, fabs(c.G[i] - wanted.G[i]) / top);
        print_message("# %s: %.1e\n", file_name[f], worst);
        assert_true(worst < 1e-10); /* rounding of the axes, times the condition of K (test_stiffness.c) */
        compliance_free(&c);
    }
    compliance_free(&wanted);
}

static void missing_values_are_named_with_their_place(void **state)
{
    (void)state;
    char by_mesh[300], by_table[300], gap[400], by_fibres[400];
    snprintf(by_mesh, sizeof by_mesh, "  intensities: {array: HU}\n  materials: [{intensity: -1000..1000, %s]\n", soft);
    snprintf(by_table, sizeof by_table,
             "  intensities: {array: HU, file: ct.csv}\n  materials: [{intensity: -1000..1000, %s]\n", soft);
    snprintf(gap, sizeof gap, "  intensities: {array: HU}\n  materials: [{intensity: -1000..30, %s]\n", soft);
    snprintf(by_fibres, sizeof by_fibres, "  materials: [{%s{array: HU}}]\n", fibres);
    struct specimen s;
    body_mesh(&s);
    struct body body;
    struct failure why;
    char expected[200];
    write_gmsh(&s.mesh, "hole.msh", true, false, 5);
    assert_int_equal(open_body("hole.msh", by_mesh, &body, &why), STATUS_MODEL_DATA);
    print_message("# %s: %s\n", why.place, why.cause);
    snprintf(expected, sizeof expected, "node 5 at (%.4g, %.4g, %.4g) m has no intensity 'HU'", s.mesh.nodes[15],
             s.mesh.nodes[16], s.mesh.nodes[17]);
    assert_string_equal(why.cause, expected);
    assert_int_equal(open_body("labels.msh", by_mesh, &body, &why), STATUS_MODEL_DATA);
    assert_non_null(strstr(why.cause, "has no node data 'HU'"));
    assert_non_null(strstr(why.place, "s.yaml:4"));
    assert_int_equal(open_body("a.msh", gap, &body, &why), STATUS_MODEL_LABEL);
    print_message("# %s: %s\n", why.place, why.cause);
    assert_non_null(strstr(why.cause, "with mean intensity"));
    assert_int_equal(open_body("a.msh", by_fibres, &body, &why), STATUS_MODEL_DATA);
    assert_non_null(strstr(why.cause, "have 1 components"));

    write_csv(&s.mesh, 11, "");
    assert_int_equal(open_body("b.msh", by_table, &body, &why), STATUS_MODEL_DATA);
    assert_non_null(strstr(why.cause, "node 11 at"));
    write_csv(&s.mesh, SIZE_MAX, "0, 0, 0\n");
    assert_int_equal(open_body("b.msh", by_table, &body, &why), STATUS_TABLE_SYNTAX);
    assert_non_null(strstr(why.cause, "fewer fields than the header's 4"));
    assert_non_null(strstr(why.place, "ct.csv:129")); /* two lines of head, 125 nodes, one that is none */
    write_csv(&s.mesh, SIZE_MAX, "0, 0, x, 3\n");
    assert_int_equal(open_body("b.msh", by_table, &body, &why), STATUS_TABLE_SYNTAX);
    assert_non_null(strstr(why.cause, "'x' in column 'z' is not a number"));
    write_csv(&s.mesh, SIZE_MAX, "0, 0, 0, 3\n");
    assert_int_equal(open_body("b.msh", by_table, &body, &why), STATUS_TABLE_SYNTAX);
    assert_non_null(strstr(why.cause, "a second intensity at (0, 0, 0): 3, before -20"));
    specimen_free(&s);
}

static void two_ranges_that_overlap_are_refused(void **state)
{
    (void)state;
    char text[600];
    struct body body;
    struct failure why;
    snprintf(text, sizeof text,
             "  intensities: {array: HU}\n  materials:\n    - {intensity: -10..30, %s    - {intensity: 29..50, %s",
             soft, stiff);
    assert_int_equal(open_body("a.msh", text, &body, &why), STATUS_SCENE_VALUE);
    assert_non_null(strstr(why.cause, "for a part of these intensities, in line 6"));
    snprintf(text, sizeof text, "  materials: [{intensity: 0..1, %s]\n", soft);
    assert_int_equal(open_body("a.msh", text, &body, &why), STATUS_SCENE_MISSING);
    snprintf(text, sizeof text, "  intensities: {array: HU}\n  materials: [{intensity: 3..1, %s]\n", soft);
    assert_int_equal(open_body("a.msh", text, &body, &why), STATUS_SCENE_VALUE);
}

static int write_files(void **state)
{
    (void)state;
    struct specimen s;
    assert_non_null(mkdtemp(folder));
    body_mesh(&s);
    write_gmsh(&s.mesh, "labels.msh", false, true, SIZE_MAX);
    write_gmsh(&s.mesh, "a.msh", true, false, SIZE_MAX);
    write_gmsh(&s.mesh, "b.msh", false, false, SIZE_MAX);
    write_vtk(&s.mesh);
    write_vtu(&s.mesh);
    write_csv(&s.mesh, SIZE_MAX, "");
    specimen_free(&s);
    return 0;
}

static int remove_files(void **state)
{
    (void)state;
    static const char *const names[] = {"labels.msh", "a.msh", "b.msh", "a.vtk", "a.vtu", "ct.csv", "hole.msh"};
    for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
        char path[200];
        snprintf(path, sizeof path, "%s/%s", folder, names[k]);
        unlink(path);
    }
    return rmdir(folder);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(intensities_give_the_bank_that_labels_give),
        cmocka_unit_test(directions_at_the_nodes_are_axes_without_a_sign),
        cmocka_unit_test(missing_values_are_named_with_their_place),
        cmocka_unit_test(two_ranges_that_overlap_are_refused),
    };
    return cmocka_run_group_tests(tests, write_files, remove_files);
}
