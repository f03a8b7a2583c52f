/* Materials with directions: what the keys mean, that a printed scene says the same, and one clear line for each fault. */
#include <math.h>

#include "material.h"
#include "scene_fixture.h"

static const char text[] = "scene: fibres\n"
                           "body:\n"
                           "  mesh: {file: a.msh, unit: mm}\n"
                           "  materials:\n"
                           "    - {label: muscle, transverse: {E_L: 30 kPa, E_T: 10 kPa, G_LT: 4 kPa, nu_LT: 0.4, "
                           "nu_TT: 0.6}, along: [3, 0, 4], rho: 1060 kg/m3}\n"
                           "    - {label: wall, orthotropic: {E: [30 kPa, 12 kPa, 8000 Pa], G: [5 kPa, 4 kPa, 3 kPa], "
                           "nu: [0.35, 0.2, 0.4]}, along: [1, 0, 0], across: [0, 0, 2], rho: 1 g/cm3}\n";

static void constants_are_read_and_printed_back_to_the_bit(void **state)
{
    (void)state;
    struct scene s, again;
    struct failure why;
    assert_int_equal(parse(text, "s.yaml", &s, &why), STATUS_OK);
    assert_int_equal(s.material_count, 2);
    const struct scene_material *m = s.material;
    assert_int_equal(m[0].symmetry, SYMMETRY_TRANSVERSE);
    assert_true(m[0].along[0] == 0.6 && m[0].along[1] == 0 && m[0].along[2] == 0.8);
    const struct scene_orthotropic *o = &m[0].orthotropic;
    assert_true(o->E_Pa[0] == 30e3 && o->E_Pa[1] == 10e3 && o->E_Pa[2] == 10e3);
    assert_true(o->nu[0] == 0.4 && o->nu[1] == 0.4 && o->nu[2] == 0.6);
    assert_true(o->G_Pa[0] == 4e3 && o->G_Pa[1] == 4e3 && o->G_Pa[2] == 10e3 / 3.2);
    assert_int_equal(m[1].symmetry, SYMMETRY_ORTHOTROPIC);
    o = &m[1].orthotropic;
    assert_true(o->E_Pa[0] == 30e3 && o->E_Pa[1] == 12e3 && o->E_Pa[2] == 8e3);
    assert_true(o->G_Pa[0] == 5e3 && o->G_Pa[1] == 4e3 && o->G_Pa[2] == 3e3);
    assert_true(o->nu[0] == 0.35 && o->nu[1] == 0.2 && o->nu[2] == 0.4);
    assert_true(m[1].across[2] == 1);
    assert_int_equal(material_check(&s, &why), STATUS_OK);
    char *printed = scene_print(&s);
    assert_non_null(printed);
    assert_int_equal(parse(printed, "s.yaml", &again, &why), STATUS_OK);
    same_scene(&s, &again);
    free(printed);
}

