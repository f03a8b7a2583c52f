/* The key `rigid` of a scene, its section of the bank, and what there is to draw of it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "bank_view.h"
#include "rigid_fixture.h"
#include "rigid_shapes.h"
#include "scene_fixture.h"

/* scene_full with these effects on its last line but one; its second instrument as said. */
static int parse_rigid(const char *rigid, const char *left, struct scene *scene, struct failure *why)
{
    char key[1200];
    snprintf(key, sizeof key, "effects: {rigid: %s}", rigid);
    char *text = changed(scene_full, "effects: {}", key), *one = changed(text, "  - {name: left}\n", left);
    char *fewer = changed(one, "points: 9", "points: 6");
    int status = parse(fewer, "s.yaml", scene, why);
    free(text), free(one), free(fewer);
    return status;
}

static const char *const LEFT = "  - {name: left, trocar: {at: [0.05, 0, 0.2], axis: [0, 0, -1]}, tip: {points: 7}}\n";

static void what_a_scene_says_reads_back(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"{}", "  - {name: left, trocar: {at: [0.05, 0, 0.2], axis: [0, 0, -1]}}\n"},
        {"{shaft: 4.5 mm, cannula: {radius: 6 mm, inside: 3 cm}}", "  - {name: left}\n"},
        {"{obstacles: [{name: ball, hull: [[0.1, 2 cm, 0.1]], radius: 5 mm}]}", ""},
        {"{shaft: 3 mm, obstacles: [{name: rib, hull: [[0.1, 0, 0], [0.1, 0, 0.1]], radius: 0.4 cm}, {name: bone, "
         "hull: "
         "[[0.2, 0, 0], [0.2, 0.1, 0], [0.2, 0, 0.1], [0.3, 0, 0]]}]}",
         ""},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct scene *scene = malloc(sizeof *scene), *back = malloc(sizeof *back);
        struct failure why;
        if (parse_rigid(cases[i][0], cases[i][1], scene, &why))
            fail_msg("%s: %s", cases[i][0], why.cause);
        char *text = scene_print(scene);
        if (parse(text, "s.yaml", back, &why))
            fail_msg("%s: %s: %s", text, why.place, why.cause);
        for (size_t k = 0; k < BANK_MAX_OBSTACLES; k++)
            scene->effects.rigid.obstacle[k].line = back->effects.rigid.obstacle[k].line = 0;
        assert_memory_equal(&scene->effects, &back->effects, sizeof scene->effects);
        free(text), free(scene), free(back);
    }
}

