#include "progress.h"
#include "scene_fixture.h"

static void every_key_arrives_in_SI_units(void **state)
{
    (void)state;
    struct scene s;
    struct failure why;
    assert_int_equal(parse(scene_full, "folder/scene.yaml", &s, &why), STATUS_OK);
    assert_string_equal(s.name, "every-key");
    assert_string_equal(s.path, "folder/scene.yaml");
    assert_string_equal(s.mesh_path, "folder/meshes/liver.msh");
    assert_true(s.extent_m == 0.214 && s.surface_size_m == 0.006 && s.allow_components);
    assert_int_equal(s.unit, MESH_UNIT_NONE);
    assert_int_equal(s.material_count, 3);
    assert_string_equal(s.material[1].label, "tumour");
    assert_true(s.material[0].E_Pa == 4000 && s.material[0].nu == 0.45 && s.material[0].rho_kg_m3 == 1060);
    assert_true(s.material[1].E_Pa == 20000 && s.material[1].nu == -0.25 && s.material[1].rho_kg_m3 == 1100);
    assert_int_equal(s.material[1].line, 6);

    assert_int_equal(s.fixed_count, 6);
    const struct scene_fixed *f = s.fixed;
    assert_int_equal(f[0].where.kind, SELECT_BOX);
    assert_true(f[0].where.a[0] == -0.1 && f[0].where.a[1] == -0.05 && f[0].where.b[1] == 0.05 &&
                f[0].where.b[2] == 0.01);
    assert_true(f[0].component[0] && f[0].component[1] && f[0].component[2]);
    assert_int_equal(f[0].where.line, 9);
    assert_int_equal(f[1].where.kind, SELECT_SPHERE);
    assert_true(f[1].where.a[2] == 0.02 && f[1].where.value == 0.005);
    assert_true(f[1].component[0] && !f[1].component[1] && f[1].component[2]);
    assert_int_equal(f[2].where.kind, SELECT_PLANE);
    assert_true(f[2].where.b[0] == 0 && f[2].where.b[1] == 0.6 && f[2].where.b[2] == -0.8);
    assert_true(!f[2].component[0] && f[2].component[1] && !f[2].component[2]);
    assert_int_equal(f[3].where.kind, SELECT_LABEL);
    assert_string_equal(f[3].where.label, "bone");
    assert_int_equal(f[4].where.kind, SELECT_PATCH);
    assert_true(f[4].where.a[0] == -0.1 && f[4].where.value == 0.04);
    assert_int_equal(f[5].where.kind, SELECT_AXIS_END);
    assert_true(f[5].where.value == 0.025);

    assert_int_equal(s.ligament_count, 2);
    assert_true(s.ligament[0].stiffness_N_m == 200 && s.ligament[0].direction[2] == 1);
    assert_true(s.ligament[1].stiffness_N_m == 500 && s.ligament[1].where.value == 1);

    assert_int_equal(s.instrument_count, 2);
    const struct scene_instrument *i = s.instrument;
    assert_true(i->placed && i->trocar_m[2] == 0.2 && i->axis[2] == -1);
    assert_true(i->length_min_m == 0.12 && i->length_max_m == 0.22);
    assert_true(i->tip_radius_m == 0.004 && i->tip_points == 9);
    assert_true(i->coupling_stiffness_N_m == 800 && i->coupling_damping_Ns_m == 0.2 && i->force_limit_N == 5);
    assert_true(s.regularisation == 0.002 && s.solver_steps == 12);
    assert_true(s.budget_instructions == 240000 && s.budget_bank_bytes == 1572864 && s.budget_force_error == 0.005);
}

