/* Pose, Jacobian and gravity of the instrument against closed forms and central differences in double precision. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "bank_fixture.h"
#include "kinematics.h"
#include "random.h"

/* An instrument in general position: a rotated frame, so that a swapped row shows. */
static struct bank_tool instrument(void)
{
    struct bank_tool t = fixture_tool(&bank_fixture_default, 0);
    const float turned[9] = {0.36f, 0.48f, -0.8f, -0.8f, 0.6f, 0, 0.48f, 0.64f, 0.6f};
    memcpy(t.rotation, turned, sizeof turned);
    const float place[3] = {0.01f, -0.02f, 0.03f}, down[3] = {0, 0.6f, -0.8f};
    memcpy(t.trocar_m, place, sizeof place);
    memcpy(t.gravity_direction, down, sizeof down);
    return t;
}

static void position(const struct bank_tool *t, const double q[3], double reach, double out[3])
{
    double sa = sin(q[0]), sb = sin(q[1]);
    double v[3] = {reach * sa, reach * sb, reach * sqrt(1 - sa * sa - sb * sb)};
    for (int i = 0; i < 3; i++)
        out[i] =
            t->trocar_m[i] + t->rotation[3 * i] * v[0] + t->rotation[3 * i + 1] * v[1] + t->rotation[3 * i + 2] * v[2];
}

static void random_counts(const struct bank_tool *t, uint16_t counts[3])
{
    for (int i = 0; i < 3; i++) {
        double joint = random_range(t->axis[i].minimum, t->axis[i].maximum);
        counts[i] = (uint16_t)(t->axis[i].count_zero + lround((joint - t->axis[i].zero) / t->axis[i].per_count));
    }
}

static void joints(const struct kinematics *k, double q[3])
{
    for (int i = 0; i < 3; i++)
        q[i] = k->joint[i];
}

static void tip_lies_on_the_spherical_cap(void **state)
{
    (void)state;
    struct bank_tool t = instrument();
    random_seed("cap", 2);
    for (int n = 0; n < 20000; n++) {
        struct kinematics k = {.started = false};
        uint16_t counts[3];
        double q[3], want[3], radius = 0;
        random_counts(&t, counts);
        assert_true(kinematics_update(&k, &t, counts, 1));
        joints(&k, q);
        position(&t, q, q[2], want);
        for (int i = 0; i < 3; i++) {
            assert_true(fabs(k.tip_m[i] - want[i]) < 1e-7); /* 4 roundings of 0.25 m */
            radius += (k.tip_m[i] - t.trocar_m[i]) * (k.tip_m[i] - t.trocar_m[i]);
        }
        assert_true(fabs(sqrt(radius) - q[2]) < 1e-7);
    }
}

static void efforts_do_the_virtual_work_of_the_tip_force(void **state)
{
    (void)state;
    struct bank_tool t = instrument();
    random_seed("virtual work", 3);
    double worst = 0;
    for (int n = 0; n < 20000; n++) {
        struct kinematics k = {.started = false};
        uint16_t counts[3];
        double q[3];
        float force[3], effort[3];
        random_counts(&t, counts);
        assert_true(kinematics_update(&k, &t, counts, 1));
        joints(&k, q);
        for (int i = 0; i < 3; i++)
            force[i] = (float)random_range(-10, 10);
        kinematics_efforts(&k, &t, force, effort);
        for (int i = 0; i < 3; i++) {
            const double h = 1e-5; /* truncation h^2, rounding 1e-16 / h: both below 1e-9 */
            double up[3], down[3], qu[3], qd[3], work = 0;
            memcpy(qu, q, sizeof q);
            memcpy(qd, q, sizeof q);
            qu[i] += h, qd[i] -= h;
            position(&t, qu, qu[2], up);
            position(&t, qd, qd[2], down);
            for (int j = 0; j < 3; j++)
                work += force[j] * (up[j] - down[j]) / (2 * h);
            worst = fmax(worst, fabs(effort[i] - work));
        }
    }
    printf("# largest difference between Jt F and the differences of the pose: %.3g N m or N\n", worst);
    assert_true(worst < 1e-5); /* 17 N through about 8 single-precision roundings of 6e-8 */
}

