#include "row_encode.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "row_code.h"

enum {
    LEVELS = BANK_FACTOR_LEVELS,
    CONTEXTS = BANK_FACTOR_LEVELS * (BANK_FACTOR_CLASSES + 1),
    TABLES = BANK_FACTOR_TABLES,
    SYMBOLS = BANK_FACTOR_SYMBOLS
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
};

struct coder {
    const struct factor *factor;
    const struct order *order;
    uint32_t classes, tables;
    struct tally tally[CONTEXTS];
    uint16_t context[CONTEXTS];
    int16_t kernel[CONTEXTS][2];
    double count[TABLES][SYMBOLS];
    uint16_t cumulative[TABLES][SYMBOLS + 1];
    struct step *step; /* of one row */
    size_t steps;
    uint16_t *code;
    size_t words, room;
};

/* The passes over all rows: kernels from the entries, contexts from the residuals, frequencies, then the code itself. */
enum pass { FIT_KERNEL, FIT_CONTEXT, FIT_FREQUENCY, CODE };

static uint32_t symbol(uint32_t magnitude)
{
    return magnitude < 4 ? magnitude : row_ilog(magnitude);
}

static void value(struct coder *c, enum pass pass, uint32_t context, int kind, int32_t v)
{
    uint32_t magnitude = (uint32_t)abs(v), s = symbol(magnitude), table = c->context[context] >> (kind ? 12 : 8) & 15u;
    if (pass == FIT_CONTEXT) {
        c->tally[context].values[kind]++;
        c->tally[context].magnitudes[kind] += magnitude;
    } else if (pass == FIT_FREQUENCY)
        c->count[table][s]++;
    else {
        const uint16_t *cumulative = c->cumulative[table];
        c->step[c->steps++] = (struct step){cumulative[s], (uint16_t)(cumulative[s + 1] - cumulative[s]), 0};
        if (s >= 4)
            c->step[c->steps++] = (struct step){magnitude & ((1u << (s / 2 - 1)) - 1), 0, (uint8_t)(s / 2 - 1)};
        if (s > 0)
            c->step[c->steps++] = (struct step){v < 0, 0, 1};
    }
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

/* Column j < i of the row, `entry` its block in multiples. */
static void column(struct coder *c, enum pass pass, size_t i, size_t j, uint32_t context, const int32_t entry[9])
{
    const uint16_t *here = c->order->place + 3 * i, *there = c->order->place + 3 * j;
    int32_t d[3] = {here[0] - there[0], here[1] - there[1], here[2] - there[2]}, v[9] = {0}, any = 0;
    uint32_t d2 = (uint32_t)(d[0] * d[0]) + (uint32_t)(d[1] * d[1]) + (uint32_t)(d[2] * d[2]);
    struct tally *t = &c->tally[context];
    if (pass == FIT_KERNEL) {
        fit_kernel(t, d, entry);
        return;
    }
    if (!row_kernel_void(c->kernel[context]))
        row_kernel(c->kernel[context], d, d2, v);
    for (int k = 0; k < 9; k++) {
        v[k] = entry[k] - v[k];
        any |= v[k];
    }
    if (pass == FIT_CONTEXT)
        t->coded += any != 0;
    if (pass == CODE) {
        uint16_t p = (uint16_t)row_significance(c->context[context]);
        c->step[c->steps++] = (struct step){any ? 0 : p, (uint16_t)(any ? p : ROW_SLOTS - p), 0};
    }
    for (int k = 0; k < 9 && any; k++)
        value(c, pass, context, k % 4 != 0, v[k]);
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
        else
            for (int k = 0; k < 9 && pass != FIT_KERNEL; k++)
                if (k % 3 <= k / 3)
                    value(c, pass, context, k % 4 != 0, entry[k]);
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
        c->kernel[k][0] = eighths((d * t->right[0] - b * t->right[1]) / determinant);
        c->kernel[k][1] = eighths((a * t->right[1] - b * t->right[0]) / determinant);
    }
}