static void what_is_left_out_has_the_documented_default(void **state)
{
    (void)state;
    struct scene s;
    struct failure why;
    assert_int_equal(parse(scene_small, "scene.yaml", &s, &why), STATUS_OK);
    assert_string_equal(s.mesh_path, "a.msh");
    assert_int_equal(s.unit, MESH_UNIT_MM);
    assert_true(s.extent_m == 0 && s.surface_size_m == 0 && !s.allow_components);
    assert_string_equal(s.material[0].label, "all");
    assert_int_equal(s.fixed_count + s.ligament_count, 0);
    assert_int_equal(s.instrument_count, 1);
    const struct scene_instrument *i = s.instrument;
    assert_string_equal(i->name, "right");
    assert_string_equal(i->device, "impulse-engine");
    assert_true(!i->placed && i->length_min_m == 0.10 && i->length_max_m == 0.23);
    assert_true(i->tip_radius_m == 0.005 && i->tip_points == 7 && i->force_limit_N == 0);
    assert_true(i->coupling_stiffness_N_m == 0 && i->coupling_damping_Ns_m == 0);
    assert_true(s.regularisation == 1e-3 && s.solver_steps == 0);
    assert_true(s.budget_instructions == 0 && s.budget_bank_bytes == 0 && s.budget_force_error == 0);
}

static void an_absolute_mesh_path_stays(void **state)
{
    (void)state;
    struct scene s;
    struct failure why;
    char *text = changed(scene_small, "a.msh", "/tmp/a.msh");
    assert_int_equal(parse(text, "folder/scene.yaml", &s, &why), STATUS_OK);
    assert_string_equal(s.mesh_path, "/tmp/a.msh");
    free(text);
}

static void a_byte_order_mark_and_windows_lines_are_read(void **state)
{
    (void)state;
    struct scene s;
    struct failure why;
    char text[1000] = "\xEF\xBB\xBF";
    for (const char *p = scene_small; *p; p++)
        sprintf(text + strlen(text), "%s%c", *p == '\n' ? "\r" : "", *p);
    assert_int_equal(parse(text, "", &s, &why), STATUS_OK);
    assert_string_equal(s.name, "small");
}

/* One change of the full scene, and what must be said about it. */
struct fault {
    const char *from, *to;
    enum status status;
    long line;
    const char *says; /* part of cause or remedy */
};

