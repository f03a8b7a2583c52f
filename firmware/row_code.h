/* What reader and writer of the rows' code share: the arithmetic of section FACT (bank_format.h). */
#ifndef TROCAR_ROW_CODE_H
#define TROCAR_ROW_CODE_H

#include <stdint.h>

#include "bank_view.h"

#define ROW_STATE_LOW 0x10000u /* the state stays at or above it */
#define ROW_SLOTS     (1u << BANK_FACTOR_BITS)
#define ROW_SLOT_MASK (ROW_SLOTS - 1u)

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

/* Cumulative frequencies of a class; kind 0: on the block's diagonal, 1: beside it. */
static inline const uint16_t *row_table(const struct bank_factor_view *f, uint32_t class, uint32_t kind)
{
    return f->cumulative + (2 * class + kind) * (BANK_FACTOR_SYMBOLS + 1);
}

#endif
