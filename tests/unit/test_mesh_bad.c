/* Bad files: one clear line with the status of its class, naming the line or the byte. */
#include <math.h>

#include "mesh_encode.h"
#include "mesh_readers.h"

static void refuse(const char *name, const char *text, int status, const char *place, const char *cause)
{
    struct mesh mesh;
    struct failure why;
    int got = read_text(name, text, &mesh, &why);
    if (got == 0)
        mesh_free(&mesh);
    if (got != status || !strstr(why.place, place) || !strstr(why.cause, cause))
        fail_msg("%s gives %s: %s: %s", name, status_name(got), why.place, why.cause);
    assert_null(mesh.nodes);
    assert_null(strchr(why.cause, '\n'));
    assert_true(*why.remedy != 0);
}

#define HEAD  "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
#define NODES "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"

static void gmsh_text(void **state)
{
    (void)state;
    refuse("a.msh", HEAD "$Nodes\n2\n1 0 0 0\n2 1 nan 0\n", STATUS_MESH_NONFINITE, "a.msh:7", "coordinate is nan");
    refuse("a.msh", HEAD "$Nodes\n2\n1 0 0 -inf\n2 1 0 0\n", STATUS_MESH_NONFINITE, "a.msh:6", "-inf");
    refuse("a.msh", HEAD "$Nodes\n1\n1 0 0 1e999\n", STATUS_MESH_NONFINITE, ":6", "1e999");
    refuse("a.msh", HEAD "$Nodes\n4294967290\n1 0 0 0\n", STATUS_MESH_SYNTAX, ":5", "4294967290 nodes");
    refuse("a.msh", HEAD "$Nodes\n-4\n1 0 0 0\n", STATUS_MESH_SYNTAX, ":5", "-4");
    refuse("a.msh", HEAD "$Nodes\n2\n1 0 0 0\n1 0 0 1\n$EndNodes\n", STATUS_MESH_SYNTAX, ":7", "number 1");
    refuse("a.msh", HEAD NODES "$Elements\n1\n1 4 2 0 1 1 2 3 9\n$EndElements\n", STATUS_MESH_INDEX, ":13", "node 9");
    refuse("a.msh", HEAD NODES "$Elements\n1\n1 5 2 0 1 1 2 3 4 1 2 3 4\n$EndElements\n", STATUS_MESH_FORMAT, ":13",
           "hexahedron");
    refuse("a.msh", HEAD NODES "$Elements\n1\n1 77 2 0 1 1 2 3 4\n$EndElements\n", STATUS_MESH_FORMAT, ":13",
           "type 77");
    refuse("a.msh", HEAD NODES "$Elements\n1\n1 2 2 0 1 1 2 3\n$EndElements\n", STATUS_MESH_EMPTY, "a.msh",
           "no tetrahedron");
    refuse("a.msh", HEAD NODES "$Elements\n1\n1 4 2 0 1 1 2 3 x\n", STATUS_MESH_SYNTAX, ":13", "\"x\"");
    refuse("a.msh", HEAD NODES "$Elements\n1\n1 4 2 0 1 1 2 3 4\n", STATUS_MESH_SYNTAX, ":14", "$EndElements");
    refuse("a.msh", HEAD NODES NODES, STATUS_MESH_SYNTAX, ":11", "second");
    refuse("a.msh", HEAD "$Elements\n0\n$EndElements\n", STATUS_MESH_SYNTAX, ":4", "before the nodes");
    refuse("a.msh", HEAD NODES, STATUS_MESH_SYNTAX, "a.msh", "before its elements");
    refuse("a.msh", HEAD "$PhysicalNames\n1\n3 1 liver\n", STATUS_MESH_SYNTAX, ":6", "quotes");
    refuse("a.msh", HEAD "$Periodic\n1\n", STATUS_MESH_SYNTAX, "a.msh", "no end");
    refuse("a.msh", "$MeshFormat\n4 0 8\n$EndMeshFormat\n", STATUS_MESH_FORMAT, ":2", "version 4");
    refuse("a.msh", "$MeshFormat\n2.2 0 4\n$EndMeshFormat\n", STATUS_MESH_FORMAT, ":2", "4 bytes");
    refuse("a.msh", "$NOD\n1\n1 0 0 0\n$ENDNOD\n$ELM\n1\n1 4 1 1 5 1 1 1 1 1\n$ENDELM\n", STATUS_MESH_SYNTAX, ":7",
           "5 nodes");
}

