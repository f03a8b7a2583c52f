#include "can_timing.h"

enum { QUANTA_LEAST = 8, QUANTA_MOST = 25 };

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* Distance of the sample point from 80 %, as a fraction of `quanta` * 5 so that it stays an integer. */
static uint32_t distance(uint32_t quanta, uint32_t after)
{
    return 5 * after > quanta ? 5 * after - quanta : quanta - 5 * after;
}

bool can_timing_find(uint32_t clock_Hz, uint32_t bit_rate, const struct can_timing_limits *limits, struct can_timing *t)
{
    uint32_t best_distance = 0, best_quanta = 0;
    for (uint32_t quanta = QUANTA_MOST; quanta >= QUANTA_LEAST; quanta--) { /* bound: QUANTA_MOST */
        uint32_t divisor = quanta * bit_rate;
        if (bit_rate == 0 || clock_Hz % divisor != 0 || clock_Hz / divisor > limits->prescaler || clock_Hz < divisor)
            continue;
        uint32_t after = least((quanta + 2) / 5, limits->after);
        uint32_t before = quanta - 1 - after;
        if (before > limits->before || 4 * after > quanta || 8 * after < quanta)
            continue;
        /* d / quanta < best / best_quanta */
        if (best_quanta != 0 && distance(quanta, after) * best_quanta >= best_distance * quanta)
            continue;
        best_distance = distance(quanta, after);
        best_quanta = quanta;
        *t = (struct can_timing){
            .prescaler = clock_Hz / divisor, .before = before, .after = after, .jump = least(after, limits->jump)};
    }
    return best_quanta != 0;
}
