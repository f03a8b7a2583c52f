#include <math.h>

#include "bank_fixture.h"
#include "bank_view.h"
#include "device.h"
#include "kinematics.h"
#include "random.h"
#include "scene_fixture.h"

static struct scene_instrument placed(const double at[3], const double axis[3])
{
    struct scene_instrument s;
    scene_assume_instrument(&s);
    s.placed = true;
    for (int i = 0; i < 3; i++) {
        s.trocar_m[i] = at[i];
        s.axis[i] = axis[i];
    }
    return s;
}

static void random_axis(double axis[3])
{
    double length;
    do {
        for (int i = 0; i < 3; i++)
            axis[i] = random_range(-1, 1);
        length = hypot(hypot(axis[0], axis[1]), axis[2]);
    } while (length < 0.1 || length > 1);
    for (int i = 0; i < 3; i++)
        axis[i] /= length;
}

static void every_tool_passes_the_rules_of_a_bank(void **state)
{
    (void)state;
    random_seed("tools", 22);
    size_t length;
    unsigned char *bytes = bank_fixture(NULL, &length);
    const struct bank_section *tool_section = bank_fixture_section(bytes, BANK_TOOL),
                              *contact_section = bank_fixture_section(bytes, BANK_CONT);
    for (unsigned k = 0; k < 200; k++) {
        double axis[3] = {0, 0, 0}, at[3];
        if (k < 6)
            axis[k / 2] = k % 2 ? 1 : -1;
        else
            random_axis(axis);
        for (int i = 0; i < 3; i++)
            at[i] = random_range(-1, 1);
        struct scene scene;
        scene_assume("a.msh", 1, MESH_UNIT_NONE, &scene);
        scene.instrument[0] = placed(at, axis);
        scene.instrument[0].tip_points = 1 + k % BANK_MAX_TOOL_POINTS;
        struct bank_tool tool;
        struct bank_contact contact;
        struct failure why;
        assert_int_equal(scene_tool(&scene.instrument[0], &tool, &why), STATUS_OK);
        scene_contact(&scene, pow(10, random_range(-6, 0)), &contact);
        memcpy(bytes + tool_section->offset, &tool, sizeof tool);
        memcpy(bytes + contact_section->offset, &contact, sizeof contact);
        bank_fixture_seal(bytes, length);
        struct bank_view view;
        assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
    }
    free(bytes);
}

/* Counts in, world position out, through the firmware's own kinematics: mid counts lie on the axis. */
static void mid_counts_put_the_tip_on_the_axis(void **state)
{
    (void)state;
    random_seed("axes", 23);
    for (int k = 0; k < 50; k++) {
        double axis[3], at[3] = {0.3, -0.2, 0.1};
        random_axis(axis);
        struct scene_instrument s = placed(at, axis);
        struct bank_tool tool;
        struct failure why;
        assert_int_equal(scene_tool(&s, &tool, &why), STATUS_OK);
        struct kinematics pose = {0};
        const uint16_t counts[3] = {8192, 8192, 8192};
        assert_true(kinematics_update(&pose, &tool, counts, 1));
        for (int i = 0; i < 3; i++) /* 0.165 m: the middle of 0.10..0.23 m; a few roundings of a float below 1 m */
            assert_true(fabs((double)pose.tip_m[i] - (at[i] + 0.165 * axis[i])) < 4e-7);
        const double F[3] = {random_range(-1, 1), random_range(-1, 1), random_range(-1, 1)};
        const float force[3] = {(float)F[0], (float)F[1], (float)F[2]};
        float effort[3];
        kinematics_efforts(&pose, &tool, force, effort);
        assert_true(fabs((double)effort[2] - (F[0] * axis[0] + F[1] * axis[1] + F[2] * axis[2])) < 1e-6);
    }
}

static void the_documented_frame_of_an_instrument_from_above(void **state)
{
    (void)state;
    const double at[3] = {0, 0, 0.2}, down[3] = {0, 0, -1};
    struct scene_instrument s = placed(at, down);
    struct bank_tool tool;
    struct failure why;
    assert_int_equal(scene_tool(&s, &tool, &why), STATUS_OK);
    const float rotation[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1}; /* X = x, Y = -y, Z = -z */
    for (int k = 0; k < 9; k++)
        assert_true(tool.rotation[k] == rotation[k]);
    for (int i = 0; i < 3; i++)
        assert_true(tool.gravity_direction[i] == (float)down[i]);
}

