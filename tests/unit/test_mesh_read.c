/* Every volume format: what an encoder wrote from a mesh comes back as that mesh. */
#include "mesh_encode.h"

static void assert_same(const struct mesh *a, const struct mesh *b, bool names)
{
    assert_int_equal(a->node_count, b->node_count);
    assert_int_equal(a->tetrahedron_count, b->tetrahedron_count);
    assert_memory_equal(a->nodes, b->nodes, 3 * a->node_count * sizeof *a->nodes);
    assert_int_equal(b->label_count, 2);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(b->label[i].number, i + 1);
        assert_string_equal(b->label[i].name, names ? a->label[i].name : "");
    }
    assert_string_equal(b->warning, "");
}

/* Reads `b`, compares, frees. `sorted`: the format lists elements label by label. */
static void comes_back(const struct mesh *mesh, const char *name, struct bytes *b, bool names, bool sorted)
{
    struct mesh back;
    struct failure why;
    int status = read_bytes(name, b->data, b->length, 0, &back, &why);
    if (status)
        fail_msg("%s: %s: %s", name, why.place, why.cause);
    assert_same(mesh, &back, names);
    if (!sorted) {
        assert_memory_equal(mesh->tetrahedra, back.tetrahedra, 4 * mesh->tetrahedron_count * sizeof *mesh->tetrahedra);
        assert_memory_equal(mesh->labels, back.labels, mesh->tetrahedron_count * sizeof *mesh->labels);
    }
    assert_int_equal(back.file_hash, crc32(0, b->data, (uInt)b->length)); /* zlib's is the same checksum */
    mesh_free(&back);
    free(b->data);
    *b = (struct bytes){0};
}

static void gmsh_1_2_and_4_in_text(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2);
    struct bytes b = {0};
    mesh.nodes[5] = 1.0 / 3;
    encode_gmsh1(&mesh, &b);
    comes_back(&mesh, "1.msh", &b, false, false);
    encode_gmsh2(&mesh, false, false, &b);
    comes_back(&mesh, "2.msh", &b, true, false);
    encode_gmsh4(&mesh, false, false, &b);
    comes_back(&mesh, "4.msh", &b, true, true);
    mesh_free(&mesh);
}

static void gmsh_2_and_4_in_binary_of_either_order(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2);
    struct bytes b = {0};
    for (int reversed = 0; reversed < 2; reversed++) {
        encode_gmsh2(&mesh, true, reversed, &b);
        comes_back(&mesh, "2b.msh", &b, true, false);
        encode_gmsh4(&mesh, true, reversed, &b);
        comes_back(&mesh, "4b.msh", &b, true, true);
    }
    mesh_free(&mesh);
}

static void legacy_vtk_in_text_and_binary_of_versions_2_and_5(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2);
    struct bytes b = {0};
    for (int form = 0; form < 4; form++) {
        encode_vtk(&mesh, form & 1, form & 2 ? 5 : 2, &b);
        comes_back(&mesh, "a.vtk", &b, false, false);
    }
    mesh_free(&mesh);
}

static void vtu_in_each_of_its_encodings(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(3);
    struct bytes b = {0};
    for (int form = 0; form < 32; form++) {
        if ((form & 3) == XML_ASCII && form >= 4)
            continue;
        encode_vtu(&mesh, (enum xml_form)(form & 3), form & 4, form & 8, form & 16, &b);
        comes_back(&mesh, "a.vtu", &b, false, false);
    }
    mesh_free(&mesh);
}

static void tetgen_from_0_or_1_by_either_file(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2), back;
    struct failure why;
    for (unsigned base = 0; base < 2; base++) {
        struct bytes node = {0}, ele = {0};
        char node_path[512], ele_path[512];
        encode_tetgen(&mesh, base, &node, &ele);
        snprintf(node_path, sizeof node_path, "%s", temporary_path("t.node"));
        snprintf(ele_path, sizeof ele_path, "%s", temporary_path("t.ele"));
        assert_int_equal(file_replace(node_path, node.data, node.length, &why), 0);
        assert_int_equal(mesh_read(node_path, 0, &back, &why), STATUS_FILE_OPEN);
        assert_non_null(strstr(why.place, "t.ele"));
        assert_int_equal(file_replace(ele_path, ele.data, ele.length, &why), 0);
        uint32_t hash = (uint32_t)crc32(crc32(0, node.data, (uInt)node.length), ele.data, (uInt)ele.length);
        for (int given = 0; given < 2; given++) {
            assert_int_equal(mesh_read(given ? ele_path : node_path, 0, &back, &why), 0);
            assert_same(&mesh, &back, false);
            assert_memory_equal(mesh.tetrahedra, back.tetrahedra, 4 * mesh.tetrahedron_count * sizeof *mesh.tetrahedra);
            assert_memory_equal(mesh.labels, back.labels, mesh.tetrahedron_count * sizeof *mesh.labels);
            assert_int_equal(back.file_hash, hash);
            mesh_free(&back);
        }
        unlink(node_path);
        unlink(ele_path);
        free(node.data);
        free(ele.data);
    }
    mesh_free(&mesh);
}

