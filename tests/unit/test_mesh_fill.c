/* Surfaces filled by the mesher: the volume they enclose, their own triangles or remeshed, cavities, scripts; and what is
 * said when the mesher fails. */
#include <dirent.h>
#include <math.h>
#include <signal.h>
#include <sys/stat.h>

#include "mesh_encode.h"

static struct mesh box;
static struct surface skin;

static int start(void **state)
{
    (void)state;
    struct mesh_report r;
    struct failure why;
    const char *build = getenv("B");
    char mesher[512];
    box = box_mesh(2);
    assert_int_equal(mesh_check(&box, false, &r, &why), 0);
    assert_int_equal(mesh_surface(&box, &skin, &why), 0);
    /* tests stand one folder below tests/, and that beside the program */
    char self[400] = "";
    ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
    assert_true(n > 0);
    for (int up = 0; up < 3; up++)
        *strrchr(self, '/') = 0;
    snprintf(mesher, sizeof mesher, "%s/trocar-mesher", build && *build ? build : self);
    if (access(mesher, X_OK) != 0)
        print_message("# %s is not built: make it first\n", mesher);
    setenv("TROCAR_MESHER", mesher, 1);
    return 0;
}

static int end(void **state)
{
    (void)state;
    surface_free(&skin);
    mesh_free(&box);
    return 0;
}

static struct mesh_report filled(const char *name, struct bytes *b, double size)
{
    struct mesh mesh;
    struct mesh_report r;
    struct failure why;
    if (read_bytes(name, b->data, b->length, size, &mesh, &why) != 0 || mesh_check(&mesh, true, &r, &why) != 0)
        fail_msg("%s: %s: %s", name, why.place, why.cause);
    mesh_free(&mesh);
    free(b->data);
    *b = (struct bytes){0};
    return r;
}

static void every_surface_format_gives_the_box(void **state)
{
    (void)state;
    struct bytes b = {0};
    for (int form = 0; form < 8; form++) {
        static const char *const names[] = {"t.stl", "b.stl", "a.obj", "a.ply", "l.ply", "b.ply", "a.vtp", "r.vtp"};
        if (form < 2)
            encode_stl(&box, &skin, form, &b);
        else if (form == 2)
            encode_obj(&box, &skin, &b);
        else if (form < 6)
            encode_ply(&box, &skin, form - 3, &b);
        else
            encode_vtp(&box, &skin, form == 6 ? XML_ASCII : XML_APPENDED_RAW, form == 7, &b);
        struct mesh_report r = filled(names[form], &b, 0);
        assert_true(fabs(r.volume - 8) < 1e-12);
        assert_int_equal(r.surface_vertices, skin.vertex_count); /* its own triangles are kept */
        assert_int_equal(r.surface_triangles, skin.triangle_count);
    }
}

static void triangles_turned_at_random_are_turned_back(void **state)
{
    (void)state;
    struct bytes b = {0};
    for (size_t t = 0; t < skin.triangle_count; t += 3) {
        uint32_t *v = skin.triangles + 3 * t, swap = v[0];
        v[0] = v[1];
        v[1] = swap;
    }
    encode_obj(&box, &skin, &b);
    struct mesh_report r = filled("turned.obj", &b, 0);
    assert_true(fabs(r.volume - 8) < 1e-12);
}