static void vtk_and_vtu(void **state)
{
    (void)state;
    static const char head[] = "# vtk DataFile Version 2.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n";
    static const char points[] = "POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n";
    char text[1000];
    refuse("a.vtk", "# vtk DataFile Version 2.0\nt\nASCII\nDATASET STRUCTURED_POINTS\n", STATUS_MESH_FORMAT, ":4",
           "STRUCTURED_POINTS");
    snprintf(text, sizeof text, "%s%sCELLS 1 5\n4 0 1 2 4\nCELL_TYPES 1\n10\n", head, points);
    refuse("a.vtk", text, STATUS_MESH_INDEX, "a.vtk", "node 4 of 4");
    snprintf(text, sizeof text, "%s%sCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n12\n", head, points);
    refuse("a.vtk", text, STATUS_MESH_FORMAT, "a.vtk", "hexahedron");
    snprintf(text, sizeof text, "%s%sCELLS 1 5\n9 0 1 2 3\nCELL_TYPES 1\n10\n", head, points);
    refuse("a.vtk", text, STATUS_MESH_SYNTAX, "a.vtk", "does not fit");
    snprintf(text, sizeof text, "%sPOINTS 9999999 float\n0 0 0\n", head);
    refuse("a.vtk", text, STATUS_MESH_SYNTAX, ":5", "9999999");
    snprintf(text, sizeof text, "%sPOINTS 1 float\n0 0 inf\n", head);
    refuse("a.vtk", text, STATUS_MESH_NONFINITE, ":6", "inf");
    refuse("a.vtu", "<svg><VTKFile/></svg>", STATUS_MESH_FORMAT, ":1", "svg");
    refuse("a.vtu", "<!DOCTYPE x [<!ENTITY a \"b\">]><VTKFile/>", STATUS_MESH_SYNTAX, ":1", "document type");
    refuse("a.vtu", "<VTKFile type=\"ImageData\"></VTKFile>", STATUS_MESH_FORMAT, ":1", "ImageData");
    refuse("a.vtu", "<VTKFile type=\"UnstructuredGrid\">\n<Piece", STATUS_MESH_SYNTAX, ":2", "XML is damaged");
    static const char piece[] =
        "<VTKFile type=\"UnstructuredGrid\"%s>\n<Piece NumberOfPoints=\"%s\" NumberOfCells=\"1\">\n<Points>"
        "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"%s\">%s</DataArray></Points>"
        "</Piece></VTKFile>";
    snprintf(text, sizeof text, piece, "", "99999999999999", "ascii", "0 0 0");
    refuse("a.vtu", text, STATUS_MESH_SYNTAX, ":2", "99999999999999");
    snprintf(text, sizeof text, piece, "", "2", "ascii", "0 0 0");
    refuse("a.vtu", text, STATUS_MESH_SYNTAX, ":3", "3 numbers instead of 6");
    snprintf(text, sizeof text, piece, "", "1", "ascii", "0 nan 0");
    refuse("a.vtu", text, STATUS_MESH_NONFINITE, ":3", "nan");
    snprintf(text, sizeof text, piece, "", "1", "binary", "////fwAA");
    refuse("a.vtu", text, STATUS_MESH_SYNTAX, "byte", "does not fit");
    snprintf(text, sizeof text, piece, "", "1", "binary", "D?AA");
    refuse("a.vtu", text, STATUS_MESH_SYNTAX, "byte", "not base64");
    snprintf(text, sizeof text, piece, " compressor=\"vtkLZ4DataCompressor\"", "1", "binary", "AAAA");
    refuse("a.vtu", text, STATUS_MESH_FORMAT, "a.vtu", "LZ4");
    snprintf(text, sizeof text, piece, " compressor=\"vtkZLibDataCompressor\"", "1", "binary",
             "AQAAAAAAAP8AAAD/AQAAAA==");
    refuse("a.vtu", text, STATUS_MESH_SYNTAX, "byte", "does not fit"); /* one block of 4 GiB */
    snprintf(text, sizeof text, piece, " compressor=\"vtkZLibDataCompressor\"", "1", "binary",
             "AQAAAAwAAAAAAAAABAAAAGFiY2RlZmdo");
    refuse("a.vtu", text, STATUS_MESH_SYNTAX, "byte", "damaged");
}