static const struct fault faults[] = {
    /* keys */
    {"contact:", "kontakt:", STATUS_SCENE_KEY, 28, "did you mean 'contact'?"},
    {"    force_limit", "    force_limits", STATUS_SCENE_KEY, 26, "did you mean 'force_limit'?"},
    {"rho: 1.1", "density: 1.1", STATUS_SCENE_KEY, 6, "unknown key 'density' in material"},
    {"stiffness: 200 N/m", "stifness: 200 N/m", STATUS_SCENE_KEY, 16, "did you mean 'stiffness'?"},
    {"share: 2.5 %}", "share: 2.5 %, near: [0, 0, 0]}", STATUS_SCENE_KEY, 14, "unknown key 'near'"},
    {"nu: 0.45,", "nu: 0.45, nu: 0.45,", STATUS_SCENE_KEY, 5, "twice"},
    {"effects: {}", "scene: again", STATUS_SCENE_KEY, 29, "'scene' stands twice"},
    {"effects: {}", "effects: {glue: {mu: 0.2}}", STATUS_SCENE_KEY, 29, "effect 'glue' is not known"},
    {"effects: {}", "effects: [friction]", STATUS_SCENE_KEY, 29, "effects is not a mapping"},
    {"effects: {}", "effects: {friction: {mu: 0.2}, friction: {mu: 0.3}}", STATUS_SCENE_KEY, 29, "stands twice"},
    {"scene: every-key", "? [scene]\n: x", STATUS_SCENE_KEY, 1, "not a word"},
    /* missing */
    {"scene: every-key\n", "", STATUS_SCENE_MISSING, 1, "'scene'"},
    {"file: meshes/liver.msh, ", "", STATUS_SCENE_MISSING, 3, "'file'"},
    {"extent: 0.214 m, ", "", STATUS_SCENE_MISSING, 3, "unit: m, cm or mm"},
    {"E: 4 kPa, ", "", STATUS_SCENE_MISSING, 5, "'E'"},
    {", nu: 0.45", "", STATUS_SCENE_MISSING, 5, "'nu'"},
    {", rho: 1060 kg/m3", "", STATUS_SCENE_MISSING, 5, "'rho'"},
    {"    - {axis_end: {share: 2.5 %}}", "    - {components: [x]}", STATUS_SCENE_MISSING, 14, "selects nothing"},
    {"{share: 2.5 %}", "{}", STATUS_SCENE_MISSING, 14, "'share'"},
    {", radius: 5 mm", "", STATUS_SCENE_MISSING, 10, "'radius'"},
    {"stiffness: 200 N/m, ", "", STATUS_SCENE_MISSING, 16, "'stiffness'"},
    {", direction: [0, 0, 2]", "", STATUS_SCENE_MISSING, 16, "'direction'"},
    {", axis: [0, 0, -1]", "", STATUS_SCENE_MISSING, 21, "'axis'"},
    {"{name: left}", "{tip: {points: 1}}", STATUS_SCENE_MISSING, 27, "'name'"},
    /* units */
    {"4 kPa", "4", STATUS_SCENE_UNIT, 5, "E: 4 has no unit; a pressure is expected here (Pa, kPa, MPa, GPa)"},
    {"4 kPa", "4 mm", STATUS_SCENE_UNIT, 5, "'mm' is the unit of a length; a pressure"},
    {"4 kPa", "4 kpa", STATUS_SCENE_UNIT, 5, "capitals matter: kPa"},
    {"4 kPa", "4 psi", STATUS_SCENE_UNIT, 5, "'psi' is not known"},
    {"nu: 0.45", "nu: 45 %", STATUS_SCENE_UNIT, 5, "a plain number"},
    {"0.214 m", "0.214", STATUS_SCENE_UNIT, 3, "a length is expected here (m, cm, mm)"},
    {"1060 kg/m3", "1060 kg", STATUS_SCENE_UNIT, 5, "kg/m3, g/cm3"},
    {"200 N/m", "200 N", STATUS_SCENE_UNIT, 16, "a stiffness"},
    {"0.2 N s/m", "0.2 N/m", STATUS_SCENE_UNIT, 25, "N s/m"},
    {"5000 mN", "5", STATUS_SCENE_UNIT, 26, "(N, mN)"},
    {"4 %}", "0.04}", STATUS_SCENE_UNIT, 13, "a share is expected here (%)"},
    {"1.5 MiB", "1.5", STATUS_SCENE_UNIT, 30, "B, KiB, MiB"},
    {"0.12..0.22 m", "0.12..0.22", STATUS_SCENE_UNIT, 22, "a length"},
    {"0.12..0.22 m", "0.12 N..0.22 m", STATUS_SCENE_UNIT, 22, "'N' is the unit of a force"},
    {"-5 cm", "-5 kPa", STATUS_SCENE_UNIT, 9, "a position"},
    {"[0, 0, -1]", "[0, 0, -1 m]", STATUS_SCENE_UNIT, 21, "a plain number"},
    /* values */
    {"4 kPa", "0 kPa", STATUS_SCENE_VALUE, 5, "E = 0 Pa"},
    {"4 kPa", "-4 kPa", STATUS_SCENE_VALUE, 5, "E = -4000 Pa"},
    {"4 kPa", "soft", STATUS_SCENE_VALUE, 5, "'soft' is not a number"},
    {"4 kPa", ".inf kPa", STATUS_SCENE_VALUE, 5, "not a number"},
    {"4 kPa", "nan kPa", STATUS_SCENE_VALUE, 5, "not a number"},
    {"4 kPa", "0x10 kPa", STATUS_SCENE_UNIT, 5, "'x10 kPa' is not known"},
    {"4 kPa", "1e999 kPa", STATUS_SCENE_VALUE, 5, "too large"},
    {"4 kPa", "1e307 GPa", STATUS_SCENE_VALUE, 5, "too large"},
    {"4 kPa", "[4 kPa]", STATUS_SCENE_VALUE, 5, "not a single value"},
    {"nu: 0.45", "nu: 0.5", STATUS_SCENE_VALUE, 5, "nu = 0.5"},
    {"nu: 0.45", "nu: -1", STATUS_SCENE_VALUE, 5, "nu = -1"},
    {"1060 kg/m3", "0 kg/m3", STATUS_SCENE_VALUE, 5, "rho = 0"},
    {"label: tumour", "label: all", STATUS_SCENE_VALUE, 6, "a material already, in line 5"},
    {"0.214 m", "0 m", STATUS_SCENE_VALUE, 3, "extent = 0"},
    {"size: 6 mm", "unit: mm", STATUS_SCENE_VALUE, 3, "both"},
    {"size: 6 mm", "size: -6 mm", STATUS_SCENE_VALUE, 3, "size = -0.006"},
    {"order: linear", "order: cubic", STATUS_SCENE_VALUE, 3, "known here: linear, quadratic"},
    {"to: [0.1, 50 mm, 1e-2]", "to: [-0.2, 50 mm, 1e-2]", STATUS_SCENE_VALUE, 9, "along x"},
    {"radius: 5 mm", "radius: 0 mm", STATUS_SCENE_VALUE, 10, "radius = 0"},
    {"[0, 3, -4]", "[0, 0, 0]", STATUS_SCENE_VALUE, 11, "no direction"},
    {"[0, 3, -4]", "[0, 3]", STATUS_SCENE_VALUE, 11, "2 components"},
    {"[0, 3, -4]", "[0, 3, 4, 5]", STATUS_SCENE_VALUE, 11, "4 entries"},
    {"[0, 3, -4]", "up", STATUS_SCENE_VALUE, 11, "not a list"},
    {"components: [x, z]", "components: [x, x]", STATUS_SCENE_VALUE, 10, "x twice"},
    {"components: [x, z]", "components: [x], along: [1, 1, 0]", STATUS_SCENE_VALUE, 10,
     "both 'components' and 'along'"},
    {"components: [x, z]", "along: [0, 0, 0]", STATUS_SCENE_VALUE, 10, "along"},
    {"components: [x, z]", "components: [w]", STATUS_SCENE_VALUE, 10, "known here: x, y, z"},
    {"components: [x, z]", "components: []", STATUS_SCENE_VALUE, 10, "empty"},
    {"{label: bone}", "{label: bone, axis_end: {share: 1 %}}", STATUS_SCENE_VALUE, 12, "two selections"},
    {"{label: bone}", "{label: \"\"}", STATUS_SCENE_VALUE, 12, "empty"},
    {"{label: bone}", "{label: \"a\\nb\"}", STATUS_SCENE_VALUE, 12, "control characters"},
    {"{label: bone}", "{label: \"a\\0b\"}", STATUS_SCENE_VALUE, 12, "not a single value"},
    {"4 %}", "0 %}", STATUS_SCENE_VALUE, 13, "share = 0 %"},
    {"100 %", "101 %", STATUS_SCENE_VALUE, 17, "share = 101 %"},
    {"200 N/m", "-200 N/m", STATUS_SCENE_VALUE, 16, "stiffness = -200"},
    {"[0, 0, 2]", "[0, 0, 0]", STATUS_SCENE_VALUE, 16, "no direction"},
    {"allow_components: true", "allow_components: yes", STATUS_SCENE_VALUE, 18, "known here: false, true"},
    {"[0, 0, 0.2]", "[0, 0, 2000]", STATUS_SCENE_VALUE, 21, "beyond"},
    {"[0, 0, -1]", "[0, 0, 0]", STATUS_SCENE_VALUE, 21, "no direction"},
    {"0.12..0.22 m", "0.22..0.12 m", STATUS_SCENE_VALUE, 22, "below the second"},
    {"0.12..0.22 m", "0.12..0.12 m", STATUS_SCENE_VALUE, 22, "below the second"},
    {"0.12..0.22 m", "0.12..0.32 m", STATUS_SCENE_VALUE, 22, "reaches 0.1..0.23 m"},
    {"0.12..0.22 m", "0.12 m", STATUS_SCENE_VALUE, 22, "A..B"},
    {"radius: 4 mm", "radius: 4 m", STATUS_SCENE_VALUE, 23, "radius = 4 m"},
    {"points: 9", "points: 17", STATUS_SCENE_VALUE, 23, "from 1 to 16"},
    {"points: 9", "points: 0", STATUS_SCENE_VALUE, 23, "from 1 to 16"},
    {"points: 9", "points: 2.5", STATUS_SCENE_VALUE, 23, "whole number"},
    {"points: 9", "points: 10", STATUS_SCENE_VALUE, 20, "17 points in all"},
    {"effects: {}", "effects: {second: {}}", STATUS_SCENE_KEY, 29, "a second instrument names it"},
    {"device: impulse-engine", "device: omni", STATUS_SCENE_VALUE, 24, "this version has: impulse-engine"},
    {"0.8 N/mm", "20 N/mm", STATUS_SCENE_VALUE, 25, "stays passive up to"},
    {"0.2 N s/m", "7 N s/m", STATUS_SCENE_VALUE, 25, "must stay below"},
    {"5000 mN", "12 N", STATUS_SCENE_VALUE, 26, "to 8.9"},
    {"{name: left}", "{name: right}", STATUS_SCENE_VALUE, 27, "two instruments"},
    {"{name: left}", "{name: ../left}", STATUS_SCENE_VALUE, 27, "is not a name"},
    {"{name: left}", "{name: a}\n  - {name: b}", STATUS_SCENE_VALUE, 20, "at most 2"},
    {"0.2 %", "0 %", STATUS_SCENE_VALUE, 28, "regularisation = 0"},
    {"steps: 12", "steps: 0", STATUS_SCENE_VALUE, 28, "steps = 0"},
    {"steps: 12", "steps: 49", STATUS_SCENE_VALUE, 28, "from 1 to 48"},
    {"240000", "0", STATUS_SCENE_VALUE, 30, "instructions = 0"},
    {"1.5 MiB", "0 B", STATUS_SCENE_VALUE, 30, "bank = 0"},
    {"0.5 %", "200 %", STATUS_SCENE_VALUE, 30, "force_error = 200 %"},
    {"scene: every-key", "scene: a/b", STATUS_SCENE_VALUE, 1, "is not a name"},
    /* YAML */
    {"  - {name: left}", "\t- {name: left}", STATUS_SCENE_SYNTAX, 27, "tab"},
    {"effects: {}", "effects: {", STATUS_SCENE_SYNTAX, 31, "flow mapping"},
    {"effects: {}", "effects: &a {}", STATUS_OK, 0, ""},
    {"effects: {}", "effects: *a", STATUS_SCENE_SYNTAX, 29, "no aliases"},
    {"effects: {}", "effects: !!python/object {}", STATUS_SCENE_SYNTAX, 29, "no tags"},
    {"effects: {}", "effects: {}\n---\nscene: two", STATUS_SCENE_SYNTAX, 31, "second document"},
    {"label: bone", "label: b\xFFne", STATUS_SCENE_SYNTAX, 12, "UTF-8"},
    {"label: bone", "label: b\x01ne", STATUS_SCENE_SYNTAX, 12, "UTF-8"},
    {"label: bone", "label: \xC3\xB6s", STATUS_OK, 0, ""},
};