static void what_cannot_be_is_refused_with_its_line(void **state)
{
    (void)state;
    static const struct {
        const char *rigid, *left;
        int status;
        const char *cause;
    } cases[] = {
        {"{}", "", STATUS_SCENE_VALUE, "nothing to touch"},
        {"{shaft: 0.5 mm}", "", STATUS_SCENE_VALUE, "shaft"},
        {"{shaft: 3}", "", STATUS_SCENE_UNIT, "shaft"},
        {"{cannula: {radius: 6 mm}}", "", STATUS_SCENE_MISSING, "inside"},
        {"{cannula: {radius: 3 mm, inside: 2 cm}}", "", STATUS_SCENE_VALUE, "does not hold the shaft of 'right', 4 mm"},
        {"{cannula: {radius: 6 mm, inside: 25 cm}}", "", STATUS_SCENE_VALUE, "leaves nothing of the 0.22 m of 'right'"},
        {"{obstacles: [{name: a, hull: []}]}", "", STATUS_SCENE_VALUE, "hull is empty"},
        {"{obstacles: [{name: a}]}", "", STATUS_SCENE_MISSING, "hull"},
        {"{obstacles: [{hull: [[1, 0, 0]]}]}", "", STATUS_SCENE_MISSING, "name"},
        {"{obstacles: [{name: a, hull: [[1, 0]]}]}", "", STATUS_SCENE_VALUE, "a point of hull"},
        {"{obstacles: [{name: a, hull: [[1, 0, 0]]}, {name: a, hull: [[2, 0, 0]]}]}", "", STATUS_SCENE_VALUE,
         "two obstacles are named 'a'"},
        {"{obstacles: [{name: a, hull: [[1, 0, 0]], radius: 1 m}]}", "", STATUS_SCENE_VALUE, "radius"},
        {"{obstacles: [{name: a, hull: [[0.1, 0, 0.15], [-0.1, 0, 0.15]]}]}", "", STATUS_SCENE_VALUE,
         "'right' is inside the obstacle 'a' when it is drawn back: by 4 mm"},
        {"{obstacles: [{name: a, hull: [[0.02, 0, 0.1]], radius: 15 mm}]}", "", 0, NULL},
        {"{obstacles: [{name: a, hull: [[0.02, 0, 0.1]], radius: 17 mm}]}", "", STATUS_SCENE_VALUE,
         "drawn back: by 1 mm"},
        {"{cannula: {radius: 6 mm, inside: 10 cm}, obstacles: [{name: a, hull: [[0.02, 0, 0.15]], radius: 15 mm}]}", "",
         STATUS_SCENE_VALUE, "drawn back: by 1 mm"},
        {"{}", "  - {name: left, trocar: {at: [0.007, 0, 0.2], axis: [0, 0, -1]}}\n", STATUS_SCENE_VALUE,
         "'right' and 'left' are inside each other when they are drawn back: by 2 mm"},
        {"{obstacles: [{name: a, hull: [[1, 0, 0]]}, {name: b, hull: [[2, 0, 0]]}]}",
         "  - {name: left, trocar: {at: [0.05, 0, 0.2], axis: [0, 0, -1]}}\n", STATUS_SCENE_VALUE,
         "13 points of the tips and 5 rigid contacts: 16 in all"},
        {"{obstacles: [{name: a, hull: [[1, 0, 0]]}]}, neo_hookean: {}", "", STATUS_SCENE_VALUE, "do not go together"},
        {"{bones: []}", "", STATUS_SCENE_KEY, "bones"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct scene *scene = malloc(sizeof *scene);
        struct failure why;
        int status = parse_rigid(cases[i].rigid, cases[i].left, scene, &why);
        if (status != cases[i].status)
            fail_msg("%s: status %d: %s", cases[i].rigid, status, why.cause);
        bool with_line = strstr(cases[i].left, "left") ? why.place[0] == 's' : !strncmp(why.place, "s.yaml:28", 9);
        if (status && (!strstr(why.cause, cases[i].cause) || !with_line))
            fail_msg("%s: %s: %s", cases[i].rigid, why.place, why.cause);
        free(scene);
    }
}

static void the_section_holds_what_the_scene_says(void **state)
{
    (void)state;
    struct scene *scene = malloc(sizeof *scene);
    struct failure why;
    struct effect_section section;
    assert_int_equal(parse_rigid("{cannula: {radius: 6 mm, inside: 3 cm}, obstacles: [{name: rib, hull: [[0.1, 0, 0], "
                                 "[0.1, 0, 0.1]], radius: 4 mm}]}",
                                 LEFT, scene, &why),
                     0);
    assert_int_equal(scene_rigid_section(scene, NULL, &section, &why), 0);
    const struct bank_rigid *b = section.bytes;
    const struct bank_obstacle *o = (const void *)(b + 1);
    assert_int_equal(section.length, sizeof *b + sizeof *o);
    assert_int_equal(b->obstacles, 1);
    assert_true(b->shaft_radius_m[0] == 0.004f && b->shaft_radius_m[1] == 0.005f);
    assert_true(b->cannula_radius_m == 0.006f && b->cannula_inside_m == 0.03f);
    assert_true(o->points == 2 && o->radius_m == 0.004f && o->point_m[1][2] == 0.1f && o->point_m[2][0] == 0);
    free(section.bytes), free(scene);
}

static const double FAR_m[3] = {0.3, 0, 0};

static struct rigid_section good_section(void)
{
    struct rigid_section s = rig_section();
    const double rib[3][3] = {{0.4, 0, 0}, {0.4, 0, 0.1}, {0.4, 0.1, 0}};
    rig_obstacle(&s, 3, rib, 0.004);
    return s;
}

/* A bank with a section that one change has spoiled. */
static int opened(const struct rigid_section *section, struct bank_view *view)
{
    struct bank_fixture_options o = bank_fixture_default;
    const double down[3] = {0, 0, -1};
    struct bank_tool tool = rig_tool(FAR_m, down, 0.006);
    size_t length;
    o.subdivisions = 0;
    o.tool = &tool;
    o.rigid = &section->head;
    unsigned char *bytes = bank_fixture(&o, &length);
    int status = bank_view_open(view, bytes, length);
    free(bytes);
    return status;
}

static void a_bank_with_a_wrong_section_is_refused(void **state)
{
    (void)state;
    struct bank_view view;
    for (int k = 0; k < 16; k++) {
        struct rigid_section s = good_section();
        struct bank_rigid *b = &s.head;
        struct bank_obstacle *o = s.obstacle;
        switch (k) {
        case 0:
            b->shaft_radius_m[0] = 0.0005f;
            break;
        case 1:
            b->shaft_radius_m[1] = NAN;
            break;
        case 2:
            b->cannula_radius_m = 0.001f;
            break;
        case 3:
            b->cannula_radius_m = INFINITY;
            break;
        case 4:
            b->cannula_inside_m = -0.01f;
            break;
        case 5:
            b->reserved[1] = 1;
            break;
        case 6:
            o->radius_m = -1e-3f;
            break;
        case 7:
            o->points = 0;
            break;
        case 8:
            o->points = 17;
            break;
        case 9:
            o->reserved[0] = 1;
            break;
        case 10:
            o->point_m[2][1] = NAN;
            break;
        case 11:
            o->point_m[15][0] = INFINITY;
            break;
        case 12:
            o->point_m[0][0] = 1001;
            break;
        case 13:
            o->radius_m = NAN;
            break;
        case 14:
            b->reserved[2] = 1;
            break;
        default:
            b->cannula_inside_m = NAN;
            break;
        }
        assert_int_equal(opened(&s, &view), STATUS_BANK_NONFINITE);
        assert_int_equal(view.fault_tag, BANK_RIGD);
    }
    struct rigid_section s = good_section();
    assert_int_equal(opened(&s, &view), STATUS_OK);
    /* too many contacts beside the points: 1 point, 8 obstacles fit */
    while (s.head.obstacles < BANK_MAX_OBSTACLES)
        s.obstacle[s.head.obstacles++] = s.obstacle[0];
    assert_int_equal(opened(&s, &view), STATUS_OK);
}

static void what_there_is_to_draw_is_listed(void **state)
{
    (void)state;
    struct rigid_shape shape[RIGID_SHAPES_MAX];
    struct rigid_rig r;
    struct rigid_section s = good_section();
    const double down[3] = {0, 0, -1};
    s.head.cannula_radius_m = 0.005f;
    s.head.cannula_inside_m = 0.02f;
    struct bank_tool tool[2] = {rig_tool(FAR_m, down, 0.006), rig_tool(FAR_m, down, 0.002)};
    tool[1].trocar_m[0] += 0.05f;
    rig_open(&r, 2, tool, &s);
    assert_int_equal(rigid_shapes(&r.bank, shape), 6);
    assert_int_equal(shape[0].kind, RIGID_SHAPE_OBSTACLE);
    assert_int_equal(shape[0].points, 3);
    assert_true(shape[0].point_m[1][2] == 0.1f && fabs(shape[0].radius_m - 0.004) < 1e-9);
    static const enum rigid_shape_kind kinds[5] = {RIGID_SHAPE_CANNULA, RIGID_SHAPE_SHAFT, RIGID_SHAPE_TIP,
                                                   RIGID_SHAPE_CANNULA, RIGID_SHAPE_SHAFT};
    for (int i = 0; i < 5; i++) {
        assert_int_equal(shape[i + 1].kind, kinds[i]);
        assert_int_equal(shape[i + 1].instrument, i > 2);
    }
    assert_true(shape[2].from_m == shape[1].to_m && isinf(shape[2].to_m));
    rig_close(&r);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_a_scene_says_reads_back),
        cmocka_unit_test(what_cannot_be_is_refused_with_its_line),
        cmocka_unit_test(the_section_holds_what_the_scene_says),
        cmocka_unit_test(a_bank_with_a_wrong_section_is_refused),
        cmocka_unit_test(what_there_is_to_draw_is_listed),
    };
    return cmocka_run_group_tests_name("rigid scene", tests, NULL, NULL);
}