/* The instrument's frame at these joints, in double precision: columns X, Y, Z. */
static void frame_at(const struct bank_tool *t, const double q[3], double column[3][3])
{
    double sa = sin(q[0]), sb = sin(q[1]), z[3] = {sa, sb, sqrt(1 - sa * sa - sb * sb)};
    double x[3] = {1 - sa * z[0], -sa * z[1], -sa * z[2]}, length = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    for (int i = 0; i < 3; i++)
        x[i] /= length;
    double y[3] = {z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]};
    const double *axis[3] = {x, y, z};
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++)
            column[j][i] = (double)t->rotation[3 * i] * axis[j][0] + (double)t->rotation[3 * i + 1] * axis[j][1] +
                           (double)t->rotation[3 * i + 2] * axis[j][2];
}

static void point_at(const struct bank_tool *t, const double q[3], const double offset[3], double out[3])
{
    double column[3][3];
    frame_at(t, q, column);
    for (int i = 0; i < 3; i++)
        out[i] = (double)t->trocar_m[i] + offset[0] * column[0][i] + offset[1] * column[1][i] +
                 (offset[2] + q[2]) * column[2][i];
}

/* A force on any point of the instrument, against the work that it does as the joints move the point. */
static void a_pull_does_the_virtual_work_of_a_force_beside_the_tip(void **state)
{
    (void)state;
    struct bank_tool t = instrument();
    random_seed("pull", 6);
    double worst = 0, apart = 0;
    for (int n = 0; n < 20000; n++) {
        struct kinematics k = {.started = false};
        uint16_t counts[3];
        double q[3], offset[3];
        float offset_m[3], point[3], force[3], pull[3], effort[3];
        random_counts(&t, counts);
        assert_true(kinematics_update(&k, &t, counts, 1));
        joints(&k, q);
        for (int i = 0; i < 3; i++) {
            force[i] = (float)random_range(-10, 10);
            offset_m[i] = (float)(i < 2 ? random_range(-0.02, 0.02) : random_range(-q[2], 0.02));
            offset[i] = (double)offset_m[i];
        }
        kinematics_point(&k, offset_m, point);
        kinematics_pull(&k, point, force, pull);
        kinematics_efforts(&k, &t, pull, effort);
        for (int i = 0; i < 3; i++) {
            const double h = 1e-5; /* truncation h^2, rounding 1e-16 / h: both below 1e-9 */
            double up[3], down[3], qu[3], qd[3], work = 0;
            memcpy(qu, q, sizeof q);
            memcpy(qd, q, sizeof q);
            qu[i] += h, qd[i] -= h;
            point_at(&t, qu, offset, up);
            point_at(&t, qd, offset, down);
            for (int j = 0; j < 3; j++)
                work += (double)force[j] * (up[j] - down[j]) / (2 * h);
            worst = fmax(worst, fabs((double)effort[i] - work));
            apart = fmax(apart, fabs((double)pull[i] - (double)force[i]));
        }
    }
    printf("# largest difference between Jt F and the differences of the point: %.3g N m or N\n", worst);
    /* 17 N at up to 0.27 m through about 12 single-precision roundings of 6e-8; the point's place is rounded to 1.5e-8 m */
    assert_true(worst < 1e-5);
    assert_true(apart > 5); /* the lever matters */

    /* at the tip itself nothing changes */
    struct kinematics k = {.started = false};
    uint16_t counts[3];
    const float force[3] = {1, -2, 3};
    float pull[3];
    random_counts(&t, counts);
    assert_true(kinematics_update(&k, &t, counts, 1));
    kinematics_pull(&k, k.tip_m, force, pull);
    for (int i = 0; i < 3; i++)
        assert_true(fabs((double)pull[i] - (double)force[i]) < 2e-6);
}

static void gravity_efforts_hold_the_motor(void **state)
{
    (void)state;
    struct bank_tool t = instrument();
    random_seed("gravity", 4);
    for (int n = 0; n < 2000; n++) {
        struct kinematics k = {.started = false};
        uint16_t counts[3];
        double q[3];
        float effort[3];
        random_counts(&t, counts);
        assert_true(kinematics_update(&k, &t, counts, 1));
        joints(&k, q);
        kinematics_gravity(&k, &t, effort);
        for (int i = 0; i < 3; i++) {
            const double h = 1e-5;
            double up[3], down[3], qu[3], qd[3], slope = 0;
            memcpy(qu, q, sizeof q);
            memcpy(qd, q, sizeof q);
            qu[i] += h, qd[i] -= h;
            position(&t, qu, -t.gravity_arm_m, up); /* the motor sits behind the trocar */
            position(&t, qd, -t.gravity_arm_m, down);
            for (int j = 0; j < 3; j++)
                slope += t.gravity_N * t.gravity_direction[j] * (up[j] - down[j]) / (2 * h);
            assert_true(fabs(effort[i] + slope) < 1e-6); /* effort + gravity's effort = 0 */
        }
    }
}

