#include <math.h>

#include "mesh_fixture.h"
#include "scene_fixture.h"

/* A block of 8 x 8 x 8 cm in cubes of 1 cm: 9^3 nodes, 9^3 - 7^3 = 386 on the surface; labels 1 "left", 2 "right". */
struct block {
    struct mesh mesh;
    struct surface surface;
    struct scene scene;
    bool *inside;
};

static struct block block_make(void)
{
    struct block b = {.mesh = box_mesh(8)};
    struct mesh_report report;
    struct failure why;
    assert_int_equal(mesh_check(&b.mesh, false, &report, &why), STATUS_OK);
    assert_int_equal(mesh_scale(&b.mesh, 0, MESH_UNIT_CM, &why), STATUS_OK);
    assert_int_equal(mesh_surface(&b.mesh, &b.surface, &why), STATUS_OK);
    assert_int_equal(b.surface.vertex_count, 386);
    scene_assume("block.msh", 0, MESH_UNIT_CM, &b.scene);
    b.inside = malloc(b.mesh.node_count * sizeof *b.inside);
    assert_non_null(b.inside);
    return b;
}

static void block_free(struct block *b)
{
    free(b->inside);
    surface_free(&b->surface);
    mesh_free(&b->mesh);
}

/* The selection of a scene's text on the block; returns the status, checks that count and flags agree. */
static int select_text(struct block *b, const char *text, size_t *count, struct failure *why)
{
    char whole[1000];
    snprintf(whole, sizeof whole, "%s  fixed:\n    - {%s}\n", scene_small, text);
    assert_int_equal(parse(whole, "s.yaml", &b->scene, why), STATUS_OK);
    memset(b->inside, 1, b->mesh.node_count);
    int status = scene_select(&b->scene.fixed[0].where, &b->scene, &b->mesh, &b->surface, b->inside, count, why);
    size_t counted = 0;
    for (size_t n = 0; n < b->mesh.node_count; n++)
        counted += b->inside[n];
    if (!status)
        assert_int_equal(counted, *count);
    return status;
}

static void selections_hold_the_nodes_that_geometry_says(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        size_t count;
    } cases[] = {
        {"box: {from: [0, 0, 0], to: [0.08, 0.08, 0]}", 81},             /* one side */
        {"box: {from: [0.03, 0.03, 0.03], to: [0.05, 0.05, 0.05]}", 27}, /* interior nodes only */
        {"box: {from: [-1, -1, -1], to: [1, 1, 1]}", 729},               /* all */
        {"box: {from: [1 cm, 0, 0], to: [10 mm, 0.08, 0.08]}", 81},      /* a plane of nodes */
        {"sphere: {at: [0.04, 0.04, 0.04], radius: 1 cm}", 7},           /* centre and six neighbours */
        {"sphere: {at: [0, 0, 0], radius: 2 cm}", 11},          /* an octant: (000) 3x(100) 3x(110) (111) 3x(200) */
        {"plane: {at: [0, 0, 0.06], normal: [0, 0, 5]}", 243},  /* three layers */
        {"plane: {at: [0, 0, 0.06], normal: [0, 0, -1]}", 567}, /* seven layers, the boundary in both */
        {"plane: {at: [0, 0, 0], normal: [-1, -1, -1]}", 1},    /* one corner */
        {"label: left", 5 * 81},                                /* x from 0 to 4 cm */
        {"label: 2", 5 * 81},                                   /* by number */
        {"patch: {near: [0, 0, 0], share: 1 %}", 4},            /* ceil(3.86) */
        {"patch: {near: [0, 0, 0], share: 100 %}", 386},        /* surface only */
        {"patch: {near: [9, 9, 9], share: 0.001 %}", 1},        /* at least one */
        {"axis_end: {share: 1 %}", 81},                         /* a flat end goes as a whole */
        {"axis_end: {share: 21 %}", 81 + 32},                   /* ceil(81.06): the next ring too */
    };
    struct block b = block_make();
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        size_t count;
        struct failure why;
        if (select_text(&b, cases[k].text, &count, &why))
            fail_msg("%s: %s", cases[k].text, why.cause);
        if (count != cases[k].count)
            fail_msg("%s: %zu nodes, not %zu", cases[k].text, count, cases[k].count);
    }
    block_free(&b);
}

