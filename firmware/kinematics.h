/* From encoder counts to the tool's pose: joint angles, a tip on a spherical cap around the trocar [C97 7.5.3, with Z
 * corrected], and the Jacobian that turns a tip force into joint efforts by virtual work.
 *
 *   a = alpha, b = beta (rad, about the frame's zero), L = insertion (m), c = sqrt(1 - sin^2 a - sin^2 b)
 *   tip in the trocar's frame: (L sin a, L sin b, L c) */
#ifndef TROCAR_KINEMATICS_H
#define TROCAR_KINEMATICS_H

#include <stdbool.h>
#include <stdint.h>

#include "bank_format.h"

struct kinematics {
    bool started;        /* counts were seen: wrap can be followed */
    uint16_t counts[3];  /* last raw counts */
    int32_t turns[3];    /* unwrapped counts relative to count_zero */
    float joint[3];      /* alpha, beta (rad), insertion (m) */
    float joint_speed[3]; /* rad/s, m/s: first difference, filtered at 80 Hz */
    float sin_a, sin_b, cos_a, cos_b, c;
    float tip_m[3];      /* world */
    float velocity_m_s[3]; /* world, of the tip, from joint_speed */
    float shaft[3];      /* unit vector along the instrument, world */
};

/* Follow the encoders by one sample. False when the sample is not plausible (out of range, too fast): the state is kept. */
bool kinematics_update(struct kinematics *k, const struct bank_tool *tool, const uint16_t counts[3]);

/* World position of a point given in the instrument's frame (Z along the shaft). */
void kinematics_point(const struct kinematics *k, const struct bank_tool *tool, const float offset_m[3], float out_m[3]);

/* Joint efforts (N m, N m, N) equal in virtual work to `force_N` (world) acting on the tip: Jt F. */
void kinematics_efforts(const struct kinematics *k, const struct bank_tool *tool, const float force_N[3],
                        float effort[3]);

/* Efforts that hold the weight of the motor carried on the axis [C97 7.2]. */
void kinematics_gravity(const struct kinematics *k, const struct bank_tool *tool, float effort[3]);

#endif