static void velocity_is_the_jacobian_times_joint_speed(void **state)
{
    (void)state;
    struct bank_tool t = instrument();
    random_seed("velocity", 5);
    for (int n = 0; n < 2000; n++) {
        struct kinematics k = {.started = false};
        uint16_t counts[3];
        double q[3], up[3], down[3];
        random_counts(&t, counts);
        assert_true(kinematics_update(&k, &t, counts, 1));
        counts[0] += 3, counts[1] -= 5, counts[2] += 11;
        for (int i = 0; i < 3; i++)
            counts[i] = counts[i] > 14000 ? 14000 : counts[i];
        if (!kinematics_update(&k, &t, counts, 1))
            continue;
        joints(&k, q);
        const double h = 1e-7;
        double qu[3], qd[3];
        for (int i = 0; i < 3; i++)
            qu[i] = q[i] + h * k.joint_speed[i], qd[i] = q[i] - h * k.joint_speed[i];
        position(&t, qu, qu[2], up);
        position(&t, qd, qd[2], down);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(k.velocity_m_s[i] - (up[i] - down[i]) / (2 * h)) < 2e-6);
    }
}

static void counts_wrap_without_a_jump(void **state)
{
    (void)state;
    struct bank_tool t = instrument();
    t.axis[2].count_modulus = 1000; /* the insertion turns its encoder several times */
    t.axis[2].count_zero = 10;
    struct kinematics k = {.started = false};
    uint16_t counts[3] = {t.axis[0].count_zero, t.axis[1].count_zero, 10};
    int32_t position_counts = 0;
    assert_true(kinematics_update(&k, &t, counts, 1));
    for (int n = 0; n < 3000; n++) {
        position_counts += 1;
        counts[2] = (uint16_t)((10 + position_counts) % 1000);
        assert_true(kinematics_update(&k, &t, counts, 1));
        assert_int_equal(k.turns[2], position_counts);
    }
    for (int n = 0; n < 5000; n++) {
        position_counts -= 1;
        counts[2] = (uint16_t)((10 + position_counts + 10000) % 1000);
        assert_true(kinematics_update(&k, &t, counts, 1));
        assert_int_equal(k.turns[2], position_counts);
    }
}

static void implausible_samples_are_refused_and_change_nothing(void **state)
{
    (void)state;
    struct bank_tool t = instrument();
    struct kinematics k = {.started = false}, before;
    uint16_t zero[3] = {8192, 8192, 8192}, bad[3];
    assert_true(kinematics_update(&k, &t, zero, 1));
    before = k;
    memcpy(bad, zero, sizeof bad);
    bad[0] = 8192 + 4800; /* 0.576 rad: beyond 0.5236 + 5 % of the range */
    assert_false(kinematics_update(&k, &t, bad, 1000));
    bad[0] = 8192 + 400; /* 48 rad/s in one tick, limit 30 */
    assert_false(kinematics_update(&k, &t, bad, 1));
    bad[0] = 16384; /* outside the encoder */
    assert_false(kinematics_update(&k, &t, bad, 1));
    assert_memory_equal(&k, &before, sizeof k);
    bad[0] = 8192 + 400; /* the same way in two ticks is 24 rad/s */
    assert_true(kinematics_update(&k, &t, bad, 2));
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tip_lies_on_the_spherical_cap),
        cmocka_unit_test(efforts_do_the_virtual_work_of_the_tip_force),
        cmocka_unit_test(a_pull_does_the_virtual_work_of_a_force_beside_the_tip),
        cmocka_unit_test(gravity_efforts_hold_the_motor),
        cmocka_unit_test(velocity_is_the_jacobian_times_joint_speed),
        cmocka_unit_test(counts_wrap_without_a_jump),
        cmocka_unit_test(implausible_samples_are_refused_and_change_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