static void every_fault_is_named_with_its_line(void **state)
{
    (void)state;
    size_t wrong = 0;
    for (size_t k = 0; k < sizeof faults / sizeof faults[0]; k++) {
        const struct fault *f = &faults[k];
        char *text = changed(scene_full, f->from, f->to);
        struct scene s;
        struct failure why;
        int status = parse(text, "s.yaml", &s, &why);
        char place[40];
        snprintf(place, sizeof place, "s.yaml:%ld", f->line);
        bool said = strstr(why.cause, f->says) || strstr(why.remedy, f->says);
        if (status != f->status || (status && (strcmp(place, why.place) != 0 || !said || why.status != status))) {
            print_message("# '%s' -> '%s': %s at %s: %s; %s\n", f->from, f->to, status_name(status), why.place,
                          why.cause, why.remedy);
            wrong++;
        }
        free(text);
    }
    assert_int_equal(wrong, 0);
}

static void a_file_without_a_scene_is_refused(void **state)
{
    (void)state;
    static const char *const texts[] = {"", "\n", "# nothing\n", "---\n...\n"};
    struct scene s;
    struct failure why;
    for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++)
        assert_int_equal(parse(texts[k], "s.yaml", &s, &why), k < 3 ? STATUS_SCENE_MISSING : STATUS_SCENE_VALUE);
    assert_int_equal(parse("just text", "s.yaml", &s, &why), STATUS_SCENE_VALUE);
    assert_int_equal(parse("[1, 2]", "s.yaml", &s, &why), STATUS_SCENE_VALUE);
    assert_int_equal(scene_parse("a\0b", 3, "s.yaml", &s, &why), STATUS_SCENE_SYNTAX);
    assert_int_equal(scene_read("/nowhere/s.yaml", &s, &why), STATUS_FILE_OPEN);
    assert_int_equal(scene_read("/dev/zero", &s, &why), STATUS_SCENE_SYNTAX);
    assert_int_equal(scene_read("/", &s, &why), STATUS_FILE_READ);
}