static void vega(void **state)
{
    (void)state;
    static const char nodes[] = "*VERTICES\n4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n";
    char text[500];
    refuse("a.veg", "*VERTICES\n2 3 0 0\n1 0 0 0\n", STATUS_MESH_SYNTAX, "a.veg", "1 of 2 vertices");
    refuse("a.veg", "*VERTICES\n1 3 0 0\n1 0 0 0\n2 0 0 0\n", STATUS_MESH_SYNTAX, ":4", "more than the 1");
    snprintf(text, sizeof text, "%s*ELEMENTS\nCUBIC\n1 8 0\n", nodes);
    refuse("a.veg", text, STATUS_MESH_FORMAT, ":8", "CUBIC");
    snprintf(text, sizeof text, "%s*ELEMENTS\nTET\n1 4 0\n1 1 2 3 5\n", nodes);
    refuse("a.veg", text, STATUS_MESH_INDEX, ":10", "vertex 5");
    snprintf(text, sizeof text, "%s*ELEMENTS\nTET\n1 4 0\n1 1 2 3 4\n*REGION\nnowhere, soft\n", nodes);
    refuse("a.veg", text, STATUS_MESH_SYNTAX, ":12", "soft");
    snprintf(text, sizeof text, "%s*ELEMENTS\nTET\n1 4 0\n1 1 2 3 4\n*MATERIAL soft\n*SET s\n7\n*REGION\ns, soft\n",
             nodes);
    refuse("a.veg", text, STATUS_MESH_INDEX, ":15", "element 7");
    snprintf(text, sizeof text, "%s*WHAT\n", nodes);
    refuse("a.veg", text, STATUS_MESH_SYNTAX, ":7", "*WHAT");
    snprintf(text, sizeof text, "%s*ELEMENTS\n*INCLUDE none.txt\n", nodes);
    refuse("a.veg", text, STATUS_FILE_OPEN, "none.txt", "No such file");
    snprintf(text, sizeof text, "%s*ELEMENTS\n*INCLUDE /dev/zero\n", nodes);
    refuse("a.veg", text, STATUS_MESH_SYNTAX, ":8", "not a file");
}

static void surfaces(void **state)
{
    (void)state;
    refuse("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", STATUS_MESH_OPEN, "a.obj", "3 edges");
    refuse("a.obj", "v 0 0 0\nf 1 2 3\n", STATUS_MESH_INDEX, ":2", "vertex 2");
    refuse("a.obj", "v 0 0 0\nf 1 -2 1\n", STATUS_MESH_INDEX, ":2", "vertex -2");
    refuse("a.obj", "v 0 0 0\nf 1 1\n", STATUS_MESH_SYNTAX, ":2", "2 corners");
    refuse("a.obj", "v 0 0 nan\n", STATUS_MESH_NONFINITE, ":1", "nan");
    refuse("a.obj", "v 0 0\n", STATUS_MESH_SYNTAX, "a.obj", "ends where");
    refuse("a.obj", "hello world\n", STATUS_MESH_SYNTAX, ":1", "hello");
    refuse("a.obj", "v 0 0 0\n", STATUS_MESH_EMPTY, "a.obj", "no triangle");
    refuse("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 1\n", STATUS_MESH_SYNTAX, ":6",
           "ends");
    refuse("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 inf\n", STATUS_MESH_NONFINITE, ":4", "inf");
    refuse("a.stl", "garbage", STATUS_MESH_SYNTAX, "byte 0", "head");
    refuse("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n", STATUS_MESH_SYNTAX,
           ":", "without x, y and z");
    refuse("a.ply", "ply\nformat ascii 1.0\nelement vertex 99999999\n", STATUS_MESH_SYNTAX, ":3", "99999999");
    refuse("a.ply", "ply\nformat pdf 1.0\nend_header\n", STATUS_MESH_SYNTAX, ":3", "pdf");
    refuse("a.ply",
           "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement "
           "face 1\n"
           "property list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 1\n",
           STATUS_MESH_INDEX, ":11", "vertex 1 of 1");
    /* three triangles at one edge; and the projective plane on six vertices, closed but without an inside */
    refuse(
        "a.obj",
        "v 0 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 0 0\nv 0 -1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\nf 1 2 6\nf 1 3 4\nf 2 3 4\n"
        "f 1 5 6\nf 2 5 6\n",
        STATUS_MESH_NONMANIFOLD, "a.obj", "1 edge of the surface has more");
    refuse(
        "a.obj",
        "v 0 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 0 0\nv 0 -1 0\nf 1 2 3\nf 1 3 4\nf 1 4 5\nf 1 5 6\nf 1 6 2\nf 2 3 5\n"
        "f 3 4 6\nf 4 5 2\nf 5 6 3\nf 6 2 4\n",
        STATUS_MESH_NONMANIFOLD, "a.obj", "one side only");
}

