/* The controller's own elementary functions in single precision: a fixed sequence of rounded products and sums, so that
 * every target computes the same bits. No table, no branch on the value's size inside the range. */
#ifndef TROCAR_REAL_H
#define TROCAR_REAL_H

#include <stdbool.h>

/* |x| <= pi/2 (the joints of an instrument); absolute error below 1.5e-7. Outside, the argument is clamped. */
float real_sin(float x);
float real_cos(float x);

/* Square root for 1e-30 <= x <= 1e30, relative error below 1.2e-7; smaller or negative x give 0. */
float real_sqrt(float x);

/* Neither infinite nor NaN; looks at the bits, so no comparison can be optimised away. */
bool real_finite(float x);

static inline float real_dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void real_cross(const float a[3], const float b[3], float out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void real_subtract(const float a[3], const float b[3], float out[3])
{
    out[0] = a[0] - b[0];
    out[1] = a[1] - b[1];
    out[2] = a[2] - b[2];
}

static inline float real_clamp(float x, float low, float high)
{
    return x < low ? low : x > high ? high : x;
}

#endif