/* Bounded: a tower of brackets, an alias bomb, a page of keys, more than a scene may have. */
static void hostile_files_are_refused_without_growing(void **state)
{
    (void)state;
    enum { SIZE = 262144 };
    char *text = malloc(SIZE + 2);
    struct scene s;
    struct failure why;
    assert_non_null(text);
    const char *const units[] = {"[", "{", "- ", "? ", "a: [", "&a [*a, "};
    for (size_t k = 0; k < sizeof units / sizeof units[0]; k++) {
        size_t length = strlen(units[k]);
        for (size_t i = 0; i < SIZE; i++)
            text[i] = units[k][i % length];
        int status = scene_parse(text, SIZE, "s.yaml", &s, &why);
        assert_true(status == STATUS_SCENE_SYNTAX || status == STATUS_SCENE_KEY);
    }
    size_t used = 0;
    for (int i = 0; used < SIZE - 32; i++)
        used += (size_t)sprintf(text + used, "key%d: 1\n", i);
    assert_int_equal(scene_parse(text, used, "s.yaml", &s, &why), STATUS_SCENE_KEY);
    memset(text, ' ', SIZE + 1);
    assert_int_equal(scene_parse(text, SIZE + 1, "s.yaml", &s, &why), STATUS_SCENE_SYNTAX);
    assert_non_null(strstr(why.cause, "larger"));
    free(text);
}

