#include "row.h"

#include "row_code.h"

uint32_t row_max_blocks(const struct bank_view *bank)
{
    return bank->half ? 0 : bank->factor.header->max_blocks;
}

static void refill(struct row_reader *r)
{
    if (r->state >= ROW_STATE_LOW)
        return;
    uint32_t word = 0;
    if (r->next < r->end)
        word = *r->next++;
    else
        r->damaged = true;
    r->state = r->state << 16 | word;
}

static uint32_t plain_bits(struct row_reader *r, uint32_t count)
{
    uint32_t bits = r->state & ((1u << count) - 1u);
    r->state >>= count;
    refill(r);
    return bits;
}

static bool not_zero(struct row_reader *r, uint32_t probability)
{
    uint32_t slot = r->state & ROW_SLOT_MASK, rest = r->state >> BANK_FACTOR_BITS;
    bool is = slot < probability;
    r->state = is ? probability * rest + slot : (ROW_SLOTS - probability) * rest + slot - probability;
    refill(r);
    return is;
}

static int32_t value(struct row_reader *r, const uint16_t *cumulative)
{
    uint32_t slot = r->state & ROW_SLOT_MASK, s = 0;
    while (cumulative[s + 1] <= slot) /* bound: BANK_FACTOR_SYMBOLS, the last entry is 2^12 */
        s++;
    r->state = (uint32_t)(cumulative[s + 1] - cumulative[s]) * (r->state >> BANK_FACTOR_BITS) + slot - cumulative[s];
    refill(r);
    if (s == 0)
        return 0;
    uint32_t magnitude = s;
    if (s >= 4) {
        uint32_t e = s / 2;
        magnitude = (2u + s % 2u) << (e - 1u) | plain_bits(r, e - 1u);
    }
    return plain_bits(r, 1) ? -(int32_t)magnitude : (int32_t)magnitude;
}

/* Prediction plus residual, times the multiple: |.| stays below 2^30. */
static int16_t entry(struct row_reader *r, int32_t v, uint32_t multiple)
{
    int32_t q = v * (int32_t)multiple;
    if (q > INT16_MAX || q < -INT16_MAX) {
        r->damaged = true;
        return 0;
    }
    return (int16_t)q;
}

void row_start(struct row_reader *r, const struct bank_view *bank, uint32_t row)
{
    const struct bank_factor_view *f = &bank->factor;
    *r = (struct row_reader){.factor = f, .row = row};
    r->next = f->code + row_code_start(f, row);
    r->end = f->code + row_code_start(f, row + 1);
    r->state = r->next[0] | (uint32_t)r->next[1] << 16;
    r->next += 2;
}

static void diagonal(struct row_reader *r, struct row_block *out)
{
    const struct bank_factor_view *f = r->factor;
    uint32_t context = f->context[row_context_index(f, r->level, f->header->classes)];
    uint32_t multiple = row_multiple(f->level_unit[r->level], f->header->diagonal_unit);
    const uint16_t *on = row_table(f, context >> 8 & 15u), *beside = row_table(f, context >> 12);
    *out = (struct row_block){.column = (uint16_t)r->row};
    for (int a = 0; a < 3; a++)      /* bound: 3 */
        for (int b = 0; b <= a; b++) /* bound: 3 */
            out->value[3 * a + b] = entry(r, value(r, a == b ? on : beside), multiple);
    r->column++;
}

/* The block of a column that is near enough; false when it is zero. */
static bool off_diagonal(struct row_reader *r, const int32_t d[3], uint32_t d2, uint32_t log, uint32_t class,
                         int16_t out[9])
{
    const struct bank_factor_view *f = r->factor;
    uint32_t context = f->context[row_context_index(f, r->level, class)];
    const int16_t *kernel = row_kernel_of(f, r->level, class);
    bool coded = not_zero(r, row_significance(context)), any = false;
    int32_t v[9] = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    if (!row_kernel_void(kernel))
        row_kernel(kernel, d, d2, v);
    else if (!coded)
        return false;
    if (coded) {
        const uint16_t *on = row_table(f, context >> 8 & 15u), *beside = row_table(f, context >> 12);
        for (int k = 0; k < 9; k++) /* bound: 9 */
            v[k] += value(r, k % 4 == 0 ? on : beside);
    }
    uint32_t multiple = row_multiple(f->level_unit[r->level], f->distance_unit[log]);
    for (int k = 0; k < 9; k++) { /* bound: 9 */
        out[k] = entry(r, v[k], multiple);
        any = any || v[k] != 0;
    }
    return any;
}