static void binary_numbers_are_named_by_their_byte(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2), back;
    struct failure why;
    struct bytes b = {0};
    mesh.nodes[7] = NAN;
    encode_gmsh2(&mesh, true, false, &b);
    assert_int_equal(read_bytes("a.msh", b.data, b.length, 0, &back, &why), STATUS_MESH_NONFINITE);
    const unsigned char *found = memmem(b.data, b.length, &mesh.nodes[7], sizeof(double));
    char place[40];
    snprintf(place, sizeof place, "byte %zu", (size_t)(found - b.data));
    assert_non_null(strstr(why.place, place));
    b.length = 0;
    mesh.nodes[7] = 0;
    mesh.tetrahedra[5] = 1000;
    encode_gmsh4(&mesh, true, true, &b);
    assert_int_equal(read_bytes("a.msh", b.data, b.length, 0, &back, &why), STATUS_MESH_INDEX);
    assert_non_null(strstr(why.cause, "node 1001"));
    free(b.data);
    mesh_free(&mesh);
}

static void foreign_files(void **state)
{
    (void)state;
    static const struct {
        const char *bytes, *what;
    } files[] = {{"\x89PNG\r\n\x1a\n....", "PNG"},
                 {"%PDF-1.4\n", "PDF"},
                 {"\x7f"
                  "ELF\2\1\1",
                  "ELF"},
                 {"PK\3\4....", "ZIP"},
                 {"\x1f\x8b\x08..", "gzip"},
                 {"GIF89a", "GIF"}};
    static const char *const names[] = {"a.msh", "a.vtk",  "a.vtu", "a.stl", "a.obj",
                                        "a.ply", "a.node", "a.veg", "a.geo", "a"};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++)
        for (size_t k = 0; k < sizeof names / sizeof names[0]; k++)
            refuse(names[k], files[i].bytes, STATUS_MESH_FORMAT, names[k], files[i].what);
    refuse("a.msh", "", STATUS_MESH_FORMAT, "a.msh", "empty");
    refuse("a.xyz", "1 2 3\n", STATUS_MESH_FORMAT, "a.xyz", "neither");
    struct mesh mesh;
    struct failure why;
    assert_int_equal(mesh_read("/no/such/mesh.msh", 0, &mesh, &why), STATUS_FILE_OPEN);
    assert_int_equal(mesh_read("/tmp", 0, &mesh, &why), STATUS_FILE_OPEN);
}

/* Polygons: a comb of 10 corners, whose area as triangles must be that of the comb, and none turned over. */
static void concave_polygons_are_cut_without_overlap(void **state)
{
    (void)state;
    static const double comb[10][2] = {{0, 0}, {5, 0}, {5, 3}, {4, 3}, {4, 1}, {3, 1}, {3, 3}, {1, 3}, {1, 1}, {0, 3}};
    struct soup soup = {0};
    struct failure why;
    struct scan s = scan_start("comb", (const unsigned char *)"", 0, &why);
    uint32_t corner[10];
    double area = 0, all = 0;
    for (uint32_t i = 0; i < 10; i++) {
        double x[3] = {2, comb[i][0], comb[i][1]};
        corner[i] = i;
        all += (comb[i][0] * comb[(i + 1) % 10][1] - comb[(i + 1) % 10][0] * comb[i][1]) / 2;
        assert_int_equal(soup_vertex(&soup, &s, x), 0);
    }
    assert_int_equal(soup_polygon(&soup, &s, corner, 10), 0);
    assert_int_equal(soup.triangle_count, 8);
    for (size_t t = 0; t < 8; t++) {
        const double *a = comb[soup.triangles[3 * t]], *b = comb[soup.triangles[3 * t + 1]],
                     *c = comb[soup.triangles[3 * t + 2]];
        double twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert_true(twice > 0);
        area += twice / 2;
    }
    assert_true(fabs(area - all) < 1e-14);
    soup_free(&soup);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gmsh_text),
        cmocka_unit_test(vtk_and_vtu),
        cmocka_unit_test(vega),
        cmocka_unit_test(surfaces),
        cmocka_unit_test(binary_numbers_are_named_by_their_byte),
        cmocka_unit_test(foreign_files),
        cmocka_unit_test(concave_polygons_are_cut_without_overlap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