/* Point 0 is the tip; the others lie on the sphere through it; none is above its equator; all are distinct. */
static void points_sample_the_cap_of_the_tip(void **state)
{
    (void)state;
    const double at[3] = {0}, axis[3] = {0, 0, 1};
    for (unsigned n = 1; n <= BANK_MAX_TOOL_POINTS; n++) {
        struct scene_instrument s = placed(at, axis);
        s.tip_points = n;
        struct bank_tool tool;
        struct failure why;
        assert_int_equal(scene_tool(&s, &tool, &why), STATUS_OK);
        assert_int_equal(tool.point_count, n);
        double nearest = INFINITY;
        for (unsigned p = 0; p < n; p++) {
            const float *x = tool.point_m[p];
            double from_centre = hypot(hypot((double)x[0], (double)x[1]), (double)x[2] + 0.005);
            assert_true(fabs(from_centre - 0.005) < 1e-8); /* rounding of floats of 5 mm */
            assert_true(x[2] <= 0 && x[2] >= -0.005f);
            for (unsigned q = 0; q < p; q++)
                nearest =
                    fmin(nearest, hypot(hypot((double)(x[0] - tool.point_m[q][0]), (double)(x[1] - tool.point_m[q][1])),
                                        (double)(x[2] - tool.point_m[q][2])));
        }
        for (unsigned p = n; p < BANK_MAX_TOOL_POINTS; p++)
            assert_true(tool.point_m[p][0] == 0 && tool.point_m[p][1] == 0 && tool.point_m[p][2] == 0);
        assert_true(tool.point_m[0][0] == 0 && tool.point_m[0][1] == 0 && tool.point_m[0][2] == 0);
        assert_true(n == 1 || nearest > 0.001); /* nearer points would be merged */
    }
}

/* theory.md 11: b > K T/2 + B and K <= 2 f_c / D on each axis, at the largest insertion. */
static void the_default_coupling_is_passive_on_every_axis(void **state)
{
    (void)state;
    const struct device_model *device = device_model_find("impulse-engine");
    for (double length = 0.11; length <= 0.23; length += 0.01) {
        struct scene_instrument s;
        scene_assume_instrument(&s);
        s.length_max_m = length;
        struct scene_coupling c;
        scene_coupling(&s, device, &c);
        assert_true(c.stiffness_N_m > 0 && c.damping_Ns_m > 0);
        for (int i = 0; i < 3; i++) {
            double arm = i < 2 ? length : 1, b = device->axis[i].viscous / (arm * arm);
            assert_true(b > c.stiffness_N_m * 1e-3 / 2 + c.damping_Ns_m);
            assert_true(c.stiffness_N_m <= 2 * device->axis[i].coulomb / (device->axis[i].per_count * arm * arm));
        }
    }
    struct scene_instrument s;
    struct scene_coupling c;
    scene_assume_instrument(&s);
    scene_coupling(&s, device, &c); /* the figures of scene.h */
    assert_true(fabs(c.stiffness_N_m - 1200) < 1e-9 && fabs(c.damping_Ns_m - 0.3) < 1e-12);
}

static void contact_takes_the_scene_and_the_weaker_instrument(void **state)
{
    (void)state;
    struct scene scene;
    struct failure why;
    struct bank_contact c;
    assert_int_equal(parse(scene_full, "", &scene, &why), STATUS_OK);
    scene_contact(&scene, 0.01, &c);
    assert_true(c.regularisation_m_N == (float)(0.002 * 0.01) && c.typical_compliance_m_N == 0.01f);
    assert_true(c.coupling_stiffness_N_m == 800 && c.coupling_damping_Ns_m == 0.2f); /* left: 1200 N/m, 0.3 N s/m */
    assert_true(c.force_limit_N == 5 && c.force_rate_N_s == 1000 && c.decay_s == 0.02f);
    scene_assume("a.msh", 1, MESH_UNIT_NONE, &scene);
    scene_contact(&scene, 0.02, &c);
    assert_true(c.regularisation_m_N == (float)(1e-3 * 0.02) && c.force_limit_N == 8.9f);
}

static void a_tool_without_place_or_device_is_refused(void **state)
{
    (void)state;
    struct scene_instrument s;
    struct bank_tool tool;
    struct failure why;
    scene_assume_instrument(&s);
    assert_int_equal(scene_tool(&s, &tool, &why), STATUS_SCENE_MISSING);
    s.placed = true;
    strcpy(s.device, "omni");
    assert_int_equal(scene_tool(&s, &tool, &why), STATUS_SCENE_VALUE);
    assert_non_null(strstr(why.cause, "impulse-engine"));
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_tool_passes_the_rules_of_a_bank),
        cmocka_unit_test(mid_counts_put_the_tip_on_the_axis),
        cmocka_unit_test(the_documented_frame_of_an_instrument_from_above),
        cmocka_unit_test(points_sample_the_cap_of_the_tip),
        cmocka_unit_test(the_default_coupling_is_passive_on_every_axis),
        cmocka_unit_test(contact_takes_the_scene_and_the_weaker_instrument),
        cmocka_unit_test(a_tool_without_place_or_device_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
