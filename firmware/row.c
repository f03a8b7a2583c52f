#include "row.h"

#include "row_code.h"

uint32_t row_max_blocks(const struct bank_view *bank)
{
    return bank->half ? 0 : bank->factor.header->max_blocks;
}

/* Held in registers only where the whole is one function. */
#define INLINE static inline __attribute__((always_inline))

/* The place in the code. */
struct place {
    uint32_t state;
    const uint16_t *next;
};

/* A word, which may be one of the next row's in damaged code; row_read notices. */
static inline void refill(struct place *p)
{
    if (p->state < ROW_STATE_LOW)
        p->state = p->state << 16 | *p->next++;
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

INLINE uint32_t symbol(struct place *p, const uint16_t *first_upper)
{
    uint32_t slot = p->state & ROW_SLOT_MASK, rest = p->state >> BANK_FACTOR_BITS, low, high = *first_upper, s = 0;
    if (slot < high)
        p->state = high * rest + slot;
    else {
        const uint16_t *upper = first_upper;
        do { /* bound: BANK_FACTOR_SYMBOLS, the last entry is 2^12 */
            low = high;
            high = *++upper;
        } while (high <= slot);
        p->state = (high - low) * rest + slot - low;
        s = (uint32_t)(upper - first_upper);
    }
    refill(p);
    return s;
}

/* Three numbers from their symbols: what stands behind the last symbol, and the plain bits. */
struct three {
    struct place p;
    uint32_t number[3];
};

static void lengthen(struct three *t, uint32_t plain)
{
    struct place p = t->p;
    for (int k = 0; k < 3; k++) { /* bound: 3 */
        uint32_t n = t->number[k];
        if (n == BANK_FACTOR_SYMBOLS - 1) {
            uint32_t e = plain_bits(&p, 4);
            n += (1u << e | plain_bits(&p, e)) - 1u;
        }
        t->number[k] = n << plain | plain_bits(&p, plain);
    }
    t->p = p;
}

/* Three values; the sum of their symbols tells which table is next. */
INLINE uint32_t three(struct place *p, const struct bank_table *table, int32_t v[3])
{
    uint32_t a = symbol(p, table->upper), b = symbol(p, table->upper), c = symbol(p, table->upper), sum = a + b + c;
    if (table->plain > 0 || sum >= BANK_FACTOR_SYMBOLS - 1) {
        struct three t = {*p, {a, b, c}};
        lengthen(&t, table->plain);
        *p = t.p;
        a = t.number[0], b = t.number[1], c = t.number[2];
    }
    v[0] = row_value(a);
    v[1] = row_value(b);
    v[2] = row_value(c);
    return sum;
}

/* The residual of a block: the diagonal, above it, below it. */
static __attribute__((noinline)) void residual(struct place *into, const struct bank_table *tables,
                                               const struct bank_context *context, int32_t r[9])
{
    struct place p = *into;
    int32_t on[3], above[3], below[3], turn = context->turn;
    const struct bank_table *table = tables + row_table_on(context->code);
    uint32_t next = row_next_table(row_table_beside(context->code), table, three(&p, table, on));
    r[0] = on[0], r[4] = on[1], r[8] = on[2];
    table = tables + next;
    next = row_next_table(next, table, three(&p, table, above));
    r[1] = above[0], r[2] = above[1], r[5] = above[2];
    three(&p, tables + next, below);
    r[3] = below[0] + row_turned(above[0], turn);
    r[6] = below[1] + row_turned(above[1], turn);
    r[7] = below[2] + row_turned(above[2], turn);
    *into = p;
}

/* Entries are multiples; when it is asked for, what leaves 16 bits is left in `over`. */
struct scale {
    uint32_t level_unit, over;
    bool checked;
};

INLINE int32_t put(int16_t *out, int32_t v, uint32_t multiple, struct scale *scale)
{
    uint32_t q = (uint32_t)v * multiple;
    if (scale->checked)
        scale->over |= (q + 0x8000u) >> 16;
    *out = (int16_t)q;
    return v;
}

/* Damaged code asks for more words than the row has: it gets the same ones again. */
static void keep_end(struct row_reader *r, struct place *p)
{
    r->damaged = true;
    p->next = r->end;
}

static inline void keep_place(struct row_reader *r, struct place *p, uint32_t over)
{
    if (p->next > r->end)
        keep_end(r, p);
    r->state = p->state;
    r->next = p->next;
    r->damaged |= over != 0;
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

INLINE void diagonal(struct row_reader *r, bool checked, struct row_block *out)
{
    const struct bank_factor_view *f = r->factor;
    const struct bank_context *context = &f->diagonal[r->level];
    uint32_t multiple = row_multiple(f->level_unit[r->level], f->header->diagonal_unit);
    struct scale scale = {0, 0, checked};
    const struct bank_table *table = row_table(f, row_table_on(context->code));
    struct place p = {r->state, r->next};
    int32_t on[3], below[3];
    uint32_t sum = three(&p, table, on);
    three(&p, row_table(f, row_next_table(row_table_beside(context->code), table, sum)), below);
    *out = (struct row_block){.column = (uint16_t)r->row};
    for (int k = 0; k < 3; k++) /* bound: 3 */
        put(&out->value[4 * k], on[k], multiple, &scale);
    put(&out->value[3], below[0], multiple, &scale);
    put(&out->value[6], below[1], multiple, &scale);
    put(&out->value[7], below[2], multiple, &scale);
    keep_place(r, &p, scale.over);
    r->column++;
}

/* The block of a column that is near enough; false when it is zero. */
INLINE bool off_diagonal(struct place *p, const struct bank_table *tables, const struct bank_context *context,
                         const int32_t d[3], uint32_t d2, uint32_t distance_unit, struct scale *scale, int16_t out[9])
{
    bool coded = not_zero(p, row_significance(context->code));
    int32_t r[9];
    if (coded)
        residual(p, tables, context, r);
    if (row_kernel_void(context->kernel)) {
        if (!coded)
            return false;
        uint32_t multiple = row_multiple(scale->level_unit, distance_unit);
        put(&out[0], r[0], multiple, scale);
        put(&out[1], r[1], multiple, scale);
        put(&out[2], r[2], multiple, scale);
        put(&out[3], r[3], multiple, scale);
        put(&out[4], r[4], multiple, scale);
        put(&out[5], r[5], multiple, scale);
        put(&out[6], r[6], multiple, scale);
        put(&out[7], r[7], multiple, scale);
        put(&out[8], r[8], multiple, scale);
        return true;
    }
    const struct row_prediction k = row_kernel(context->kernel, d, d2);
    if (!coded)
        r[0] = r[1] = r[2] = r[3] = r[4] = r[5] = r[6] = r[7] = r[8] = 0;
    uint32_t multiple = row_multiple(scale->level_unit, distance_unit);
    int32_t any = put(&out[0], r[0] + k.xx, multiple, scale);
    any |= put(&out[1], r[1] + k.xy, multiple, scale);
    any |= put(&out[2], r[2] + k.xz, multiple, scale);
    any |= put(&out[3], r[3] + k.xy, multiple, scale);
    any |= put(&out[4], r[4] + k.yy, multiple, scale);
    any |= put(&out[5], r[5] + k.yz, multiple, scale);
    any |= put(&out[6], r[6] + k.xz, multiple, scale);
    any |= put(&out[7], r[7] + k.yz, multiple, scale);
    any |= put(&out[8], r[8] + k.zz, multiple, scale);
    return any != 0;
}

/* Unchecked when the bank has been validated. */
INLINE uint32_t read_columns(struct row_reader *r, uint32_t columns, bool checked, struct row_block *out)
{
    const struct bank_factor_view *f = r->factor;
    const uint16_t *here = f->place + 3 * r->row;
    const int32_t x = here[0], y = here[1], z = here[2];
    const struct bank_table *tables = f->table;
    struct place p = {r->state, r->next};
    struct row_block *next = out;
    struct scale scale = {0, 0, checked};
    uint32_t looked = r->column, stop = r->row - r->column < columns ? r->row : r->column + columns;
    while (r->column < stop) { /* bound: levels */
        const uint32_t level_end = row_level_end(f, r->level), end = level_end < stop ? level_end : stop;
        const uint32_t log0 = f->level_log[r->level], far = row_far(log0 + f->header->classes);
        const struct bank_context *contexts = row_contexts(f, r->level);
        scale.level_unit = f->level_unit[r->level];
        const uint16_t *there = f->place + 3 * r->column;
        for (uint32_t j = r->column; j < end; j++, there += 3) { /* bound: columns */
            const int32_t d[3] = {x - there[0], y - there[1], z - there[2]};
            const uint32_t d2 = (uint32_t)(d[0] * d[0]) + (uint32_t)(d[1] * d[1]) + (uint32_t)(d[2] * d[2]);
            if (d2 >= far)
                continue;
            const uint32_t log = row_ilog(d2), class = log > log0 ? log - log0 : 0;
            if (off_diagonal(&p, tables, contexts + class, d, d2, f->distance_unit[log], &scale, next->value))
                next++->column = (uint16_t)j;
            if (checked && p.next > r->end)
                keep_end(r, &p);
        }
        r->column = end;
        if (end == level_end)
            r->level++;
    }
    keep_place(r, &p, scale.over);
    if (r->column == r->row && r->column - looked < columns)
        diagonal(r, checked, next++);
    return (uint32_t)(next - out);
}

uint32_t row_read(struct row_reader *r, uint32_t columns, struct row_block *out)
{
    return read_columns(r, columns, false, out);
}

bool row_finished(const struct row_reader *r)
{
    return r->column > r->row;
}

bool row_next(struct row_reader *r, struct row_block *out)
{
    while (!row_finished(r)) /* bound: row + 1 */
        if (read_columns(r, 1, true, out))
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

uint32_t row_dot(const struct row_block *left, uint32_t left_count, const struct row_block *right, uint32_t right_count,
                 int32_t sum[9])
{
    const struct row_block *l = left, *left_end = left + left_count, *r = right, *right_end = right + right_count;
    uint32_t common = 0;
    int32_t s0 = 0, s1 = 0, s2 = 0, s3 = 0, s4 = 0, s5 = 0, s6 = 0, s7 = 0, s8 = 0;
    while (l < left_end && r < right_end) { /* bound: both counts together */
        const uint32_t i = l->column, j = r->column;
        if (i < j)
            l++;
        else if (j < i)
            r++;
        else {
            const int16_t *x = l++->value, *y = r++->value;
            common++;
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
    return common;
}
