#include "row_encode.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "row_code.h"

enum {
    CONTEXTS = BANK_FACTOR_LEVELS * (BANK_FACTOR_CLASSES + 1), /* the last of a level is that of its diagonal blocks */
    TABLES = BANK_FACTOR_TABLES,
    SYMBOLS = BANK_FACTOR_SYMBOLS,
    VALUE_STEPS = 4,  /* symbol, two beyond it, plain bits */
    EXPONENT_BITS = 4 /* of a number beyond the last symbol */
};

/* One step of the coder: an interval of the 2^12, or plain bits (frequency 0). */
struct step {
    uint16_t start, frequency;
    uint8_t bits;
};

/* What is counted per context (level, class). */
struct tally {
    double columns, coded;
    double values[2], magnitudes[2]; /* on the block's diagonal, beside it */
    double normal[3], right[2];      /* of the least squares for the kernel */
    double above, across;            /* for the turn */
};

struct coder {
    const struct factor *factor;
    const struct order *order;
    uint32_t classes;
    struct tally tally[CONTEXTS];
    struct bank_context context[CONTEXTS];
    struct bank_table table[TABLES];
    double count[TABLES][SYMBOLS];
    bool too_long;     /* a number does not fit its code */
    struct step *step; /* of one row */
    size_t steps;
    uint16_t *code;
    size_t words, room;
};

/* The passes over all rows: kernels from the entries; turns, then contexts from the residuals; frequencies; the code. */
enum pass { FIT_KERNEL, FIT_TURN, FIT_CONTEXT, FIT_FREQUENCY, CODE };

static void plain_step(struct coder *c, uint32_t bits, uint32_t count)
{
    if (count > 0)
        c->step[c->steps++] = (struct step){(uint16_t)bits, 0, (uint8_t)count};
}

static uint32_t symbol(const struct bank_table *t, uint32_t number)
{
    uint32_t part = number >> t->plain;
    return part < SYMBOLS - 1 ? part : SYMBOLS - 1;
}

static void symbol_step(struct coder *c, const struct bank_table *t, uint32_t s)
{
    uint32_t low = s > 0 ? t->upper[s - 1] : 0;
    c->step[c->steps++] = (struct step){(uint16_t)low, (uint16_t)(t->upper[s] - low), 0};
}

/* What a number has beside its symbol. */
static void rest_steps(struct coder *c, const struct bank_table *t, uint32_t number)
{
    uint32_t part = number >> t->plain;
    if (part >= SYMBOLS - 1) {
        uint32_t rest = part - (SYMBOLS - 2), e = 31u - (uint32_t)__builtin_clz(rest);
        c->too_long |= e >= 1u << EXPONENT_BITS;
        plain_step(c, e, EXPONENT_BITS);
        plain_step(c, rest - (1u << e), e);
    }
    plain_step(c, number & ((1u << t->plain) - 1u), t->plain);
}

/* Three values; what their symbols sum up to. */
static uint32_t three(struct coder *c, enum pass pass, uint32_t context, int beside, uint32_t table,
                      const int32_t value[3])
{
    const struct bank_table *t = &c->table[table];
    uint32_t sum = 0, number[3];
    for (int k = 0; k < 3; k++) {
        number[k] = row_number(value[k]);
        sum += symbol(t, number[k]);
        if (pass == FIT_CONTEXT) {
            c->tally[context].values[beside]++;
            c->tally[context].magnitudes[beside] += abs(value[k]);
        } else if (pass == FIT_FREQUENCY)
            c->count[table][symbol(t, number[k])]++;
        else
            symbol_step(c, t, symbol(t, number[k]));
    }
    for (int k = 0; k < 3 && pass == CODE; k++)
        rest_steps(c, t, number[k]);
    return sum;
}

/* The residual of a block in the order of the code; that of (i, i) has nothing above its diagonal. */
static void residual(struct coder *c, enum pass pass, uint32_t context, bool all, const int32_t r[9])
{
    uint32_t on = row_table_on(c->context[context].code), next = row_table_beside(c->context[context].code);
    int32_t diagonal[3] = {r[0], r[4], r[8]}, above[3] = {r[1], r[2], r[5]}, below[3] = {r[3], r[6], r[7]};
    next = row_next_table(next, &c->table[on], three(c, pass, context, 0, on, diagonal));
    if (all) {
        uint32_t now = next;
        int32_t turn = c->context[context].turn;
        next = row_next_table(now, &c->table[now], three(c, pass, context, 1, now, above));
        for (int k = 0; k < 3; k++)
            below[k] -= row_turned(above[k], turn);
    }
    three(c, pass, context, 1, next, below);
}