static void quadrangles_and_a_size(void **state)
{
    (void)state;
    struct bytes b = {0};
    put_text(&b, "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n");
    put_text(&b, "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    struct mesh_report r = filled("cube.obj", &b, 0.25);
    assert_true(fabs(r.volume - 1) < 1e-12); /* sharp edges are kept */
    assert_true(r.edge_mean > 0.15 && r.edge_mean < 0.4);
    assert_true(r.nodes > 100);
}

static void a_shell_within_is_a_cavity_and_one_beside_a_body(void **state)
{
    (void)state;
    struct bytes b = {0};
    static const double place[3][2] = {
        {0, 3}, {1, 1}, {5, 2}}; /* corner, side: cavity of 1 in a cube of 3, cube of 2 beside */
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < 8; i++)
            put_text(&b, "v %g %g %g\n", place[c][0] + (i & 1) * place[c][1],
                     (c < 2 ? place[c][0] : 0) + (i >> 1 & 1) * place[c][1],
                     (c < 2 ? place[c][0] : 0) + (i >> 2) * place[c][1]);
    for (int c = 0; c < 3; c++)
        for (int f = 0; f < 6; f++) {
            static const int face[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                           {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
            put_text(&b, "f %d %d %d %d\n", 8 * c + face[f][0] + 1, 8 * c + face[f][1] + 1, 8 * c + face[f][2] + 1,
                     8 * c + face[f][3] + 1);
        }
    struct mesh_report r = filled("nested.obj", &b, 0);
    assert_int_equal(r.components, 2);
    assert_true(fabs(r.volume - (27 - 1 + 8)) < 1e-12);
}

static void a_geometry_script_with_named_volumes(void **state)
{
    (void)state;
    static const char script[] = "SetFactory(\"OpenCASCADE\"); Box(1) = {0,0,0, 1,1,1}; Box(2) = {1,0,0, 1,1,1};\n"
                                 "BooleanFragments{ Volume{1}; Delete; }{ Volume{2}; Delete; }\n"
                                 "Physical Volume(\"first\", 3) = {1}; Physical Volume(\"second\", 5) = {2};\n"
                                 "Mesh.CharacteristicLengthMax = 0.5;\n";
    struct mesh mesh;
    struct mesh_report r;
    struct failure why;
    if (read_text("a.geo", script, &mesh, &why) != 0 || mesh_check(&mesh, false, &r, &why) != 0)
        fail_msg("%s", why.cause);
    assert_true(fabs(r.volume - 2) < 1e-12);
    assert_int_equal(mesh.label_count, 2);
    assert_int_equal(mesh.label[0].number, 3);
    assert_string_equal(mesh.label[1].name, "second");
    mesh_free(&mesh);
    assert_int_equal(read_text("a.geo", "Point(1) = {0,0", &mesh, &why), STATUS_MESH_SURFACE);
    assert_non_null(strstr(why.cause, "syntax error"));
    assert_int_equal(read_text("a.geo", "Point(1) = {0,0,0};", &mesh, &why), STATUS_MESH_SURFACE);
    assert_non_null(strstr(why.cause, "no volume"));
}

/* A mesher that misbehaves, as a script. */
static int with_mesher(const char *script, struct failure *why)
{
    char path[512];
    struct bytes b = {0};
    struct mesh mesh;
    char *before = strdup(getenv("TROCAR_MESHER"));
    snprintf(path, sizeof path, "%s", temporary_path("mesher"));
    assert_int_equal(file_replace(path, script, strlen(script), why), 0);
    assert_int_equal(chmod(path, 0700), 0);
    setenv("TROCAR_MESHER", path, 1);
    encode_obj(&box, &skin, &b);
    int status = read_bytes("a.obj", b.data, b.length, 0, &mesh, why);
    assert_true(status != 0);
    setenv("TROCAR_MESHER", before, 1);
    unlink(path);
    free(before);
    free(b.data);
    return status;
}

static void a_mesher_that_fails_becomes_one_line(void **state)
{
    (void)state;
    struct failure why;
    assert_int_equal(with_mesher("#!/bin/sh\nkill -SEGV $$\n", &why), STATUS_MESH_SURFACE);
    assert_non_null(strstr(why.cause, "signal 11"));
    assert_int_equal(with_mesher("#!/bin/sh\necho noise >&2; echo 'trocar-mesher: it is Tuesday' >&2; exit 1\n", &why),
                     STATUS_MESH_SURFACE);
    assert_string_equal(why.cause, "it is Tuesday");
    assert_int_equal(with_mesher("#!/bin/sh\necho hello\n", &why), STATUS_MESH_SURFACE);
    assert_non_null(strstr(why.cause, "not understood"));
    assert_int_equal(with_mesher("#!/bin/sh\nexit 0\n", &why), STATUS_MESH_SURFACE);
    setenv("TROCAR_MESHER_SECONDS", "0.1", 1);
    assert_int_equal(with_mesher("#!/bin/sh\nexec tail -f /dev/null\n", &why), STATUS_MESH_SURFACE);
    unsetenv("TROCAR_MESHER_SECONDS");
    assert_non_null(strstr(why.cause, "longer than 0.1 s"));
    char *before = strdup(getenv("TROCAR_MESHER"));
    struct mesh mesh;
    setenv("TROCAR_MESHER", "/no/such/mesher", 1);
    assert_int_equal(read_text("a.geo", "Point(1) = {0,0,0};", &mesh, &why), STATUS_TOOL_MISSING);
    setenv("TROCAR_MESHER", before, 1);
    free(before);
}

static void the_data_surfaces(void **state)
{
    (void)state;
    struct mesh mesh;
    struct mesh_report r;
    struct failure why;
    const char *path = data_path("skull.vtp");
    if (!path)
        skip();
    assert_int_equal(mesh_read(path, 0, &mesh, &why), STATUS_MESH_OPEN);
    assert_non_null(strstr(why.cause, "3 edges"));
    path = data_path("liver-smooth.obj"); /* it crosses itself: only remeshing fills it */
    assert_int_equal(mesh_read(path, 0, &mesh, &why), STATUS_MESH_SURFACE);
    assert_non_null(strstr(why.remedy, "--size"));
    path = data_path("liver_closed.obj");
    assert_int_equal(mesh_read(path, 0.8, &mesh, &why), 0);
    assert_int_equal(mesh_check(&mesh, false, &r, &why), 0);
    /* chords of size h under a surface of radius about 2.5 lose about 3 h^2 / (8 R^2) of the volume: 4 %, and creases more */
    assert_true(r.volume > 0.92 * 27.68 && r.volume < 27.68);
    mesh_free(&mesh);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_surface_format_gives_the_box),
        cmocka_unit_test(triangles_turned_at_random_are_turned_back),
        cmocka_unit_test(quadrangles_and_a_size),
        cmocka_unit_test(a_shell_within_is_a_cavity_and_one_beside_a_body),
        cmocka_unit_test(a_geometry_script_with_named_volumes),
        cmocka_unit_test(a_mesher_that_fails_becomes_one_line),
        cmocka_unit_test(the_data_surfaces),
    };
    return cmocka_run_group_tests(tests, start, end);
}
