/* What is packed is what is read: every section against the surface, compliance and records that went in, the rounding to
 * float32 against its bound, provenance letter by letter. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "bank.h"
#include "bank_fixture.h"
#include "crc.h"
#include "mesh_fixture.h"
#include "pack.h"
#include "random.h"

struct body_in {
    struct mesh mesh;
    struct surface surface;
    struct compliance compliance;
    bool *fixed;
};

/* A box whose surface is real and whose compliance is noise of all magnitudes with a dominant diagonal: packing does not
 * care about its origin, and a wrong index cannot hide. The number of rows is not a multiple of the band. */
static struct body_in body_in(int n)
{
    struct body_in b = {.mesh = box_mesh(n)};
    struct failure why;
    struct mesh_report report;
    assert_int_equal(mesh_check(&b.mesh, false, &report, &why), STATUS_OK);
    assert_int_equal(mesh_scale(&b.mesh, 0.1, MESH_UNIT_NONE, &why), STATUS_OK);
    assert_int_equal(mesh_surface(&b.mesh, &b.surface, &why), STATUS_OK);
    b.fixed = calloc(b.surface.vertex_count, sizeof *b.fixed);
    b.compliance.row_of = malloc(b.surface.vertex_count * sizeof *b.compliance.row_of);
    for (size_t v = 0; v < b.surface.vertex_count; v++) {
        b.fixed[v] = v % 7 == 3;
        b.compliance.row_of[v] = b.fixed[v] ? UINT32_MAX : (uint32_t)b.compliance.rows++;
    }
    size_t m = 3 * b.compliance.rows;
    b.compliance.G = malloc(m * m * sizeof *b.compliance.G);
    for (size_t c = 0; c < m; c++)
        for (size_t r = 0; r < m; r++) /* the upper half is not filled: nothing may read it */
            b.compliance.G[m * c + r] = r < c    ? NAN
                                        : r == c ? random_range(0.1, 0.2)
                                                 : random_range(-0.03, 0.03) * pow(10, -random_range(0, 12));
    b.compliance.median_diagonal_m_N = 0.15;
    return b;
}

static void body_out(struct body_in *b)
{
    mesh_free(&b->mesh);
    surface_free(&b->surface);
    free(b->compliance.G);
    free(b->compliance.row_of);
    free(b->fixed);
}

static const char *pack_to_file(struct body_in *b, const char *provenance)
{
    const char *path = temporary_path("pack.bank");
    unlink(path);
    struct failure why;
    struct file_writer writer;
    struct pack pack;
    size_t length;
    unsigned char *bytes = bank_fixture(NULL, &length); /* its contact and tool records */
    assert_int_equal(pack_prepare(&pack, &b->mesh, &b->surface, b->fixed, 1, &why), STATUS_OK);
    memcpy(&pack.contact, bytes + bank_fixture_section(bytes, BANK_CONT)->offset, sizeof pack.contact);
    memcpy(&pack.tool[0], bytes + bank_fixture_section(bytes, BANK_TOOL)->offset, sizeof pack.tool[0]);
    assert_int_equal(file_begin(&writer, path, &why), STATUS_OK);
    assert_int_equal(pack_write(&pack, &b->compliance, NULL, &writer, true, &why), STATUS_OK);
    assert_int_equal(writer.length, pack.bytes);
    if (provenance)
        assert_int_equal(pack_provenance(&pack, provenance, strlen(provenance), &writer, &why), STATUS_OK);
    assert_int_equal(access(path, F_OK), -1);
    assert_int_equal(file_commit(&writer, &why), STATUS_OK);
    pack_free(&pack);
    free(bytes);
    return path;
}