/* Normal equations for entries = k0 [a = b] + k1 D_a D_b / D.D. */
static void fit_kernel(struct tally *t, const int32_t d[3], const int32_t entry[9])
{
    double d2 = (double)d[0] * d[0] + (double)d[1] * d[1] + (double)d[2] * d[2];
    t->columns++;
    for (int k = 0; k < 9; k++) {
        double one = k % 4 == 0, along = d2 > 0 ? (double)d[k / 3] * d[k % 3] / d2 : 0;
        t->normal[0] += one;
        t->normal[1] += one * along;
        t->normal[2] += along * along;
        t->right[0] += one * entry[k];
        t->right[1] += along * entry[k];
    }
}

static void fit_turn(struct tally *t, const int32_t r[9])
{
    static const int above[3] = {1, 2, 5}, below[3] = {3, 6, 7};
    for (int k = 0; k < 3; k++) {
        t->above += (double)r[above[k]] * r[above[k]];
        t->across += (double)r[above[k]] * r[below[k]];
    }
}

/* Column j < i of the row, `entry` its block in multiples. */
static void column(struct coder *c, enum pass pass, size_t i, size_t j, uint32_t context, const int32_t entry[9])
{
    const uint16_t *here = c->order->place + 3 * i, *there = c->order->place + 3 * j;
    int32_t d[3] = {here[0] - there[0], here[1] - there[1], here[2] - there[2]}, r[9] = {0}, any = 0;
    uint32_t d2 = (uint32_t)(d[0] * d[0]) + (uint32_t)(d[1] * d[1]) + (uint32_t)(d[2] * d[2]);
    struct tally *t = &c->tally[context];
    if (pass == FIT_KERNEL) {
        fit_kernel(t, d, entry);
        return;
    }
    if (!row_kernel_void(c->context[context].kernel)) {
        struct row_prediction p = row_kernel(c->context[context].kernel, d, d2);
        r[0] = p.xx, r[4] = p.yy, r[8] = p.zz;
        r[1] = r[3] = p.xy, r[2] = r[6] = p.xz, r[5] = r[7] = p.yz;
    }
    for (int k = 0; k < 9; k++) {
        r[k] = entry[k] - r[k];
        any |= r[k];
    }
    if (pass == CODE) {
        uint16_t p = (uint16_t)row_significance(c->context[context].code);
        c->step[c->steps++] = (struct step){any ? 0 : p, (uint16_t)(any ? p : ROW_SLOTS - p), 0};
    }
    if (!any)
        return;
    if (pass == FIT_CONTEXT)
        t->coded++;
    if (pass == FIT_TURN)
        fit_turn(t, r);
    else
        residual(c, pass, context, true, r);
}

static void walk(struct coder *c, enum pass pass, size_t i)
{
    const struct order *o = c->order;
    const struct rounding *r = &c->factor->rounding;
    const struct row_block *block = c->factor->block + c->factor->start[i];
    uint32_t level = 0;
    c->steps = 0;
    for (size_t j = 0; j <= i; j++) {
        if (level + 1 < o->levels && o->level_first[level + 1] == j)
            level++;
        uint32_t log = order_log(o, i, j), class = log > o->level_log[level] ? log - o->level_log[level] : 0;
        if (j < i && class >= c->classes)
            continue;
        uint32_t context = level * (c->classes + 1) + (j < i ? class : c->classes);
        uint32_t multiple = row_multiple(r->level_unit[level], j < i ? r->distance_unit[log] : r->diagonal_unit);
        int32_t entry[9] = {0};
        if (block->column == j) {
            for (int k = 0; k < 9; k++)
                entry[k] = block->value[k] / (int32_t)multiple;
            block++;
        }
        if (j < i)
            column(c, pass, i, j, context, entry);
        else if (pass >= FIT_CONTEXT)
            residual(c, pass, context, false, entry);
    }
}

static int16_t eighths(double x)
{
    return (int16_t)lround(8 * fmax(-4095, fmin(4095, x)));
}

static void kernels_from_tally(struct coder *c)
{
    for (uint32_t k = 0; k < CONTEXTS; k++) {
        const struct tally *t = &c->tally[k];
        double a = t->normal[0] + 1, b = t->normal[1], d = t->normal[2] + 1, determinant = a * d - b * b;
        int16_t *kernel = c->context[k].kernel;
        kernel[0] = eighths((d * t->right[0] - b * t->right[1]) / determinant);
        kernel[1] = eighths((a * t->right[1] - b * t->right[0]) / determinant);
        if (abs(kernel[0]) + abs(kernel[1]) < 4) /* rounds to zero for every direction */
            kernel[0] = kernel[1] = 0;
    }
}

