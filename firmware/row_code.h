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

/* Twice the logarithm to base 2, rounded down: 2 e + the bit below the highest, of x with its lowest bit set. 0 .. 63. */
static inline uint32_t row_ilog(uint32_t x)
{
    uint32_t zeros = (uint32_t)__builtin_clz(x | 1u);
    return 62u - 2u * zeros + ((x | 1u) << zeros >> 30 & 1u);
}

/* Smallest x with row_ilog(x) >= log, for log <= 63; above, more than any squared distance. */
static inline uint32_t row_far(uint32_t log)
{
    return log > 63 ? UINT32_MAX : log < 4 ? (log ? 2u : 0u) : (2u + (log & 1u)) << (log / 2 - 1);
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

static inline const struct bank_context *row_contexts(const struct bank_factor_view *f, uint32_t level)
{
    return f->context + level * f->header->classes;
}

/* What a context's code says: probability of "not all zero", of 2^12; tables for the diagonal and beside it. */
static inline uint32_t row_significance(uint32_t code)
{
    return 16u * (code & 255u) + 8u;
}

static inline uint32_t row_table_on(uint32_t code)
{
    return code >> 8 & 15u;
}

static inline uint32_t row_table_beside(uint32_t code)
{
    return code >> 12;
}

static inline const struct bank_table *row_table(const struct bank_factor_view *f, uint32_t number)
{
    return f->table + number;
}

/* Number of the table of the next three values, from the one that is due and the sum of the last three symbols, which were
 * read with the table `last`. */
static inline uint32_t row_next_table(uint32_t due, const struct bank_table *last, uint32_t sum)
{
    if (sum < last->low)
        return due > 0 ? due - 1 : 0;
    return sum >= last->high && due < BANK_FACTOR_TABLES - 1 ? due + 1 : due;
}

/* Signed values as numbers from 0: 0, -1, 1, -2, 2, ... */
static inline uint32_t row_number(int32_t value)
{
    return (uint32_t)value << 1 ^ (value < 0 ? UINT32_MAX : 0);
}

static inline int32_t row_value(uint32_t number)
{
    return (int32_t)(number >> 1 ^ (0u - (number & 1u)));
}

/* What the residual above the diagonal tells of the one across from it: `turn` sixteenths, rounded. */
static inline int32_t row_turned(int32_t residual, int32_t turn)
{
    return (int32_t)((uint32_t)residual * (uint32_t)turn + 8u) >> 4; /* wraps in damaged code only */
}

/* Without a kernel there is no prediction. */
static inline bool row_kernel_void(const int16_t k[2])
{
    return !(k[0] | k[1]);
}

/* The prediction of a block, symmetric: d is place_i - place_j, d2 its square. In integers, hence the same on every
 * machine: d2 and the products are cut to 13 bits, k1 / d2 has 14 more than k1; |.| stays below 2^30. */
struct row_prediction {
    int32_t xx, yy, zz, xy, xz, yz;
};

static inline struct row_prediction row_kernel(const int16_t k[2], const int32_t d[3], uint32_t d2)
{
    uint32_t shift = d2 < 1u << 13 ? 0 : 19u - (uint32_t)__builtin_clz(d2);
    int32_t s = d2 ? (int32_t)k[1] * (1 << 14) / (int32_t)(d2 >> shift) : 0;
    int32_t half = 1 << 16, a = (int32_t)k[0] * (1 << 14) + half;
    return (struct row_prediction){
        (a + s * ((d[0] * d[0]) >> shift)) >> 17,    (a + s * ((d[1] * d[1]) >> shift)) >> 17,
        (a + s * ((d[2] * d[2]) >> shift)) >> 17,    (half + s * ((d[0] * d[1]) >> shift)) >> 17,
        (half + s * ((d[0] * d[2]) >> shift)) >> 17, (half + s * ((d[1] * d[2]) >> shift)) >> 17};
}

#endif
