#include "device.h"

#include <math.h>
#include <string.h>

#include "hand.h"

static double clamp(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}

/* Tip and Jacobian columns in the trocar's frame. The root is kept away from 0: a joint range of +-45 degrees on both
 * axes would reach it, and no instrument does. */
static void pose(const double joint[3], double tip[3], double J[3][3])
{
    double sa = sin(joint[0]), sb = sin(joint[1]), ca = cos(joint[0]), cb = cos(joint[1]), L = joint[2];
    double c = sqrt(fmax(1 - sa * sa - sb * sb, 1e-6));
    tip[0] = L * sa;
    tip[1] = L * sb;
    tip[2] = L * c;
    const double columns[3][3] = {{L * ca, 0, -L * sa * ca / c}, {0, L * cb, -L * sb * cb / c}, {sa, sb, c}};
    memcpy(J, columns, sizeof columns);
}

void device_tip(const struct device *device, double tip_m[3])
{
    double J[3][3];
    pose(device->joint, tip_m, J);
}

void device_velocity(const struct device *device, double velocity_m_s[3])
{
    double tip[3], J[3][3];
    pose(device->joint, tip, J);
    for (int i = 0; i < 3; i++)
        velocity_m_s[i] = J[0][i] * device->speed[0] + J[1][i] * device->speed[1] + J[2][i] * device->speed[2];
}

double device_kinetic_J(const struct device *device)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += 0.5 * device->model->axis[k].inertia * device->speed[k] * device->speed[k];
    return sum;
}

void device_start(struct device *device, const struct device_model *model, const struct hand *hand)
{
    *device = (struct device){.model = model, .gravity_direction = {0, 0, 1}, .silence_us = DEVICE_SILENCE_US};
    const double *tip = hand->start;
    double L = sqrt(tip[0] * tip[0] + tip[1] * tip[1] + tip[2] * tip[2]);
    double joint[3] = {0, 0, L};
    if (L > 0) {
        joint[0] = asin(clamp(tip[0] / L, -1, 1));
        joint[1] = asin(clamp(tip[1] / L, -1, 1));
    }
    for (int k = 0; k < 3; k++)
        device->joint[k] = clamp(joint[k], model->axis[k].minimum, model->axis[k].maximum);
}

void device_command(struct device *device, const double effort[3], bool enable)
{
    for (int k = 0; k < 3; k++) {
        double limit = device->model->axis[k].effort_limit;
        device->command[k] = enable && isfinite(effort[k]) ? clamp(effort[k], -limit, limit) : 0;
    }
    device->enabled = enable;
    device->silence_us = 0;
}

/* The motor hangs `arm` behind the trocar on the axis s: potential W arm g.s, effort -W arm g.ds/dq. Its distance does
 * not change with the insertion [C97 7.2], so it loads alpha and beta only. */
static void gravity(const struct device *device, double L, double J[3][3], double effort[3])
{
    double moment = device->model->gravity_N * device->model->gravity_arm_m / L;
    const double *g = device->gravity_direction;
    for (int k = 0; k < 2; k++)
        effort[k] -= moment * (g[0] * J[k][0] + g[1] * J[k][1] + g[2] * J[k][2]);
}

static void hand_force(struct device *device, const struct hand *hand, double time_s, double h, const double tip[3])
{
    double target[3], next[3], velocity[3];
    hand_target(hand, time_s, target);
    hand_target(hand, time_s + h, next);
    device_velocity(device, velocity);
    device->grip = hand_grip(hand, time_s);
    for (int i = 0; i < 3; i++)
        device->hand_force_N[i] =
            hand->stiffness_N_m * (target[i] - tip[i]) + hand->damping_Ns_m * ((next[i] - target[i]) / h - velocity[i]);
}

/* One axis over h under `effort`: (m/h + b) v1 + f_c sign(v1) contains m/h v0 + effort. */
static void move_axis(const struct device_axis_model *axis, double effort, double h, double *joint, double *speed)
{
    double drive = axis->inertia / h * *speed + effort;
    double left = fabs(drive) - axis->coulomb;
    double v = left > 0 ? copysign(left, drive) / (axis->inertia / h + axis->viscous) : 0;
    double q = *joint + h * v;
    if (q < axis->minimum || q > axis->maximum) { /* an inelastic stop */
        q = clamp(q, axis->minimum, axis->maximum);
        v = 0;
    }
    *joint = q;
    *speed = v;
}

void device_step(struct device *device, const struct hand *hand, double time_s, uint32_t duration_us)
{
    const struct device_model *model = device->model;
    const double h = 1e-6 * DEVICE_SUBSTEP_US;
    double follow[3]; /* first-order lag, exact for a command held over the substep */
    for (int k = 0; k < 3; k++)
        follow[k] = -expm1(-2 * M_PI * model->axis[k].bandwidth_Hz * h);
    for (uint32_t t = 0; t < duration_us; t += DEVICE_SUBSTEP_US) {
        if (device->silence_us < DEVICE_SILENCE_US) {
            device->silence_us += DEVICE_SUBSTEP_US;
            if (device->silence_us >= DEVICE_SILENCE_US) {
                device->silences += device->enabled;
                device->enabled = false;
                memset(device->command, 0, sizeof device->command);
            }
        }
        double tip[3], J[3][3], effort[3];
        pose(device->joint, tip, J);
        memset(device->hand_force_N, 0, sizeof device->hand_force_N);
        if (hand)
            hand_force(device, hand, time_s + 1e-6 * t, h, tip);
        const double *F = device->hand_force_N;
        for (int k = 0; k < 3; k++) {
            device->effort[k] += follow[k] * (device->command[k] - device->effort[k]);
            effort[k] = device->effort[k] + J[k][0] * F[0] + J[k][1] * F[1] + J[k][2] * F[2];
        }
        gravity(device, device->joint[2], J, effort);
        for (int k = 0; k < 3; k++)
            move_axis(&model->axis[k], effort[k], h, &device->joint[k], &device->speed[k]);
    }
}

void device_counts(const struct device *device, uint16_t counts[3])
{
    for (int k = 0; k < 3; k++) {
        const struct device_axis_model *axis = &device->model->axis[k];
        long modulus = axis->count_modulus;
        long count = axis->count_zero + lround((device->joint[k] - axis->zero) / axis->per_count);
        counts[k] = (uint16_t)(((count % modulus) + modulus) % modulus);
    }
}