static void turns_from_tally(struct coder *c)
{
    for (uint32_t k = 0; k < CONTEXTS; k++) {
        const struct tally *t = &c->tally[k];
        c->context[k].turn = (int16_t)lround(16 * fmax(-1, fmin(1, t->across / (t->above + 1))));
    }
}

/* Tables for means of magnitudes from 0.2 to 200, in steps of a factor 1.6: one serves all contexts whose residuals are about
 * equally large. */
#define TABLE_OCTAVES (10.0 / (TABLES - 1))

static uint32_t table_for(double values, double magnitudes)
{
    double mean = values > 0 ? magnitudes / values : 0;
    return (uint32_t)fmax(0, fmin(TABLES - 1, log2((mean + 0.02) / 0.2) / TABLE_OCTAVES));
}

/* Plain bits that leave a mean symbol of 2 to 4, and sums of three symbols that call for another table. A number is about
 * twice its magnitude. */
static void shape_table(uint32_t t, struct bank_table *table)
{
    double mean = 0.2 * exp2((t + 0.5) * TABLE_OCTAVES) - 0.02, number = 2 * mean - 0.5 * mean / (1 + mean);
    table->plain = (uint16_t)fmax(0, floor(log2(mean)));
    double sum = 3 * ((number + 0.5) / (1 << table->plain) - 0.5);
    table->low = (uint16_t)lround(0.5 * sum);
    table->high = (uint16_t)fmax(table->low + 1, lround(1.5 * sum));
}

static void contexts_from_tally(struct coder *c)
{
    for (uint32_t k = 0; k < CONTEXTS; k++) {
        const struct tally *t = &c->tally[k];
        double p = (t->coded + 0.4) / (t->columns + 0.8);
        uint32_t g = (uint32_t)fmax(0, fmin(255, floor(256 * p)));
        c->context[k].code = (uint16_t)(g | table_for(t->values[0], t->magnitudes[0]) << 8 |
                                        table_for(t->values[1], t->magnitudes[1]) << 12);
    }
    for (uint32_t t = 0; t < TABLES; t++)
        shape_table(t, &c->table[t]);
}

/* Counts to frequencies of 12 bits that add up; a symbol that does not occur in a table has none. */
static void frequencies(const double count[SYMBOLS], uint16_t upper[SYMBOLS])
{
    double total = 0;
    uint32_t frequency[SYMBOLS], sum = 0, largest = 0;
    for (int s = 0; s < SYMBOLS; s++)
        total += count[s];
    for (uint32_t s = 0; s < SYMBOLS; s++) {
        double share = total > 0 ? count[s] / total : 0;
        frequency[s] = share > 0 ? 1 + (uint32_t)(share * (ROW_SLOTS - SYMBOLS)) : 0;
        sum += frequency[s];
        if (frequency[s] > frequency[largest])
            largest = s;
    }
    frequency[largest] += ROW_SLOTS - sum;
    sum = 0;
    for (int s = 0; s < SYMBOLS; s++)
        upper[s] = (uint16_t)(sum += frequency[s]);
}

/* The steps backwards, words collected from the end; then turned round. */
static int encode(struct coder *c, struct failure *why)
{
    if (c->room - c->words < 2 * c->steps + 2) {
        size_t room = 2 * c->room + 2 * c->steps + 2;
        uint16_t *larger = realloc(c->code, room * sizeof *larger);
        if (!larger)
            return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to code the factor");
        c->code = larger;
        c->room = room;
    }
    uint16_t *first = c->code + c->words, *at = first;
    uint32_t state = ROW_STATE_LOW;
    for (size_t k = c->steps; k-- > 0;) {
        const struct step *s = &c->step[k];
        uint64_t limit = s->frequency ? (uint64_t)s->frequency << (32 - BANK_FACTOR_BITS) : 1ull << (32 - s->bits);
        if (state >= limit) {
            *at++ = (uint16_t)state;
            state >>= 16;
        }
        if (s->frequency)
            state = state / s->frequency * ROW_SLOTS + state % s->frequency + s->start;
        else
            state = state << s->bits | s->start;
    }
    *at++ = (uint16_t)(state >> 16);
    *at++ = (uint16_t)state;
    for (uint16_t *low = first, *high = at - 1; low < high; low++, high--) {
        uint16_t keep = *low;
        *low = *high;
        *high = keep;
    }
    c->words = (size_t)(at - c->code);
    return STATUS_OK;
}