/* A table for each third of an octave of the mean magnitude, as many as there may be: one table serves all contexts whose
 * residuals are about equally large. */
static uint32_t table_for(double values, double magnitudes)
{
    double mean = values > 0 ? magnitudes / values : 0, third = 3 * log2((mean + 0.02) / 0.2);
    return (uint32_t)fmax(0, fmin(TABLES - 1, third * (TABLES - 1) / 24));
}

static void contexts_from_tally(struct coder *c)
{
    for (uint32_t k = 0; k < CONTEXTS; k++) {
        const struct tally *t = &c->tally[k];
        double p = (t->coded + 0.4) / (t->columns + 0.8);
        uint32_t g = (uint32_t)fmax(0, fmin(255, floor(256 * p)));
        c->context[k] = (uint16_t)(g | table_for(t->values[0], t->magnitudes[0]) << 8 |
                                   table_for(t->values[1], t->magnitudes[1]) << 12);
    }
    c->tables = TABLES;
}

/* Counts to frequencies of 12 bits that add up; a symbol that does not occur in a table has none. */
static void frequencies(struct coder *c)
{
    for (uint32_t t = 0; t < TABLES; t++) {
        double total = 0;
        uint32_t frequency[SYMBOLS], sum = 0, largest = 0;
        for (int s = 0; s < SYMBOLS; s++)
            total += c->count[t][s];
        for (uint32_t s = 0; s < SYMBOLS; s++) {
            double share = total > 0 ? c->count[t][s] / total : 0;
            frequency[s] = share > 0 ? 1 + (uint32_t)(share * (ROW_SLOTS - SYMBOLS)) : 0;
            sum += frequency[s];
            if (frequency[s] > frequency[largest])
                largest = s;
        }
        frequency[largest] += ROW_SLOTS - sum;
        c->cumulative[t][0] = 0;
        for (int s = 0; s < SYMBOLS; s++)
            c->cumulative[t][s + 1] = (uint16_t)(c->cumulative[t][s] + frequency[s]);
    }
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
    struct bank_factor header = {.step = (float)r->step,
                                 .max_blocks = (uint16_t)c->factor->max_blocks,
                                 .levels = (uint8_t)o->levels,
                                 .classes = (uint8_t)c->classes,
                                 .tables = (uint8_t)c->tables,
                                 .diagonal_unit = r->diagonal_unit};
    at = put(at, &header, sizeof header / 2);
    at = put(at, o->level_first, o->levels);
    at = put(at, o->level_log, o->levels);
    at = put(at, r->level_unit, o->levels);
    at = put(at, r->distance_unit, 64);
    at = put(at, c->context, o->levels * (c->classes + 1));
    for (uint32_t l = 0; l < o->levels; l++)
        at = put(at, c->kernel[l * (c->classes + 1)], 2 * c->classes);
    at = put(at, c->cumulative, c->tables * (SYMBOLS + 1));
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
    return sizeof(struct bank_factor) / 2 + 3 * levels + 64 + levels * (c->classes + 1) + 2 * levels * c->classes +
           c->tables * (SYMBOLS + 1) + 3 * n + 2 * (n / 32 + 1) + n + 1;
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
        else if (pass == FIT_CONTEXT)
            contexts_from_tally(c);
        else
            frequencies(c);
    }
    for (size_t i = 0; i < n && !status; i++) {
        start[i] = (uint32_t)c->words;
        walk(c, CODE, i);
        status = encode(c, why);
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
        c->step = malloc((28 * n + 32) * sizeof *c->step); /* significance and 9 values of up to 3 steps per column */
    }
    if (!c || !start || !c->step)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to code the factor");
    if (!status)
        status = encode_rows(c, start, why);
    if (!status) {
        *length = 2 * (head_words(c) + c->words);
        *bytes = malloc(*length);
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