static void every_section_is_what_went_in(void **state)
{
    (void)state;
    random_seed("pack", 1);
    struct body_in b = body_in(4);
    struct bank_file bank;
    struct failure why;
    assert_true(b.compliance.rows % PACK_BAND != 0 && b.compliance.rows > PACK_BAND);
    const char *path = pack_to_file(&b, NULL);
    assert_int_equal(bank_load(path, &bank, &why), STATUS_OK);
    unlink(path);
    const struct bank_view *v = &bank.view;
    assert_int_equal(v->vertex_count, b.surface.vertex_count);
    assert_int_equal(v->triangle_count, b.surface.triangle_count);
    assert_int_equal(v->row_count, b.compliance.rows);
    assert_int_equal(v->tool_count, 1);
    assert_int_equal(v->header->mesh_hash, b.mesh.file_hash);
    for (size_t k = 0; k < 3 * b.surface.vertex_count; k++) {
        assert_true(v->positions[k] == (float)b.mesh.nodes[3 * b.surface.node[k / 3] + k % 3]);
        assert_true(v->normals[k] == (float)b.surface.normals[k]);
    }
    for (size_t k = 0; k < 3 * b.surface.triangle_count; k++) {
        assert_int_equal(v->triangles[k / 3].vertex[k % 3], b.surface.triangles[k]);
        assert_int_equal(v->triangles[k / 3].neighbour[k % 3], b.surface.neighbours[k]);
    }
    for (size_t k = 0; k < b.surface.vertex_count; k++)
        assert_int_equal(v->row_of[k], b.fixed[k] ? BANK_NONE : b.compliance.row_of[k]);
    assert_int_equal(grid_missing(v), UINT32_MAX);
    bank_unload(&bank);
    body_out(&b);
}

/* To nearest: |stored - g| <= 2^-24 |g|, or half the smallest float32. */
static void compliance_is_rounded_once_to_nearest(void **state)
{
    (void)state;
    random_seed("rounding", 2);
    struct body_in b = body_in(4);
    struct bank_file bank;
    struct failure why;
    const char *path = pack_to_file(&b, NULL);
    assert_int_equal(bank_load(path, &bank, &why), STATUS_OK);
    unlink(path);
    size_t m = 3 * b.compliance.rows;
    double worst = 0;
    for (uint32_t i = 0; i < b.compliance.rows; i++)
        for (uint32_t j = 0; j < b.compliance.rows; j++) {
            float block[9];
            bank_view_compliance(&bank.view, i, j, block);
            for (int e = 0; e < 9; e++) {
                size_t r = 3 * i + e / 3, c = 3 * j + e % 3;
                double g = r >= c ? b.compliance.G[m * c + r] : b.compliance.G[m * r + c];
                double off = fabs((double)block[e] - g);
                assert_true(off <= 0x1p-24 * fabs(g) || off <= 0x1p-150);
                worst = fmax(worst, off / fabs(g));
            }
        }
    assert_true(worst > 0x1p-25); /* the bound is met nearly */
    bank_unload(&bank);
    body_out(&b);
}

static void provenance_survives_letter_by_letter(void **state)
{
    (void)state;
    random_seed("provenance", 3);
    static const char *const scenes[] = {
        "scene: plain\nbody: {}\n",
        "no newline at the end",
        "\n\nleading and trailing lines\n\n\n",
        "  indented first line\n\ttab, trailing space \n# comment: \"quotes\" 'and' \\ backslash\n",
        "",
        "---\n...\n--- |\n%YAML 1.1\n",
        "umlauts \xc3\xa4\xc3\xb6 and \xf0\x9f\xab\x80\n"};
    for (size_t k = 0; k < sizeof scenes / sizeof scenes[0]; k++) {
        struct provenance out = {.scene = strdup(scenes[k]),
                                 .program = "trocar",
                                 .mesh_path = "a folder/it's \"liver\" \\ #1: \xc3\xa4.msh",
                                 .mesh_from_bank = "../x.msh",
                                 .discretisation = "P1",
                                 .nodes = 1665,
                                 .tetrahedra = 6691,
                                 .build_seconds = 1.25,
                                 .force_error_p95 = 4.6e-7,
                                 .force_error_max = 4.8e-7};
        struct provenance in;
        struct failure why;
        char *text;
        size_t length;
        assert_int_equal(provenance_print(&out, &text, &length, &why), STATUS_OK);
        assert_int_equal(provenance_parse(text, length, "test", &in, &why), STATUS_OK);
        assert_string_equal(in.scene, scenes[k]);
        assert_string_equal(in.mesh_path, out.mesh_path);
        assert_string_equal(in.mesh_from_bank, out.mesh_from_bank);
        assert_int_equal(in.nodes, 1665);
        assert_int_equal(in.tetrahedra, 6691);
        assert_true(in.build_seconds == 1.25 && in.force_error_max == 4.8e-7);
        for (int round = 0; round < 300; round++) { /* damaged: refused or read, never a crash */
            char *copy = malloc(length);
            memcpy(copy, text, length);
            struct provenance other;
            copy[random_below((unsigned)length)] = (char)random_bits();
            if (provenance_parse(copy, random_below((unsigned)length + 1), "test", &other, &why) == STATUS_OK)
                provenance_free(&other);
            free(copy);
        }
        free(text);
        provenance_free(&in);
        provenance_free(&out);
    }
}

