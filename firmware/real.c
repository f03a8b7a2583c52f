#include "real.h"

#include <stdint.h>

#define HALF_PI 1.57079633f

/* Polynomials that interpolate sin(x)/x and (cos(x) - 1 + x^2/2)/x^4 at the Chebyshev nodes of x^2 in [0, (pi/2)^2]; in
 * exact arithmetic they err by 2e-8 and 1e-8, the rest of the stated error is rounding. */
float real_sin(float x)
{
    x = real_clamp(x, -HALF_PI, HALF_PI);
    float y = x * x;
    float p = -2.38664803e-08f;
    p = p * y + 2.7523995e-06f;
    p = p * y - 0.000198408365f;
    p = p * y + 0.00833333097f;
    p = p * y - 0.166666672f;
    return x + x * (y * p);
}

float real_cos(float x)
{
    x = real_clamp(x, -HALF_PI, HALF_PI);
    float y = x * x;
    float p = 2.01671968e-09f;
    p = p * y - 2.7541779e-07f;
    p = p * y + 2.48014476e-05f;
    p = p * y - 0.00138888881f;
    p = p * y + 0.0416666679f;
    return 1.0f - (0.5f * y - (y * y) * p);
}

union bits {
    float value;
    uint32_t word;
};

float real_sqrt(float x)
{
    if (!(x >= 1e-30f))
        return 0.0f;
    union bits b = {.value = x};
    b.word = 0x5f375a86u - (b.word >> 1); /* 1/sqrt to 3.5 % from the exponent (Lomont 2003) */
    float r = b.value;
    for (int i = 0; i < 3; i++) /* bound: 3 Newton steps, 3.5e-2 -> 1.8e-3 -> 4.7e-6 -> rounding */
        r = r * (1.5f - 0.5f * x * r * r);
    float s = x * r;
    return s + 0.5f * r * (x - s * s); /* one Heron step removes the rounding of s */
}

bool real_finite(float x)
{
    union bits b = {.value = x};
    return (b.word & 0x7f800000u) != 0x7f800000u;
}
