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
    bool started;         /* counts were seen: wrap can be followed */
    uint16_t counts[3];   /* last raw counts that were accepted */
    int32_t turns[3];     /* counts relative to count_zero, wrap undone */
    float joint[3];       /* alpha, beta (rad), insertion (m) */
    float joint_speed[3]; /* rad/s, m/s: first difference, low pass at 80 Hz */
    float sin_a, sin_b, cos_a, cos_b, c;
    float tip_m[3];        /* world */
    float velocity_m_s[3]; /* of the tip, world, from joint_speed */
    float frame[9]; /* row-major; columns: the instrument's X, Y, Z (Z along the shaft), world. Roll is not applied. */
};

/* Follow the encoders by one sample, `elapsed_ticks` after the last accepted one. False when the sample is not plausible:
 * beyond the joint's range by more than 5 % of it, or faster than its speed limit; the state is then kept. */
bool kinematics_update(struct kinematics *k, const struct bank_tool *tool, const uint16_t counts[3],
                       uint32_t elapsed_ticks);

/* World position of a point given in the instrument's frame (origin at the tip's centre, Z along the shaft). */
void kinematics_point(const struct kinematics *k, const float offset_m[3], float out_m[3]);

/* Joint efforts (N m, N m, N) equal in virtual work to `force_N` (world) acting on the tip: Jt F. */
void kinematics_efforts(const struct kinematics *k, const struct bank_tool *tool, const float force_N[3],
                        float effort[3]);

/* The force on the tip that does the same virtual work as `force_N` on a point of the instrument (both in the world), roll held still.
 * With the shaft's unit vector z, r = point - tip, s = L + r . z, rho = r - (r . z) z and the frame's Y axis y:
 *
 *   F = f_z z + [s f - rho f_z - tan(alpha) (f . z x rho) y] / L,   the bracket without its part along z
 *
 * The first term of the bracket is the lever, the second the moment of a force along the shaft that acts beside it, the third
 * that the frame turns about the shaft as alpha and beta change (by -tan(alpha) y . dz). An insertion below
 * KINEMATICS_SHORTEST_m counts as that: nearer to the trocar no tip force has such a moment. */
#define KINEMATICS_SHORTEST_m 1e-3f
void kinematics_pull(const struct kinematics *k, const float point_m[3], const float force_N[3], float tip_force_N[3]);

/* Efforts that hold the weight of the motor carried on the axis, at gravity_arm_m behind the trocar [C97 7.2]: the
 * negative of what gravity does to the joints. */
void kinematics_gravity(const struct kinematics *k, const struct bank_tool *tool, float effort[3]);

#endif
