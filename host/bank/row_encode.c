#include "row_encode.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "row_code.h"

enum { TABLES = 2 * (BANK_FACTOR_CLASSES + 1), SYMBOLS = BANK_FACTOR_SYMBOLS };

/* One step of the coder: an interval of the 2^12, or plain bits (frequency 0). */
struct step {
    uint16_t start, frequency;
    uint8_t bits;
};

struct coder {
    const struct factor *factor;
    const struct order *order;
    uint32_t classes;
    double blocks[BANK_FACTOR_CLASSES], candidates[BANK_FACTOR_CLASSES];
    double count[TABLES][SYMBOLS];
    uint16_t significant[BANK_FACTOR_CLASSES];
    uint16_t cumulative[TABLES][SYMBOLS + 1];
    struct step *step; /* of one row */
    size_t steps;
    uint16_t *code;
    size_t words, room;
};

static uint32_t symbol(uint32_t magnitude)
{
    return magnitude < 4 ? magnitude : row_ilog(magnitude);
}

/* A walk over one row, first to count, then to list the coder's steps. */
static void value(struct coder *c, uint32_t table, int32_t v, bool count)
{
    uint32_t magnitude = (uint32_t)abs(v), s = symbol(magnitude);
    if (count) {
        c->count[table][s]++;
        return;
    }
    const uint16_t *cumulative = c->cumulative[table];
    c->step[c->steps++] = (struct step){cumulative[s], (uint16_t)(cumulative[s + 1] - cumulative[s]), 0};
    if (s >= 4)
        c->step[c->steps++] = (struct step){magnitude & ((1u << (s / 2 - 1)) - 1), 0, (uint8_t)(s / 2 - 1)};
    if (s > 0)
        c->step[c->steps++] = (struct step){v < 0, 0, 1};
}

static void walk(struct coder *c, size_t i, bool count)
{
    const struct factor *f = c->factor;
    const struct row_block *block = f->block + f->start[i];
    c->steps = 0;
    for (size_t j = 0; j < i; j++) {
        uint32_t class = order_class(c->order, i, j);
        if (class >= c->classes)
            continue;
        bool is = block->column == j;
        if (count) {
            c->candidates[class]++;
            c->blocks[class] += is;
        } else {
            uint16_t p = c->significant[class];
            c->step[c->steps++] = (struct step){is ? 0 : p, (uint16_t)(is ? p : ROW_SLOTS - p), 0};
        }
        if (!is)
            continue;
        for (int k = 0; k < 9; k++)
            value(c, 2 * class + (k % 4 != 0), block->value[k] / f->rounding.multiple[class], count);
        block++;
    }
    for (int a = 0; a < 3; a++)
        for (int b = 0; b <= a; b++)
            value(c, 2 * c->classes + (a != b), block->value[3 * a + b] / f->rounding.multiple[c->classes], count);
}

/* Counts to frequencies of 12 bits, at least 1 for every symbol: some other bank's row may need it, and costs nothing. */
static void fit(struct coder *c)
{
    for (uint32_t k = 0; k < c->classes; k++) {
        double p = (c->blocks[k] + 0.4) / (c->candidates[k] + 0.8) * ROW_SLOTS;
        c->significant[k] = (uint16_t)(p < 1 ? 1 : p > ROW_SLOTS - 1 ? ROW_SLOTS - 1 : p + 0.5);
    }
    for (uint32_t t = 0; t < 2 * (c->classes + 1); t++) {
        double total = 0;
        uint32_t frequency[SYMBOLS], sum = 0, largest = 0;
        for (int s = 0; s < SYMBOLS; s++)
            total += c->count[t][s];
        for (uint32_t s = 0; s < SYMBOLS; s++) {
            frequency[s] = 1 + (total > 0 ? (uint32_t)(c->count[t][s] / total * (ROW_SLOTS - SYMBOLS)) : 0);
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

/* All that stands before the code. Returns its words, the header's included. */
static size_t write_head(const struct coder *c, const uint32_t *start, uint16_t *out)
{
    const struct order *o = c->order;
    struct bank_factor header = {.step = (float)c->factor->rounding.step,
                                 .max_blocks = (uint16_t)c->factor->max_blocks,
                                 .levels = (uint8_t)o->levels,
                                 .classes = (uint8_t)c->classes};
    uint16_t *at = out;
    memcpy(at, &header, sizeof header);
    at += sizeof header / 2;
    for (uint32_t k = 0; k < o->levels; k++)
        *at++ = o->level_first[k];
    for (uint32_t k = 0; k < o->levels; k++)
        *at++ = o->level_log[k];
    for (uint32_t k = 0; k < c->classes; k++)
        *at++ = c->significant[k];
    for (uint32_t k = 0; k <= c->classes; k++)
        *at++ = c->factor->rounding.multiple[k];
    memcpy(at, c->cumulative, 2 * (c->classes + 1) * sizeof c->cumulative[0]);
    at += 2 * (c->classes + 1) * (SYMBOLS + 1);
    memcpy(at, o->place, 3 * o->rows * sizeof *at);
    at += 3 * o->rows;
    for (size_t g = 0; g <= o->rows / 32; g++) {
        *at++ = (uint16_t)start[32 * g];
        *at++ = (uint16_t)(start[32 * g] >> 16);
    }
    for (size_t i = 0; i <= o->rows; i++)
        *at++ = (uint16_t)(start[i] - start[i / 32 * 32]);
    return (size_t)(at - out);
}

static int encode_rows(struct coder *c, uint32_t *start, struct failure *why)
{
    size_t n = c->order->rows;
    int status = STATUS_OK;
    for (size_t i = 0; i < n; i++)
        walk(c, i, true);
    fit(c);
    for (size_t i = 0; i < n && !status; i++) {
        start[i] = (uint32_t)c->words;
        walk(c, i, false);
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
        *c = (struct coder){.factor = factor, .order = order, .classes = factor->rounding.classes};
        c->step = malloc((28 * n + 32) * sizeof *c->step); /* significance and 9 values of up to 3 steps per column */
    }
    if (!c || !start || !c->step)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to code the factor");
    if (!status)
        status = encode_rows(c, start, why);
    if (!status) {
        size_t head = 8 + 2 * (size_t)order->levels + 2 * c->classes + 1 + 2 * (c->classes + 1) * (SYMBOLS + 1) +
                      3 * n + 2 * (n / 32 + 1) + n + 1;
        *length = 2 * (head + c->words);
        *bytes = malloc(*length);
        if (!*bytes)
            status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to code the factor");
        else
            memcpy((uint16_t *)*bytes + write_head(c, start, (uint16_t *)*bytes), c->code, 2 * c->words);
    }
    if (c) {
        free(c->step);
        free(c->code);
    }
    free(c);
    free(start);
    return status;
}