static void shares_take_the_nearest_and_the_outermost_vertices(void **state)
{
    (void)state;
    struct block b = block_make();
    struct failure why;
    size_t count;
    const double near[3] = {0.08, 0.02, 0.05};
    assert_int_equal(select_text(&b, "patch: {near: [0.08, 0.02, 0.05], share: 5 %}", &count, &why), STATUS_OK);
    double farthest_in = 0, nearest_out = INFINITY;
    for (size_t v = 0; v < b.surface.vertex_count; v++) {
        const double *x = &b.mesh.nodes[3 * b.surface.node[v]];
        double away = hypot(hypot(x[0] - near[0], x[1] - near[1]), x[2] - near[2]);
        if (b.inside[b.surface.node[v]])
            farthest_in = fmax(farthest_in, away);
        else
            nearest_out = fmin(nearest_out, away);
    }
    assert_int_equal(count, 20); /* ceil(19.3) */
    assert_true(farthest_in <= nearest_out + 1e-15);

    /* Stretched along y, the lower end of y is taken. */
    for (size_t n = 0; n < b.mesh.node_count; n++)
        b.mesh.nodes[3 * n + 1] *= 3;
    assert_int_equal(select_text(&b, "axis_end: {share: 4 %}", &count, &why), STATUS_OK);
    assert_int_equal(count, 81);
    for (size_t n = 0; n < b.mesh.node_count; n++)
        assert_int_equal(b.inside[n], b.mesh.nodes[3 * n + 1] == 0);
    block_free(&b);
}

static void an_empty_selection_is_refused_with_its_line(void **state)
{
    (void)state;
    static const struct {
        const char *text, *says;
    } cases[] = {
        {"box: {from: [1, 1, 1], to: [2, 2, 2]}",
         "box holds no node; the body spans [0, 0, 0] to [0.08, 0.08, 0.08] m"},
        {"sphere: {at: [0.005, 0.005, 0.005], radius: 1 mm}", "sphere holds no node"},
        {"plane: {at: [0, 0, 1], normal: [0, 0, 1]}", "plane holds no node"},
        {"label: bone", "the mesh has no label 'bone'; it has: 1 'left', 2 'right'"},
        {"label: 3", "the mesh has no label '3'"},
    };
    struct block b = block_make();
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        size_t count;
        struct failure why;
        assert_int_equal(select_text(&b, cases[k].text, &count, &why), STATUS_SCENE_SELECTION);
        assert_string_equal(why.place, "s.yaml:6");
        assert_non_null(strstr(why.cause, cases[k].says));
    }
    block_free(&b);
}

static int materials_text(struct block *b, const char *text, uint8_t *material_of, struct failure *why)
{
    char whole[2000];
    snprintf(whole, sizeof whole, "scene: s\nbody:\n  mesh: {file: a.msh, unit: cm}\n  materials:\n%s", text);
    assert_int_equal(parse(whole, "s.yaml", &b->scene, why), STATUS_OK);
    return scene_materials(&b->scene, &b->mesh, material_of, why);
}

#define ELASTIC "E: 1 kPa, nu: 0.3, rho: 1000 kg/m3}\n"

static void a_specific_material_wins_over_all(void **state)
{
    (void)state;
    static const char *const texts[] = {"    - {label: all, " ELASTIC "    - {label: right, " ELASTIC,
                                        "    - {label: all, " ELASTIC "    - {label: 2, " ELASTIC,
                                        "    - {label: left, " ELASTIC "    - {label: right, " ELASTIC,
                                        "    - {label: 1, " ELASTIC "    - {label: all, " ELASTIC};
    struct block b = block_make();
    uint8_t *material_of = malloc(b.mesh.tetrahedron_count);
    struct failure why;
    for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++) {
        assert_int_equal(materials_text(&b, texts[k], material_of, &why), STATUS_OK);
        for (size_t e = 0; e < b.mesh.tetrahedron_count; e++)
            assert_int_equal(material_of[e], b.mesh.labels[e] - 1);
    }
    free(material_of);
    block_free(&b);
}

static void labels_and_materials_must_meet(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        enum status status;
        const char *place, *says;
    } cases[] = {
        {"    - {label: left, " ELASTIC, STATUS_MODEL_LABEL, "s.yaml:5", "1536 elements with label 2 'right'"},
        {"    - {label: all, " ELASTIC "    - {label: livr, " ELASTIC, STATUS_SCENE_VALUE, "s.yaml:6",
         "the mesh has only: 1 'left', 2 'right'"},
        {"    - {label: right, " ELASTIC "    - {label: 2, " ELASTIC "    - {label: left, " ELASTIC, STATUS_SCENE_VALUE,
         "s.yaml:6", "two materials, 'right' and '2'"},
    };
    struct block b = block_make();
    uint8_t *material_of = malloc(b.mesh.tetrahedron_count);
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        struct failure why;
        assert_int_equal(materials_text(&b, cases[k].text, material_of, &why), cases[k].status);
        assert_string_equal(why.place, cases[k].place);
        assert_non_null(strstr(why.cause, cases[k].says));
    }
    free(material_of);
    block_free(&b);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(selections_hold_the_nodes_that_geometry_says),
        cmocka_unit_test(shares_take_the_nearest_and_the_outermost_vertices),
        cmocka_unit_test(an_empty_selection_is_refused_with_its_line),
        cmocka_unit_test(a_specific_material_wins_over_all),
        cmocka_unit_test(labels_and_materials_must_meet),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
