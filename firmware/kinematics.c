#include "kinematics.h"

#include "real.h"

#define TICK_S 0.001f
/* First-order low pass of the speed at 80 Hz: dt / (dt + 1/(2 pi 80)). A hand moves below 10 Hz; encoder steps do not. */
#define SPEED_BLEND 0.3345f

/* Count difference with the wrap undone: the shorter way round. */
static int32_t wrapped_difference(uint16_t now, uint16_t before, uint16_t modulus)
{
    int32_t difference = (int32_t)now - (int32_t)before;
    int32_t half = modulus / 2;
    if (difference > half)
        difference -= modulus;
    else if (difference < -half)
        difference += modulus;
    return difference;
}

static void world_from_trocar(const struct bank_tool *tool, const float v[3], float out[3])
{
    for (int i = 0; i < 3; i++) /* bound: 3 */
        out[i] = real_dot(&tool->rotation[3 * i], v);
}

static void trocar_from_world(const struct bank_tool *tool, const float v[3], float out[3])
{
    for (int i = 0; i < 3; i++) /* bound: 3 */
        out[i] = tool->rotation[i] * v[0] + tool->rotation[3 + i] * v[1] + tool->rotation[6 + i] * v[2];
}

/* Columns of the Jacobian d tip / d joint in the trocar's frame, transposed onto a force: Jt F [C97 7.5.3]. */
static void transposed_jacobian(const struct kinematics *k, const float f[3], float effort[3])
{
    float L = k->joint[2], z = f[2] / k->c;
    effort[0] = L * k->cos_a * (f[0] - k->sin_a * z);
    effort[1] = L * k->cos_b * (f[1] - k->sin_b * z);
    effort[2] = k->sin_a * f[0] + k->sin_b * f[1] + k->c * f[2];
}

static void pose(struct kinematics *k, const struct bank_tool *tool)
{
    k->sin_a = real_sin(k->joint[0]);
    k->cos_a = real_cos(k->joint[0]);
    k->sin_b = real_sin(k->joint[1]);
    k->cos_b = real_cos(k->joint[1]);
    float rest = 1.0f - k->sin_a * k->sin_a - k->sin_b * k->sin_b;
    k->c = real_sqrt(rest < 0.01f ? 0.01f : rest); /* within +-30 degrees the root is at least sqrt(1/2) */

    float L = k->joint[2];
    float shaft[3] = {k->sin_a, k->sin_b, k->c};
    float tip[3] = {L * shaft[0], L * shaft[1], L * shaft[2]};
    float world[3];
    world_from_trocar(tool, tip, world);
    for (int i = 0; i < 3; i++) /* bound: 3 */
        k->tip_m[i] = tool->trocar_m[i] + world[i];

    const float *w = k->joint_speed;
    float a_rate = L * k->cos_a * w[0], b_rate = L * k->cos_b * w[1];
    float velocity[3] = {a_rate + shaft[0] * w[2], b_rate + shaft[1] * w[2],
                         -(k->sin_a * a_rate + k->sin_b * b_rate) / k->c + shaft[2] * w[2]};
    world_from_trocar(tool, velocity, k->velocity_m_s);

    /* Instrument's frame: X is the trocar's X made orthogonal to the shaft, Y = Z x X. */
    float x_length = real_sqrt(1.0f - k->sin_a * k->sin_a);
    float x[3] = {x_length, -k->sin_a * shaft[1] / x_length, -k->sin_a * shaft[2] / x_length};
    float y[3];
    real_cross(shaft, x, y);
    const float *column[3] = {x, y, shaft};
    for (int j = 0; j < 3; j++) { /* bound: 3 */
        float axis[3];
        world_from_trocar(tool, column[j], axis);
        for (int i = 0; i < 3; i++) /* bound: 3 */
            k->frame[3 * i + j] = axis[i];
    }
}

bool kinematics_update(struct kinematics *k, const struct bank_tool *tool, const uint16_t counts[3],
                       uint32_t elapsed_ticks)
{
    int32_t turns[3];
    float joint[3], speed[3], dt = TICK_S * (float)elapsed_ticks;
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        const struct bank_axis *axis = &tool->axis[i];
        if (counts[i] >= axis->count_modulus)
            return false;
        uint16_t before = k->started ? k->counts[i] : axis->count_zero;
        int32_t step = wrapped_difference(counts[i], before, axis->count_modulus);
        turns[i] = (k->started ? k->turns[i] : 0) + step;
        joint[i] = axis->zero + axis->per_count * (float)turns[i];
        float slack = 0.05f * (axis->maximum - axis->minimum);
        if (joint[i] < axis->minimum - slack || joint[i] > axis->maximum + slack)
            return false;
        speed[i] = 0.0f;
        if (k->started) {
            float moved = joint[i] - k->joint[i];
            float resolution = axis->per_count < 0.0f ? -axis->per_count : axis->per_count;
            float most = axis->speed_limit * dt + 2.0f * resolution;
            if (moved > most || moved < -most)
                return false;
            speed[i] = k->joint_speed[i] + SPEED_BLEND * (moved / dt - k->joint_speed[i]);
        }
    }
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        k->counts[i] = counts[i];
        k->turns[i] = turns[i];
        k->joint[i] = joint[i];
        k->joint_speed[i] = speed[i];
    }
    k->started = true;
    pose(k, tool);
    return true;
}

void kinematics_point(const struct kinematics *k, const float offset_m[3], float out_m[3])
{
    for (int i = 0; i < 3; i++) /* bound: 3 */
        out_m[i] = k->tip_m[i] + real_dot(&k->frame[3 * i], offset_m);
}

void kinematics_efforts(const struct kinematics *k, const struct bank_tool *tool, const float force_N[3],
                        float effort[3])
{
    float f[3];
    trocar_from_world(tool, force_N, f);
    transposed_jacobian(k, f, effort);
}

void kinematics_pull(const struct kinematics *k, const float point_m[3], const float force_N[3], float tip_force_N[3])
{
    float r[3], y[3], z[3], beside[3], turning[3];
    real_subtract(point_m, k->tip_m, r);
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        y[i] = k->frame[3 * i + 1];
        z[i] = k->frame[3 * i + 2];
    }
    float behind = real_dot(r, z), along = real_dot(force_N, z), L = k->joint[2];
    for (int i = 0; i < 3; i++) /* bound: 3 */
        beside[i] = r[i] - behind * z[i];
    real_cross(z, beside, turning);
    float s = L + behind, twist = real_dot(force_N, turning) * k->sin_a / k->cos_a;
    float share = 1.0f / (L < KINEMATICS_SHORTEST_m ? KINEMATICS_SHORTEST_m : L);
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        float moment = s * (force_N[i] - along * z[i]) - along * beside[i] - twist * y[i];
        tip_force_N[i] = along * z[i] + share * moment;
    }
}

void kinematics_gravity(const struct kinematics *k, const struct bank_tool *tool, float effort[3])
{
    /* The motor sits at -r s, s the shaft's unit vector; ds/d alpha = cos a (1, 0, -sin a / c), likewise beta. */
    float g[3];
    trocar_from_world(tool, tool->gravity_direction, g);
    float torque_Nm = tool->gravity_arm_m * tool->gravity_N, z = g[2] / k->c;
    effort[0] = torque_Nm * k->cos_a * (g[0] - k->sin_a * z);
    effort[1] = torque_Nm * k->cos_b * (g[1] - k->sin_b * z);
    effort[2] = 0.0f;
}