static void vega_with_sets_and_regions(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2);
    struct bytes b = {0};
    for (unsigned base = 0; base < 2; base++) {
        encode_vega(&mesh, base, &b);
        comes_back(&mesh, "a.veg", &b, true, false);
    }
    mesh_free(&mesh);
}

static void vega_includes_other_files(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2), back;
    struct bytes b = {0}, inner = {0}, outer = {0};
    struct failure why;
    encode_vega(&mesh, 1, &b);
    char *split = strstr((char *)b.data, "2 1 0 0"), path[512]; /* behind the first vertex */
    assert_non_null(split);
    put(&inner, split, b.length - (size_t)(split - (char *)b.data));
    snprintf(path, sizeof path, "%s", temporary_path("inner.txt"));
    assert_int_equal(file_replace(path, inner.data, inner.length, &why), 0);
    put(&outer, b.data, (size_t)(split - (char *)b.data));
    put_text(&outer, "*INCLUDE %s\n", strrchr(path, '/') + 1);
    assert_int_equal(read_bytes("outer.veg", outer.data, outer.length, 0, &back, &why), 0);
    assert_same(&mesh, &back, true);
    mesh_free(&back);
    /* a file that includes itself ends with a line, not with the stack */
    assert_int_equal(file_replace(path, "*INCLUDE ", 9, &why), 0);
    inner.length = 0;
    put_text(&inner, "*INCLUDE %s\n", strrchr(path, '/') + 1);
    assert_int_equal(file_replace(path, inner.data, inner.length, &why), 0);
    assert_int_equal(read_bytes("outer.veg", outer.data, outer.length, 0, &back, &why), STATUS_MESH_SYNTAX);
    assert_non_null(strstr(why.cause, "include each other"));
    unlink(path);
    free(b.data);
    free(inner.data);
    free(outer.data);
    mesh_free(&mesh);
}

static void quadratic_tetrahedra_keep_their_corners(void **state)
{
    (void)state;
    struct mesh mesh;
    struct failure why;
    struct mesh_report r;
    struct bytes b = {0};
    put_text(&b, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n");
    put_text(&b, "5 .5 0 0\n6 .5 .5 0\n7 0 .5 0\n8 0 0 .5\n9 0 .5 .5\n10 .5 0 .5\n$EndNodes\n$Elements\n1\n");
    put_text(&b, "1 11 2 7 1 1 2 3 4 5 6 7 8 9 10\n$EndElements\n");
    assert_int_equal(read_bytes("q.msh", b.data, b.length, 0, &mesh, &why), 0);
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    assert_int_equal(r.unused_nodes, 6);
    assert_int_equal(mesh.node_count, 4);
    assert_int_equal(mesh.label[0].number, 7);
    mesh_free(&mesh);
    free(b.data);
}

static void what_is_written_is_read_again(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2), back;
    struct failure why;
    char path[512];
    mesh.nodes[4] = 0.1; /* not a sum of powers of two: 17 digits are needed */
    snprintf(path, sizeof path, "%s", temporary_path("w.msh"));
    assert_int_equal(mesh_write_msh(&mesh, path, &why), 0);
    assert_int_equal(mesh_read(path, 0, &back, &why), 0);
    unlink(path);
    assert_same(&mesh, &back, true);
    assert_memory_equal(mesh.tetrahedra, back.tetrahedra, 4 * mesh.tetrahedron_count * sizeof *mesh.tetrahedra);
    mesh_free(&back);
    assert_int_equal(mesh_write_msh(&mesh, "/no/such/folder/w.msh", &why), STATUS_FILE_WRITE);
    mesh_free(&mesh);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gmsh_1_2_and_4_in_text),
        cmocka_unit_test(gmsh_2_and_4_in_binary_of_either_order),
        cmocka_unit_test(legacy_vtk_in_text_and_binary_of_versions_2_and_5),
        cmocka_unit_test(vtu_in_each_of_its_encodings),
        cmocka_unit_test(tetgen_from_0_or_1_by_either_file),
        cmocka_unit_test(vega_with_sets_and_regions),
        cmocka_unit_test(vega_includes_other_files),
        cmocka_unit_test(quadratic_tetrahedra_keep_their_corners),
        cmocka_unit_test(what_is_written_is_read_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