static uint16_t *put(uint16_t *at, const void *words, size_t count)
{
    memcpy(at, words, count * sizeof *at);
    return at + count;
}

/* All that stands before the code. Returns the word behind it. */
static uint16_t *write_head(const struct coder *c, const uint32_t *start, uint16_t *at)
{
    const struct order *o = c->order;
    const struct rounding *r = &c->factor->rounding;
    struct bank_factor header = {.step = (float)c->factor->rounding.step,
                                 .max_blocks = (uint16_t)c->factor->max_blocks,
                                 .levels = (uint8_t)o->levels,
                                 .classes = (uint8_t)c->classes,
                                 .diagonal_unit = r->diagonal_unit};
    at = put(at, &header, sizeof header / 2);
    at = put(at, o->level_first, o->levels);
    at = put(at, o->level_log, o->levels);
    at = put(at, r->level_unit, o->levels);
    at = put(at, r->distance_unit, 64);
    for (uint32_t l = 0; l < o->levels; l++)
        at = put(at, &c->context[l * (c->classes + 1) + c->classes], sizeof *c->context / 2);
    for (uint32_t l = 0; l < o->levels; l++)
        at = put(at, &c->context[l * (c->classes + 1)], c->classes * sizeof *c->context / 2);
    at = put(at, c->table, sizeof c->table / 2);
    at = put(at, o->place, 3 * o->rows);
    for (size_t g = 0; g <= o->rows / 32; g++)
        at = put(at, &start[32 * g], 2);
    for (size_t i = 0; i <= o->rows; i++)
        *at++ = (uint16_t)(start[i] - start[i / 32 * 32]);
    return at;
}

static size_t head_words(const struct coder *c)
{
    size_t n = c->order->rows, levels = c->order->levels;
    return sizeof(struct bank_factor) / 2 + 3 * levels + 64 + sizeof *c->context / 2 * levels * (c->classes + 1) +
           sizeof c->table / 2 + 3 * n + 2 * (n / 32 + 1) + n + 1;
}

static int encode_rows(struct coder *c, uint32_t *start, struct failure *why)
{
    size_t n = c->order->rows;
    int status = STATUS_OK;
    for (enum pass pass = FIT_KERNEL; pass < CODE; pass++) {
        for (size_t i = 0; i < n; i++)
            walk(c, pass, i);
        if (pass == FIT_KERNEL)
            kernels_from_tally(c);
        else if (pass == FIT_TURN)
            turns_from_tally(c);
        else if (pass == FIT_CONTEXT)
            contexts_from_tally(c);
        else
            for (uint32_t t = 0; t < TABLES; t++)
                frequencies(c->count[t], c->table[t].upper);
    }
    for (size_t i = 0; i < n && !status; i++) {
        start[i] = (uint32_t)c->words;
        walk(c, CODE, i);
        status = c->too_long ? failure_set(why, STATUS_CHECK_FAILED, NULL, "take a larger step or --plain",
                                           "row %zu of the factor has an entry that its code does not hold", i)
                             : encode(c, why);
        if (!status && (c->words - start[i / 32 * 32] > UINT16_MAX || c->words > UINT32_MAX / 4))
            status =
                failure_set(why, STATUS_MESH_TOO_LARGE, NULL, "take a larger step or --plain",
                            "the coded rows %zu to %zu are longer than the bank's directory holds", i / 32 * 32, i);
    }
    start[n] = (uint32_t)c->words;
    return status;
}

int row_encode(const struct factor *factor, const struct order *order, unsigned char **bytes, size_t *length,
               struct failure *why)
{
    size_t n = order->rows;
    struct coder *c = calloc(1, sizeof *c);
    uint32_t *start = malloc((n + 1) * sizeof *start);
    *bytes = NULL;
    int status = STATUS_OK;
    if (c) {
        c->factor = factor;
        c->order = order;
        c->classes = factor->rounding.classes;
        c->step = malloc((9 * VALUE_STEPS + 1) * (n + 1) * sizeof *c->step);
    }
    if (!c || !start || !c->step)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to code the factor");
    if (!status)
        status = encode_rows(c, start, why);
    if (!status) {
        *length = 2 * (head_words(c) + c->words + BANK_FACTOR_SPARE);
        *bytes = calloc(1, *length);
        if (!*bytes)
            status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to code the factor");
        else
            memcpy(write_head(c, start, (uint16_t *)*bytes), c->code, 2 * c->words);
    }
    if (c) {
        free(c->step);
        free(c->code);
    }
    free(c);
    free(start);
    return status;
}
