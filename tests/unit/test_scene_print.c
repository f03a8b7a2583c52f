#include <math.h>

#include "quantity.h"
#include "random.h"
#include "scene_fixture.h"

static void units_convert_to_SI(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        enum dimension dimension;
        double value;
    } cases[] = {
        {"1060", DIMENSION_NUMBER, 1060},
        {" -2.5e-3 ", DIMENSION_NUMBER, -0.0025},
        {".5", DIMENSION_NUMBER, 0.5},
        {"5.", DIMENSION_NUMBER, 5},
        {"0.1 %", DIMENSION_RATIO, 0.001},
        {"0.001", DIMENSION_RATIO, 0.001},
        {"4 %", DIMENSION_SHARE, 0.04},
        {"4%", DIMENSION_SHARE, 0.04},
        {"214 mm", DIMENSION_LENGTH, 0.214},
        {"21.4cm", DIMENSION_LENGTH, 0.214},
        {"3 m", DIMENSION_LENGTH, 3},
        {"3", DIMENSION_POSITION, 3},
        {"3 mm", DIMENSION_POSITION, 0.003},
        {"4 Pa", DIMENSION_PRESSURE, 4},
        {"4 kPa", DIMENSION_PRESSURE, 4e3},
        {"4 MPa", DIMENSION_PRESSURE, 4e6},
        {"4 GPa", DIMENSION_PRESSURE, 4e9},
        {"1 kg/m3", DIMENSION_DENSITY, 1},
        {"1 kg/m^3", DIMENSION_DENSITY, 1},
        {"1 kg/m\xC2\xB3", DIMENSION_DENSITY, 1},
        {"1.06 g/cm3", DIMENSION_DENSITY, 1060},
        {"2 N/m", DIMENSION_STIFFNESS, 2},
        {"2 N/mm", DIMENSION_STIFFNESS, 2000},
        {"2 kN/m", DIMENSION_STIFFNESS, 2000},
        {"2 N s/m", DIMENSION_DAMPING, 2},
        {"2 Ns/m", DIMENSION_DAMPING, 2},
        {"2 N", DIMENSION_FORCE, 2},
        {"2 mN", DIMENSION_FORCE, 0.002},
        {"50 ms", DIMENSION_TIME, 0.05},
        {"2 s", DIMENSION_TIME, 2},
        {"7 B", DIMENSION_BYTES, 7},
        {"2 KiB", DIMENSION_BYTES, 2048},
        {"1 MiB", DIMENSION_BYTES, 1048576},
        {"2 rad", DIMENSION_ANGLE, 2},
        {"180 deg", DIMENSION_ANGLE, M_PI},
        {"2 Pa s", DIMENSION_VISCOSITY, 2},
        {"2 kPa s", DIMENSION_VISCOSITY, 2000},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        double value;
        char message[200] = "";
        assert_int_equal(quantity_parse(cases[k].text, cases[k].dimension, &value, message, sizeof message), STATUS_OK);
        if (value != cases[k].value)
            fail_msg("'%s' is %.17g, not %.17g", cases[k].text, value, cases[k].value);
    }
}

static void ranges_take_the_last_unit_or_their_own(void **state)
{
    (void)state;
    static const char *const texts[] = {"0.10..0.23 m", "10 cm..0.23 m", "100..230mm", "10cm .. 23 cm"};
    for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++) {
        double range[2];
        char message[200];
        assert_int_equal(quantity_parse_range(texts[k], DIMENSION_LENGTH, range, message, sizeof message), STATUS_OK);
        assert_true(range[0] == 0.1 && range[1] == 0.23);
    }
}

static void no_dimension_takes_the_units_of_another(void **state)
{
    (void)state;
    static const char *const sample[] = {"%", "mm", "kPa", "kg/m3", "N/m", "N s/m", "N", "s", "MiB", "deg", "Pa s"};
    static const enum dimension of[] = {DIMENSION_SHARE,     DIMENSION_LENGTH,  DIMENSION_PRESSURE, DIMENSION_DENSITY,
                                        DIMENSION_STIFFNESS, DIMENSION_DAMPING, DIMENSION_FORCE,    DIMENSION_TIME,
                                        DIMENSION_BYTES,     DIMENSION_ANGLE,   DIMENSION_VISCOSITY};
    for (int d = DIMENSION_NUMBER; d <= DIMENSION_VISCOSITY; d++)
        for (int u = 0; u < 11; u++) {
            char text[40], message[200];
            double value;
            snprintf(text, sizeof text, "1 %s", sample[u]);
            bool own = (int)of[u] == d || (d == DIMENSION_RATIO && u == 0) || (d == DIMENSION_POSITION && u == 1);
            assert_int_equal(quantity_parse(text, (enum dimension)d, &value, message, sizeof message),
                             own ? STATUS_OK : STATUS_SCENE_UNIT);
        }
}

static void a_printed_quantity_reads_back_to_the_bit(void **state)
{
    (void)state;
    random_seed("quantities", 20);
    for (int k = 0; k < 20000; k++) {
        double value = random_range(-1, 1) * pow(10, (int)random_below(30) - 15), back = 0;
        if (k % 4 == 0) /* what people write */
            value = (int)random_below(1000) / pow(10, random_below(6));
        enum dimension dimension = (enum dimension)random_below(DIMENSION_VISCOSITY + 1);
        char text[QUANTITY_TEXT], message[200];
        quantity_print(value, dimension, text);
        if (!text[0] || quantity_parse(text, dimension, &back, message, sizeof message) || back != value)
            fail_msg("%.17g printed as '%s' reads %.17g", value, text, back);
    }
}