static void unknown_and_nested_keys_are_skipped(void **state)
{
    (void)state;
    static const char text[] = "future: {a: [1, {scene: no}], mesh_path: no}\n? [complex, key]\n: value\nalias: &x 1\n"
                               "again: *x\nmesh_path: yes.msh\n";
    struct provenance p;
    struct failure why;
    assert_int_equal(provenance_parse(text, strlen(text), "test", &p, &why), STATUS_OK);
    assert_string_equal(p.mesh_path, "yes.msh");
    assert_null(p.scene);
    provenance_free(&p);
    assert_int_equal(provenance_parse("- a list", 8, "test", &p, &why), STATUS_BANK_SECTION);
    assert_int_equal(provenance_parse("a: [", 4, "test", &p, &why), STATUS_BANK_SECTION);
    assert_int_equal(provenance_parse("", 0, "test", &p, &why), STATUS_BANK_SECTION);
}

static void bodies_beyond_the_format_are_refused(void **state)
{
    (void)state;
    struct mesh mesh = {0};
    struct surface surface = {.vertex_count = BANK_MAX_VERTICES + 1, .triangle_count = 4};
    bool *fixed = calloc(surface.vertex_count, sizeof *fixed);
    struct pack pack;
    struct failure why;
    assert_int_equal(pack_prepare(&pack, &mesh, &surface, fixed, 1, &why), STATUS_MESH_TOO_LARGE);
    surface.vertex_count = BANK_MAX_VERTICES; /* fits by number, but the compliance would have 77 GB */
    assert_int_equal(pack_prepare(&pack, &mesh, &surface, fixed, 1, &why), STATUS_MESH_TOO_LARGE);
    assert_non_null(strstr(why.cause, "GB"));
    memset(fixed, 1, surface.vertex_count);
    assert_int_equal(pack_prepare(&pack, &mesh, &surface, fixed, 1, &why), STATUS_SCENE_SELECTION);
    free(fixed);
}

static void results_replace_only_regular_files(void **state)
{
    (void)state;
    struct file_writer writer;
    struct failure why;
    assert_int_equal(file_begin(&writer, "/dev/null", &why), STATUS_FILE_WRITE);
    file_abandon(&writer);
    assert_int_equal(file_begin(&writer, "/", &why), STATUS_FILE_WRITE);
    assert_int_equal(file_begin(&writer, "/no/such/folder/x", &why), STATUS_FILE_WRITE);
    const char *path = temporary_path("writer");
    assert_int_equal(file_replace(path, "old", 3, &why), STATUS_OK);
    assert_int_equal(file_begin(&writer, path, &why), STATUS_OK);
    assert_int_equal(file_append(&writer, "new!", 4, &why), STATUS_OK);
    file_abandon(&writer);
    unsigned char *bytes;
    size_t length;
    assert_int_equal(file_load(path, &bytes, &length, &why), STATUS_OK);
    assert_int_equal(length, 3);
    assert_memory_equal(bytes, "old", 3);
    free(bytes);
    assert_int_equal(file_begin(&writer, path, &why), STATUS_OK);
    assert_int_equal(file_append(&writer, "xxw!", 4, &why), STATUS_OK);
    assert_int_equal(file_patch(&writer, 0, "ne", 2, &why), STATUS_OK);
    assert_int_equal(file_commit(&writer, &why), STATUS_OK);
    assert_int_equal(file_load(path, &bytes, &length, &why), STATUS_OK);
    assert_int_equal(length, 4);
    assert_memory_equal(bytes, "new!", 4);
    free(bytes);
    unlink(path);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_section_is_what_went_in),        cmocka_unit_test(compliance_is_rounded_once_to_nearest),
        cmocka_unit_test(provenance_survives_letter_by_letter), cmocka_unit_test(unknown_and_nested_keys_are_skipped),
        cmocka_unit_test(bodies_beyond_the_format_are_refused), cmocka_unit_test(results_replace_only_regular_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
