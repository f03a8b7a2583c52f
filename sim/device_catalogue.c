/* Figures of the force-feedback instruments that a scene can name. The maker's figures are those of [C97 7.5.3]; every
 * other one is an assumption of ours, marked so, with what it rests on. */
#include "device.h"

#include <string.h>

/* Laparoscopic Impulse Engine. Maker: 5 axes tracked, 3 actuated; work space 10 x 23 x 23 cm; resolution 0.023 mm; 8.9
 * N; friction < 0.14 N; bandwidth 650 Hz linear, 120 Hz rotary.
 *
 * Work space: +-30 degrees at 0.23 m sweep the stated 23 cm. Assumed: stops at 0.10 m and 0.23 m, a little more than
 * the stated 10 cm of depth, so that a scene's `length` fits inside the stops. */
#define LENGTH_MIN_m   0.10
#define LENGTH_MAX_m   0.23
#define LENGTH_MID_m   (0.5 * (LENGTH_MIN_m + LENGTH_MAX_m))
#define HALF_ANGLE_rad 0.52359877559829887 /* 30 degrees */
#define RESOLUTION_m   0.023e-3
#define FORCE_N        8.9
#define FRICTION_N     0.14
/* Assumed: 0.2 kg move with the tip in every direction (a hand-held shaft with its carriage). */
#define MOVING_MASS_kg 0.2
/* Assumed viscous friction: what cable drives of this size have; at 0.1 m/s about the maker's friction. The rotary
 * value is 1.5 N s/m felt at the tip at the largest insertion, where it is felt least. */
#define VISCOUS_Ns_m 1.5
#define VISCOUS_Nms  (VISCOUS_Ns_m * LENGTH_MAX_m * LENGTH_MAX_m)
/* Assumed plausible speeds: a little over what the motors reach from one stop to the other, sqrt(2 F stroke / mass). */
#define SPEED_m_s   3.5
#define SPEED_rad_s 25.0

enum { ENCODER_MODULUS = 16384, ENCODER_MIDDLE = 8192 };

/* The stated resolution at the tip, at the mid insertion. */
#define ROTARY_AXIS                                                                                                    \
    {                                                                                                                  \
        .per_count = RESOLUTION_m / LENGTH_MID_m, .count_zero = ENCODER_MIDDLE, .count_modulus = ENCODER_MODULUS,      \
        .zero = 0.0, .minimum = -HALF_ANGLE_rad, .maximum = HALF_ANGLE_rad,                                            \
        .inertia = MOVING_MASS_kg * LENGTH_MID_m * LENGTH_MID_m, .viscous = VISCOUS_Nms,                               \
        .coulomb = FRICTION_N * LENGTH_MID_m, .effort_limit = FORCE_N * LENGTH_MID_m, .bandwidth_Hz = 120.0,           \
        .speed_limit = SPEED_rad_s                                                                                     \
    }

static const struct device_model catalogue[] = {
    {
        .name = "impulse-engine",
        .axis = {ROTARY_AXIS,
                 ROTARY_AXIS,
                 {.per_count = RESOLUTION_m,
                  .count_zero = ENCODER_MIDDLE,
                  .count_modulus = ENCODER_MODULUS,
                  .zero = LENGTH_MID_m,
                  .minimum = LENGTH_MIN_m,
                  .maximum = LENGTH_MAX_m,
                  .inertia = MOVING_MASS_kg,
                  .viscous = VISCOUS_Ns_m,
                  .coulomb = FRICTION_N,
                  .effort_limit = FORCE_N,
                  .bandwidth_Hz = 650.0,
                  .speed_limit = SPEED_m_s}},
        .gravity_N = 1.0,      /* assumed: a motor of 0.1 kg */
        .gravity_arm_m = 0.08, /* assumed */
        .force_limit_N = FORCE_N,
    },
};

enum { CATALOGUE_COUNT = sizeof catalogue / sizeof catalogue[0] };

const struct device_model *device_model_find(const char *name)
{
    for (int i = 0; i < CATALOGUE_COUNT; i++)
        if (strcmp(catalogue[i].name, name) == 0)
            return &catalogue[i];
    return NULL;
}

const char *device_model_names(void)
{
    return "impulse-engine";
}
