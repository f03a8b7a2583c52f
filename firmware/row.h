/* Rows of the compliance's factor (section FACT of bank_format.h), decoded from flash.
 *
 *   G_ij = step^2 sum_k Q_ik Q_jk^t     over the columns k that both rows hold
 *
 * Any one row can be read by itself, in bounded work and without memory of its own: a reader is a few words of state that
 * walks the columns 0 .. row in rising order, as many per call as the caller has time for. bank_view_open has decoded
 * every row once, so nothing here checks.
 *
 * Work on a Cortex-M7: 60 instructions per column, 255 per block that is found, 112 per word of code; 72 per common block of
 * a product (fitted; row_cache.h).
 * Integer dot products of two rows are exact in int32, because the sum of squares of every scalar row is below 2^31. */
#ifndef TROCAR_ROW_H
#define TROCAR_ROW_H

#include <stdbool.h>
#include <stdint.h>

#include "bank_view.h"

/* Q_(row, column), row-major: value[3 a + b] is component a of the row, b of the column. */
struct row_block {
    uint16_t column;
    int16_t value[9];
};

struct row_reader {
    const struct bank_factor_view *factor;
    uint32_t row;
    uint32_t column; /* the next to be looked at; the row is finished when it exceeds `row` */
    uint32_t level;
    uint32_t state;
    const uint16_t *next, *end;
    bool damaged; /* the code ended too early: only while a bank is being validated */
};

/* Longest row of the bank in blocks; 0 when the bank holds GHLF. */
uint32_t row_max_blocks(const struct bank_view *bank);

/* All blocks of a row, columns rising, the last is (row, row). `out` has room for row_max_blocks. Returns how many. */
uint32_t row_decode(const struct bank_view *bank, uint32_t row, struct row_block *out);

/* The same in portions: look at no more than `columns` further columns, append the blocks found to `out` (room for as
 * many as columns), return how many. row_finished tells when all are out. */
void row_start(struct row_reader *reader, const struct bank_view *bank, uint32_t row);
uint32_t row_read(struct row_reader *reader, uint32_t columns, struct row_block *out);
bool row_finished(const struct row_reader *reader);
/* The next block; false behind the last. The only one that looks for damage: for validating a bank. */
bool row_next(struct row_reader *reader, struct row_block *out);

/* Sum over the common columns of two rows: sum[3 a + b] = sum_k,c Q_(i,k)[a][c] Q_(j,k)[b][c]. Returns their number. */
uint32_t row_dot(const struct row_block *left, uint32_t left_count, const struct row_block *right, uint32_t right_count,
                 int32_t sum[9]);

#endif
