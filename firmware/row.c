#include "row.h"

#include "row_code.h"

uint32_t row_max_blocks(const struct bank_view *bank)
{
    return bank->half ? 0 : bank->factor.header->max_blocks;
}

/* The reader's place in the code, held in registers while a block is decoded. */
struct place {
    uint32_t state;
    const uint16_t *next, *end;
    bool damaged;
};

static inline struct place place_of(const struct row_reader *r)
{
    return (struct place){r->state, r->next, r->end, r->damaged};
}

static inline void keep_place(struct row_reader *r, const struct place *p)
{
    r->state = p->state;
    r->next = p->next;
    r->damaged = p->damaged;
}

static inline void refill(struct place *p)
{
    if (p->state >= ROW_STATE_LOW)
        return;
    uint32_t word = 0;
    if (p->next < p->end)
        word = *p->next++;
    else
        p->damaged = true;
    p->state = p->state << 16 | word;
}

static inline uint32_t plain_bits(struct place *p, uint32_t count)
{
    uint32_t bits = p->state & ((1u << count) - 1u);
    p->state >>= count;
    refill(p);
    return bits;
}

static inline bool not_zero(struct place *p, uint32_t probability)
{
    uint32_t slot = p->state & ROW_SLOT_MASK, rest = p->state >> BANK_FACTOR_BITS;
    bool is = slot < probability;
    p->state = is ? probability * rest + slot : (ROW_SLOTS - probability) * rest + slot - probability;
    refill(p);
    return is;
}

static inline int32_t value(struct place *p, const uint16_t *cumulative)
{
    uint32_t slot = p->state & ROW_SLOT_MASK, low = cumulative[0], high;
    const uint16_t *upper = cumulative + 1;
    while ((high = *upper) <= slot) { /* bound: BANK_FACTOR_SYMBOLS, the last entry is 2^12 */
        low = high;
        upper++;
    }
    uint32_t s = (uint32_t)(upper - cumulative) - 1u;
    p->state = (high - low) * (p->state >> BANK_FACTOR_BITS) + slot - low;
    refill(p);
    if (s == 0)
        return 0;
    uint32_t magnitude = s;
    if (s >= 4) {
        uint32_t e = s / 2;
        magnitude = (2u + s % 2u) << (e - 1u) | plain_bits(p, e - 1u);
    }
    return plain_bits(p, 1) ? -(int32_t)magnitude : (int32_t)magnitude;
}

/* Add the nine values of a block to its prediction. */
static void add_values(struct place *into, const uint16_t *on, const uint16_t *beside, int32_t v[9])
{
    struct place p = *into;
    for (int k = 0; k < 9; k++) /* bound: 9 */
        v[k] += value(&p, k % 4 == 0 ? on : beside);
    *into = p;
}

/* Prediction plus residual, times the multiple: |.| stays below 2^30. */
static inline int16_t entry(bool *damaged, int32_t v, uint32_t multiple)
{
    int32_t q = v * (int32_t)multiple;
    if (q > INT16_MAX || q < -INT16_MAX) {
        *damaged = true;
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
    struct place p = place_of(r);
    *out = (struct row_block){.column = (uint16_t)r->row};
    for (int a = 0; a < 3; a++)      /* bound: 3 */
        for (int b = 0; b <= a; b++) /* bound: 3 */
            out->value[3 * a + b] = entry(&p.damaged, value(&p, a == b ? on : beside), multiple);
    keep_place(r, &p);
    r->column++;
}

/* The block of a column that is near enough; false when it is zero. */
static bool off_diagonal(struct row_reader *r, const int32_t d[3], uint32_t d2, uint32_t log, uint32_t class,
                         int16_t out[9])
{
    const struct bank_factor_view *f = r->factor;
    uint32_t context = f->context[row_context_index(f, r->level, class)];
    const int16_t *kernel = row_kernel_of(f, r->level, class);
    struct place p = place_of(r);
    bool coded = not_zero(&p, row_significance(context));
    int32_t v[9], any = 0;
    if (!row_kernel_void(kernel)) {
        row_kernel(kernel, d, d2, v);
    } else {
        keep_place(r, &p);
        if (!coded)
            return false;
        for (int k = 0; k < 9; k++) /* bound: 9 */
            v[k] = 0;
    }
    if (coded)
        add_values(&p, row_table(f, context >> 8 & 15u), row_table(f, context >> 12), v);
    uint32_t multiple = row_multiple(f->level_unit[r->level], f->distance_unit[log]);
    for (int k = 0; k < 9; k++) { /* bound: 9 */
        out[k] = entry(&p.damaged, v[k], multiple);
        any |= v[k];
    }
    keep_place(r, &p);
    return any != 0;
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