/* Print, read back where mesh paths are not resolved (no folder), compare; and printing again changes nothing. */
static void round_trip(const struct scene *scene)
{
    char *text = scene_print(scene);
    assert_non_null(text);
    struct scene back;
    struct failure why;
    if (parse(text, "", &back, &why))
        fail_msg("%s: %s\n%s", why.place, why.cause, text);
    same_scene(scene, &back);
    char *again = scene_print(&back);
    assert_string_equal(text, again);
    free(again);
    free(text);
}

static void the_assumed_scene_reads_back(void **state)
{
    (void)state;
    struct scene scene;
    scene_assume("../data/liver smooth: \"1\".msh", 0.214, MESH_UNIT_NONE, &scene);
    assert_string_equal(scene.name, "liver-smooth---1-");
    assert_true(scene.material[0].E_Pa == 4000 && scene.material[0].nu == 0.45 && scene.material[0].rho_kg_m3 == 1060);
    assert_int_equal(scene.fixed[0].where.kind, SELECT_AXIS_END);
    assert_true(scene.fixed[0].where.value == 0.04);
    round_trip(&scene);
    scene_assume("-.hidden", 0, MESH_UNIT_MM, &scene);
    round_trip(&scene);
    scene_assume("...", 1.0 / 3, MESH_UNIT_NONE, &scene);
    round_trip(&scene);
}

static void full_and_small_scenes_read_back(void **state)
{
    (void)state;
    struct scene scene;
    struct failure why;
    assert_int_equal(parse(scene_full, "", &scene, &why), STATUS_OK);
    round_trip(&scene);
    assert_int_equal(parse(scene_small, "", &scene, &why), STATUS_OK);
    round_trip(&scene);
}

/* A direction of any length > 0, as reading makes it: a unit vector. */
static void random_direction(double d[3])
{
    char text[400];
    struct scene scene;
    struct failure why;
    snprintf(text, sizeof text,
             "%s  ligaments: [{axis_end: {share: 1 %%}, stiffness: 1 N/m, direction: [%.17g, %.17g, %.17g]}]\n",
             scene_small, random_range(-2, 2), random_range(-2, 2), random_range(-2, 2));
    assert_int_equal(parse(text, "", &scene, &why), STATUS_OK);
    memcpy(d, scene.ligament[0].direction, 3 * sizeof *d);
}

static void scenes_with_random_numbers_read_back(void **state)
{
    (void)state;
    random_seed("scenes", 21);
    for (int k = 0; k < 300; k++) {
        struct scene s;
        struct failure why;
        assert_int_equal(parse(scene_full, "", &s, &why), STATUS_OK);
        s.extent_m = random_range(0.01, 2);
        for (size_t m = 0; m < s.material_count; m++) {
            s.material[m].E_Pa = pow(10, random_range(1, 11));
            s.material[m].nu = random_range(-0.99, 0.4999);
            s.material[m].rho_kg_m3 = random_range(10, 20000);
        }
        for (size_t f = 0; f < s.fixed_count; f++)
            for (int i = 0; i < 3 && s.fixed[f].where.kind <= SELECT_PLANE; i++) {
                s.fixed[f].where.a[i] = random_range(-1, 0);
                if (s.fixed[f].where.kind == SELECT_BOX)
                    s.fixed[f].where.b[i] = random_range(0, 1);
            }
        random_direction(s.fixed[2].where.b);
        s.fixed[4].where.value = random_range(1e-6, 1);
        s.fixed[3].slides = random_below(2);
        memset(s.fixed[3].component, !s.fixed[3].slides, sizeof s.fixed[3].component);
        memset(s.fixed[3].along, 0, sizeof s.fixed[3].along);
        if (s.fixed[3].slides)
            random_direction(s.fixed[3].along);
        random_direction(s.ligament[0].direction);
        s.ligament[0].stiffness_N_m = pow(10, random_range(-3, 6));
        struct scene_instrument *t = &s.instrument[0];
        random_direction(t->axis);
        for (int i = 0; i < 3; i++)
            t->trocar_m[i] = random_range(-1, 1);
        t->length_min_m = random_range(0.10, 0.15);
        t->length_max_m = random_range(0.16, 0.23);
        t->tip_radius_m = random_range(0.001, 0.05);
        t->tip_points = 1 + random_below(8);
        t->coupling_stiffness_N_m = random_range(1, 800);
        t->coupling_damping_Ns_m = random_range(0.01, 0.5);
        t->force_limit_N = random_range(0.1, 8.9);
        s.regularisation = random_range(1e-5, 1);
        s.solver_steps = random_below(BANK_MAX_SOLVER_STEPS + 1);
        s.budget_force_error = random_range(1e-6, 1);
        round_trip(&s);
    }
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(units_convert_to_SI),
        cmocka_unit_test(ranges_take_the_last_unit_or_their_own),
        cmocka_unit_test(no_dimension_takes_the_units_of_another),
        cmocka_unit_test(a_printed_quantity_reads_back_to_the_bit),
        cmocka_unit_test(the_assumed_scene_reads_back),
        cmocka_unit_test(full_and_small_scenes_read_back),
        cmocka_unit_test(scenes_with_random_numbers_read_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