static const struct {
    const char *from, *to;
    enum status status;
    long line;
    const char *says;
} faults[] = {
    {"E_T: 10 kPa, ", "", STATUS_SCENE_MISSING, 5, "'E_T'"},
    {"E_T: 10 kPa", "E_T: 10", STATUS_SCENE_UNIT, 5, "a pressure"},
    {"E_T: 10 kPa", "E_T: 0 Pa", STATUS_SCENE_VALUE, 5, "E_T = 0 Pa"},
    {"E_T:", "E_Q:", STATUS_SCENE_KEY, 5, "unknown key 'E_Q' in transverse"},
    {", along: [3, 0, 4]", "", STATUS_SCENE_MISSING, 5, "'along'"},
    {"[3, 0, 4]", "[0, 0, 0]", STATUS_SCENE_VALUE, 5, "no direction"},
    {"along: [3, 0, 4]", "along: [3, 0, 4], across: [0, 1, 0]", STATUS_SCENE_KEY, 5, "orthotropic"},
    {"transverse: {", "E: 4 kPa, transverse: {", STATUS_SCENE_VALUE, 5, "two laws"},
    {"nu_TT: 0.6", "nu_TT: -1", STATUS_SCENE_VALUE, 5, "nu_TT = -1"},
    {", across: [0, 0, 2]", "", STATUS_SCENE_MISSING, 6, "'across'"},
    {"across: [0, 0, 2]", "across: [1, 0, 2]", STATUS_SCENE_VALUE, 6, "63.4 degrees apart"},
    {"G: [5 kPa, 4 kPa, 3 kPa]", "G: [5 kPa, 4 kPa]", STATUS_SCENE_VALUE, 6, "2 components"},
    {"8000 Pa", "-8000 Pa", STATUS_SCENE_VALUE, 6, "-8000 Pa"},
    {"8000 Pa", "8000", STATUS_SCENE_UNIT, 6, "a pressure"},
    {"transverse: {E_L: 30 kPa, E_T: 10 kPa, G_LT: 4 kPa, nu_LT: 0.4, nu_TT: 0.6}", "E: 4 kPa, nu: 0.3",
     STATUS_SCENE_KEY, 5, "along belongs to materials with directions"},
    /* not positive definite: found by material_check, each by its own condition */
    {"nu_LT: 0.4", "nu_LT: 1.8", STATUS_MODEL_MATERIAL, 5, "nu_LT = 1.8 must stay within sqrt(E_L/E_T) = 1.73205"},
    {"nu_LT: 0.4", "nu_LT: 0.8", STATUS_MODEL_MATERIAL, 5, "1 - nu_TT - 2 nu_LT^2 E_T/E_L = -0.0266667"},
    {"nu: [0.35,", "nu: [1.6,", STATUS_MODEL_MATERIAL, 6, "nu_12 = 1.6 must stay within sqrt(E_1/E_2) = 1.58114"},
    {"0.2, 0.4]", "2, 0.4]", STATUS_MODEL_MATERIAL, 6, "nu_13 = 2 must stay within sqrt(E_1/E_3) = 1.93649"},
    {"0.2, 0.4]", "0.2, -1.3]", STATUS_MODEL_MATERIAL, 6, "nu_23 = -1.3 must stay within sqrt(E_2/E_3) = 1.22474"},
    {"0.2, 0.4]", "1.5, 1]", STATUS_MODEL_MATERIAL, 6, "2 nu_21 nu_32 nu_13 = -0.59"},
};

static void every_fault_is_one_line_with_its_place(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof faults / sizeof faults[0]; k++) {
        struct scene s;
        struct failure why;
        char *bad = changed(text, faults[k].from, faults[k].to), place[40];
        int status = parse(bad, "s.yaml", &s, &why);
        if (status == STATUS_OK)
            status = material_check(&s, &why);
        print_message("# %s at %s: %s; %s\n", status_name(status), why.place, why.cause, why.remedy);
        assert_int_equal(status, faults[k].status);
        snprintf(place, sizeof place, "s.yaml:%ld", faults[k].line);
        assert_string_equal(why.place, place);
        if (!strstr(why.cause, faults[k].says))
            fail_msg("'%s' is not in '%s'", faults[k].says, why.cause);
        free(bad);
    }
}

/* Positive definite exactly when the conditions hold: against the smallest principal minor of random compliances. */
static double minor_sign(const struct scene_orthotropic *o)
{
    double a = 1 / o->E_Pa[0], b = 1 / o->E_Pa[1], c = 1 / o->E_Pa[2];
    double p = -o->nu[0] * a, q = -o->nu[1] * a, r = -o->nu[2] * b;
    double det = a * (b * c - r * r) - p * (p * c - r * q) + q * (p * r - b * q);
    return fmin(fmin(a * b - p * p, det), fmin(a * c - q * q, b * c - r * r));
}

static void conditions_are_those_of_a_positive_definite_compliance(void **state)
{
    (void)state;
    struct scene s;
    struct failure why;
    uint64_t seed = 42;
    int good = 0, bad = 0;
    print_message("# seed %llu\n", (unsigned long long)seed);
    assert_int_equal(parse(text, "s.yaml", &s, &why), STATUS_OK);
    for (int trial = 0; trial < 2000; trial++) {
        struct scene_orthotropic *o = &s.material[1].orthotropic;
        for (int k = 0; k < 3; k++) {
            seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
            o->E_Pa[k] = 1e3 * exp(3 * (double)(seed >> 40) / 16777216);
            seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
            o->nu[k] = 3 * (double)(seed >> 40) / 16777216 - 1.5;
        }
        bool stable = minor_sign(o) > 0;
        assert_int_equal(material_check(&s, &why) == STATUS_OK, stable);
        good += stable;
        bad += !stable;
    }
    print_message("# %d stable, %d refused\n", good, bad);
    assert_true(good > 200 && bad > 200);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(constants_are_read_and_printed_back_to_the_bit),
        cmocka_unit_test(every_fault_is_one_line_with_its_place),
        cmocka_unit_test(conditions_are_those_of_a_positive_definite_compliance),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
