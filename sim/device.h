/* A simulated force-feedback instrument: three actuated axes (alpha, beta, insertion) through a trocar, each a moving mass
 * with viscous and Coulomb friction, a motor with saturation and first-order bandwidth, an encoder with finite resolution
 * and wrap, and stops at the ends of its range; roll and grip are read only. The hand (hand.h) pulls at the tip.
 *
 * Integrated in substeps of 50 us: per axis, implicit in viscous and Coulomb friction (backward Euler of the set-valued
 * law), so an axis on which less than its Coulomb friction acts stands exactly still instead of creeping. Angles as in
 * kinematics.h: tip = L (sin a, sin b, sqrt(1 - sin^2 a - sin^2 b)) in the trocar's frame, Z into the body.
 * Double precision and no state outside the struct: the same calls give the same bits. */
#ifndef TROCAR_DEVICE_H
#define TROCAR_DEVICE_H

#include <stdbool.h>
#include <stdint.h>

struct device_axis_model {
    double per_count; /* rad or m per encoder count */
    uint16_t count_zero, count_modulus;
    double zero, minimum, maximum; /* rad or m */
    double inertia;                /* kg m2 (alpha, beta: at the mid insertion) or kg */
    double viscous;                /* N m s or N s/m */
    double coulomb;                /* N m or N */
    double effort_limit;           /* N m or N: motor saturation */
    double bandwidth_Hz;           /* of the motor and its amplifier */
    double speed_limit;            /* rad/s or m/s the device can reach */
};

struct device_model {
    const char *name;
    struct device_axis_model axis[3];
    double gravity_N, gravity_arm_m; /* motor carried on the axis [C97 7.2]; weight along the trocar frame's +Z: the
                                        device stands upright */
    double force_limit_N;            /* largest tip force the maker states */
};

/* The catalogue (device_catalogue.c). "impulse-engine": the Laparoscopic Impulse Engine's figures [C97 7.5.3]. NULL for a name that is not known. */
const struct device_model *device_model_find(const char *name);
const char *device_model_names(void); /* comma-separated, for messages */

struct hand;

enum {
    DEVICE_GRIP_CLOSED = 63, /* count of the closed jaws; 0 open */
    DEVICE_SUBSTEP_US = 50,
    DEVICE_SILENCE_US = 10000 /* without a torque frame for so long, the device drops its motors by itself */
};

struct device {
    const struct device_model *model;
    double gravity_direction[3];  /* unit vector, trocar's frame; device_start sets Z (a vertical trocar) */
    double joint[3], speed[3];    /* true state: rad, rad, m */
    double effort[3], command[3]; /* motor efforts now; commanded */
    uint32_t samples;
    uint8_t sequence;
    bool enabled;
    uint32_t commands_received, commands_rejected; /* bad CRC or length */
    uint32_t silence_us;                           /* since the last torque frame, see DEVICE_SILENCE_US */
    uint32_t silences;                             /* times that it dropped its motors because of it */
    double grip;                                   /* of the jaws, 0 open .. 1 closed */
    double hand_force_N[3];                        /* of the hand on the tip, trocar's frame, for logs */
};

/* At rest with the tip at the hand's start. */
void device_start(struct device *device, const struct device_model *model, const struct hand *hand);
/* What the motors are told until further notice (N m, N m, N; saturated at effort_limit); not enabled: nothing. A call
 * counts as a sign of life. Efforts that are not finite are taken as 0. */
void device_command(struct device *device, const double effort[3], bool enable);
/* Advance by `duration_us` (a multiple of DEVICE_SUBSTEP_US) under motors, friction, gravity and the hand (NULL: nobody
 * holds it). `time_s` is the gesture's time at the start of the step. */
void device_step(struct device *device, const struct hand *hand, double time_s, uint32_t duration_us);
/* Encoder counts now (quantised, wrapped). */
void device_counts(const struct device *device, uint16_t counts[3]);
void device_tip(const struct device *device, double tip_m[3]); /* trocar's frame */
void device_velocity(const struct device *device, double velocity_m_s[3]);
/* Kinetic energy of the moving masses, J. */
double device_kinetic_J(const struct device *device);

#endif