/* SCENE.md has a row for every key (a word before a colon in the full scene), and its example is a scene. */
static void the_manual_names_every_key_and_its_example_reads(void **state)
{
    (void)state;
    unsigned char *bytes;
    size_t length;
    struct failure why;
    assert_int_equal(file_load("host/scenes/SCENE.md", &bytes, &length, &why), STATUS_OK);
    char *manual = (char *)bytes;
    size_t keys = 0;
    for (const char *p = strchr(scene_full, ':'); p; p = strchr(p + 1, ':')) {
        const char *start = p;
        while (start > scene_full && strchr("abcdefghijklmnopqrstuvwxyz_E", start[-1]))
            start--;
        char quoted[40];
        snprintf(quoted, sizeof quoted, "`%.*s`", (int)(p - start), start);
        if (!strstr(manual, quoted))
            fail_msg("SCENE.md does not mention %s", quoted);
        keys++;
    }
    assert_true(keys > 60);
    char *example = strstr(manual, "```yaml\n");
    assert_non_null(example);
    example += strlen("```yaml\n");
    struct scene s;
    assert_int_equal(scene_parse(example, (size_t)(strstr(example, "```") - example), "SCENE.md", &s, &why), STATUS_OK);
    assert_string_equal(s.name, "liver-press");
    free(manual);
}

static void the_scenes_of_the_demo_read(void **state)
{
    (void)state;
    struct scene s;
    struct failure why;
    assert_int_equal(scene_read("host/scenes/demo/demo.yaml", &s, &why), STATUS_OK);
    assert_string_equal(s.mesh_path, "host/scenes/demo/liver.geo");
    assert_int_equal(scene_read("host/scenes/demo/block.yaml", &s, &why), STATUS_OK);
    assert_string_equal(s.mesh_path, "host/scenes/demo/block.geo");
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_key_arrives_in_SI_units),
        cmocka_unit_test(what_is_left_out_has_the_documented_default),
        cmocka_unit_test(an_absolute_mesh_path_stays),
        cmocka_unit_test(a_byte_order_mark_and_windows_lines_are_read),
        cmocka_unit_test(every_fault_is_named_with_its_line),
        cmocka_unit_test(a_file_without_a_scene_is_refused),
        cmocka_unit_test(hostile_files_are_refused_without_growing),
        cmocka_unit_test(the_manual_names_every_key_and_its_example_reads),
        cmocka_unit_test(the_scenes_of_the_demo_read),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
