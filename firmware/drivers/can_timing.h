/* Bit timing of a classic CAN controller (ISO 11898-1, 11.3): a bit is 1 + before + after quanta of prescaler / clock; it is
 * sampled between `before` (propagation and phase segment 1) and `after` (phase segment 2), and an edge shifts it by at
 * most `jump` quanta. */
#ifndef TROCAR_CAN_TIMING_H
#define TROCAR_CAN_TIMING_H

#include <stdbool.h>
#include <stdint.h>

/* The largest value of each that a controller can be told; the smallest is 1. */
struct can_timing_limits {
    uint32_t prescaler, before, after, jump;
};

struct can_timing {
    uint32_t prescaler, before, after, jump;
};

/* The timing with exactly this bit rate whose sample point is nearest to 80 % of the bit and, of those equally near, with the
 * most quanta; 8 to 25 quanta (ISO 11898-1). False when the clock has no such divisor, or the sample point would be
 * outside of 75 to 87.5 %. The jump is as wide as allowed: the clocks of two nodes may then differ most. */
bool can_timing_find(uint32_t clock_Hz, uint32_t bit_rate, const struct can_timing_limits *limits,
                     struct can_timing *t);

#endif