uint32_t row_read(struct row_reader *r, uint32_t columns, struct row_block *out)
{
    const struct bank_factor_view *f = r->factor;
    const uint16_t *here = f->place + 3 * r->row;
    const int32_t x = here[0], y = here[1], z = here[2];
    uint32_t found = 0, looked = r->column, stop = r->row - r->column < columns ? r->row : r->column + columns;
    while (r->column < stop) { /* bound: levels */
        uint32_t level_end = row_level_end(f, r->level), end = level_end < stop ? level_end : stop;
        uint32_t log0 = f->level_log[r->level], far = row_far(log0 + f->header->classes), j = r->column;
        const uint16_t *there = f->place + 3 * j;
        for (; j < end; j++, there += 3) { /* bound: columns */
            const int32_t d[3] = {x - there[0], y - there[1], z - there[2]};
            uint32_t d2 = (uint32_t)(d[0] * d[0]) + (uint32_t)(d[1] * d[1]) + (uint32_t)(d[2] * d[2]);
            if (d2 >= far)
                continue;
            uint32_t log = row_ilog(d2);
            if (off_diagonal(r, d, d2, log, log > log0 ? log - log0 : 0, out[found].value))
                out[found++].column = (uint16_t)j;
        }
        r->column = j;
        if (j == level_end)
            r->level++;
    }
    if (r->column == r->row && r->column - looked < columns)
        diagonal(r, &out[found++]);
    return found;
}

bool row_finished(const struct row_reader *r)
{
    return r->column > r->row;
}

bool row_next(struct row_reader *r, struct row_block *out)
{
    while (!row_finished(r)) /* bound: row + 1 */
        if (row_read(r, 1, out))
            return true;
    return false;
}

uint32_t row_decode(const struct bank_view *bank, uint32_t row, struct row_block *out)
{
    struct row_reader r;
    row_start(&r, bank, row);
    return row_read(&r, row + 1, out);
}

/* sum of l[k] r[k] over the three columns of a block's row */
static inline int32_t dot3(const int16_t *l, const int16_t *r, int32_t sum)
{
    sum += l[0] * r[0];
    sum += l[1] * r[1];
    sum += l[2] * r[2];
    return sum;
}

void row_dot(const struct row_block *left, uint32_t left_count, const struct row_block *right, uint32_t right_count,
             int32_t sum[9])
{
    const struct row_block *l = left, *left_end = left + left_count, *r = right, *right_end = right + right_count;
    int32_t s0 = 0, s1 = 0, s2 = 0, s3 = 0, s4 = 0, s5 = 0, s6 = 0, s7 = 0, s8 = 0;
    while (l < left_end && r < right_end) { /* bound: both counts together */
        const uint32_t i = l->column, j = r->column;
        if (i < j)
            l++;
        else if (j < i)
            r++;
        else {
            const int16_t *x = l++->value, *y = r++->value;
            s0 = dot3(x, y, s0);
            s1 = dot3(x, y + 3, s1);
            s2 = dot3(x, y + 6, s2);
            s3 = dot3(x + 3, y, s3);
            s4 = dot3(x + 3, y + 3, s4);
            s5 = dot3(x + 3, y + 6, s5);
            s6 = dot3(x + 6, y, s6);
            s7 = dot3(x + 6, y + 3, s7);
            s8 = dot3(x + 6, y + 6, s8);
        }
    }
    sum[0] = s0, sum[1] = s1, sum[2] = s2;
    sum[3] = s3, sum[4] = s4, sum[5] = s5;
    sum[6] = s6, sum[7] = s7, sum[8] = s8;
}
