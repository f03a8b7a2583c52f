/* What reader and writer of the rows' code share: the arithmetic of section FACT (bank_format.h). */
#ifndef TROCAR_ROW_CODE_H
#define TROCAR_ROW_CODE_H

#include <stdbool.h>
#include <stdint.h>

#include "bank_view.h"

#define ROW_STATE_LOW    0x10000u /* the state stays at or above it */
#define ROW_SLOTS        (1u << BANK_FACTOR_BITS)
#define ROW_SLOT_MASK    (ROW_SLOTS - 1u)
#define ROW_MULTIPLE_MAX 4096u /* of the step */

/* Twice the logarithm to base 2, rounded down: 2 e + the bit below the highest. 0 .. 63. */
static inline uint32_t row_ilog(uint32_t x)
{
    if (x < 2)
        return 0;
    uint32_t e = 31u - (uint32_t)__builtin_clz(x);
    return 2 * e + (x >> (e - 1) & 1u);
}

/* Smallest x with row_ilog(x) >= log, for log <= 63; above, more than any squared distance. */
static inline uint32_t row_far(uint32_t log)
{
    return log > 63 ? UINT32_MAX : log < 2 ? log * 2 : (2u + (log & 1u)) << (log / 2 - 1);
}

static inline uint32_t row_level_end(const struct bank_factor_view *f, uint32_t level)
{
    return level + 1u < f->header->levels ? f->level_first[level + 1] : f->rows;
}

/* Word at which a row's code starts; row = rows: where the last one ends. */
static inline uint32_t row_code_start(const struct bank_factor_view *f, uint32_t row)
{
    uint32_t group = row / 32;
    return (f->base[2 * group] | (uint32_t)f->base[2 * group + 1] << 16) + f->offset[row];
}

/* Multiple of the step for a block: units are 1/8 of the product's root, so that both may be fractions; at least 1. */
static inline uint32_t row_multiple(uint32_t level_unit, uint32_t distance_unit)
{
    uint32_t multiple = (level_unit * distance_unit + 32u) >> 6;
    return multiple ? multiple : 1u;
}

static inline uint32_t row_context_index(const struct bank_factor_view *f, uint32_t level, uint32_t class)
{
    return level * (f->header->classes + 1u) + class;
}

static inline const int16_t *row_kernel_of(const struct bank_factor_view *f, uint32_t level, uint32_t class)
{
    return f->kernel + 2u * (level * f->header->classes + class);
}

static inline uint32_t row_significance(uint32_t context)
{
    return 16u * (context & 255u) + 8u;
}

static inline const uint16_t *row_table(const struct bank_factor_view *f, uint32_t number)
{
    return f->cumulative + number * (BANK_FACTOR_SYMBOLS + 1u);
}

static inline int32_t row_round(float x)
{
    return (int32_t)(x < 0.0f ? x - 0.5f : x + 0.5f);
}

/* True when a kernel rounds to zero for every direction: |p| <= (|k0| + |k1|) / 8. */
static inline bool row_kernel_void(const int16_t k[2])
{
    return (k[0] < 0 ? -k[0] : k[0]) + (k[1] < 0 ? -k[1] : k[1]) < 4;
}

/* The prediction of a block, symmetric: d is place_i - place_j, d2 its square. Each operation rounds once, so it is the
 * same on every machine. */
static inline void row_kernel(const int16_t k[2], const int32_t d[3], uint32_t d2, int32_t out[9])
{
    float x = (float)d[0], y = (float)d[1], z = (float)d[2];
    float a = 0.125f * (float)k[0], s = d2 ? 0.125f * (float)k[1] / (float)d2 : 0.0f;
    float xs = x * s, ys = y * s, zs = z * s;
    out[0] = row_round(a + xs * x);
    out[4] = row_round(a + ys * y);
    out[8] = row_round(a + zs * z);
    out[1] = out[3] = row_round(xs * y);
    out[2] = out[6] = row_round(xs * z);
    out[5] = out[7] = row_round(ys * z);
}

#endif
