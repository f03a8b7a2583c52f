#include "row_cache.h"

enum { PAIRS = ROW_CACHE_SLOTS * (ROW_CACHE_SLOTS + 1) / 2 };

/* Place of the pair of two slots in the table. */
static uint32_t place(uint32_t high, uint32_t low)
{
    return high * (high + 1) / 2 + low;
}

size_t row_cache_memory(const struct bank_view *bank)
{
    uint32_t stride = row_max_blocks(bank);
    return stride == 0 ? 0 : ROW_CACHE_SLOTS * (size_t)stride * sizeof(struct row_block) + PAIRS * 9 * sizeof(float);
}

bool row_cache_start(struct row_cache *g, const struct bank_view *bank, void *memory, size_t bytes)
{
    uint32_t work = bank->contact->row_work;
    *g = (struct row_cache){.stride = row_max_blocks(bank),
                            .work_limit = work ? work * BANK_ROW_WORK_UNIT : ROW_CACHE_WORK};
    if (g->stride == 0)
        return true;
    if (!memory || bytes < row_cache_memory(bank))
        return false;
    g->pair = (float(*)[9])memory; /* floats first: the blocks need only 2-byte alignment */
    g->blocks = (struct row_block *)(void *)(g->pair + PAIRS);
    g->scale = bank->factor.header->step * bank->factor.header->step;
    return true;
}

void row_cache_begin(struct row_cache *g)
{
    g->tick++;
    g->work = 0;
    g->prepared = 0;
}

static void spend(struct row_cache *g, uint32_t work)
{
    g->work += work;
    g->most_work = g->work > g->most_work ? g->work : g->most_work;
}

static bool may_work(const struct row_cache *g)
{
    return g->work < g->work_limit;
}

uint8_t row_cache_slot(struct row_cache *g, const struct bank_view *bank, uint16_t row)
{
    uint32_t oldest = ROW_CACHE_NO_SLOT;
    uint8_t *hint = &g->hint[row % ROW_CACHE_HINTS];
    struct row_cache_slot *likely = &g->slot[*hint];
    if (likely->held && likely->row == row) {
        likely->used = g->tick;
        return *hint;
    }
    for (uint32_t s = 0; s < ROW_CACHE_SLOTS; s++) { /* bound: ROW_CACHE_SLOTS */
        struct row_cache_slot *slot = &g->slot[s];
        if (slot->held && slot->row == row) {
            slot->used = g->tick;
            *hint = (uint8_t)s;
            return (uint8_t)s;
        }
        if (slot->held && slot->used == g->tick)
            continue;
        if (oldest == ROW_CACHE_NO_SLOT || !slot->held ||
            (g->slot[oldest].held && g->tick - slot->used > g->tick - g->slot[oldest].used))
            oldest = s;
    }
    if (oldest == ROW_CACHE_NO_SLOT)
        return ROW_CACHE_NO_SLOT;
    struct row_cache_slot *slot = &g->slot[oldest];
    g->rows_dropped += slot->held;
    for (uint32_t s = 0; s < ROW_CACHE_SLOTS; s++) /* bound: ROW_CACHE_SLOTS */
        g->slot[s].known &= ~((uint64_t)1 << oldest);
    *slot = (struct row_cache_slot){.held = true, .row = row, .used = g->tick};
    row_start(&slot->reader, bank, row);
    *hint = (uint8_t)oldest;
    return (uint8_t)oldest;
}

static const struct row_block *blocks_of(const struct row_cache *g, uint32_t slot)
{
    return g->blocks + (size_t)slot * g->stride;
}

/* Read on until the row is complete or the work is spent. */
static bool read_row(struct row_cache *g, uint32_t s)
{
    struct row_cache_slot *slot = &g->slot[s];
    while (!slot->ready && may_work(g)) { /* bound: rows / ROW_CACHE_PORTION + 1 */
        const uint16_t *word = slot->reader.next;
        uint32_t column = slot->reader.column;
        uint32_t found = row_read(&slot->reader, ROW_CACHE_PORTION, g->blocks + (size_t)s * g->stride + slot->blocks);
        slot->blocks += found;
        slot->ready = row_finished(&slot->reader);
        g->rows_read += slot->ready;
        spend(g, (slot->reader.column - column) * ROW_CACHE_COLUMN_WORK + found * ROW_CACHE_BLOCK_WORK +
                     (uint32_t)(slot->reader.next - word) * ROW_CACHE_WORD_WORK);
    }
    return slot->ready;
}

/* G between two complete rows, into the table. */
static void multiply(struct row_cache *g, uint32_t s, uint32_t t)
{
    struct row_cache_slot *a = &g->slot[s], *b = &g->slot[t];
    uint32_t high = s > t ? s : t, low = s > t ? t : s;
    int32_t sum[9];
    uint32_t common = row_dot(blocks_of(g, high), g->slot[high].blocks, blocks_of(g, low), g->slot[low].blocks, sum);
    float *block = g->pair[place(high, low)];
    for (int e = 0; e < 9; e++) /* bound: 9 */
        block[e] = g->scale * (float)sum[e];
    a->known |= (uint64_t)1 << t;
    b->known |= (uint64_t)1 << s;
    g->products++;
    spend(g, (a->blocks + b->blocks) * ROW_CACHE_STEP_WORK + common * ROW_CACHE_DOT_WORK);
}

/* Number of the lowest bit that is set, in words of 32 bits: there is no library to do it in 64. */
static uint32_t lowest(uint64_t set)
{
    uint32_t low = (uint32_t)set;
    return low ? (uint32_t)__builtin_ctz(low) : 32u + (uint32_t)__builtin_ctz((uint32_t)(set >> 32));
}

/* The products of a row with those of a set, all complete. False when the work ran out before the last. */
static bool multiply_all(struct row_cache *g, uint32_t s, uint64_t set)
{
    for (uint64_t lacking = set & ~g->slot[s].known; lacking; lacking &= lacking - 1) { /* bound: ROW_CACHE_SLOTS */
        if (!may_work(g))
            return false;
        multiply(g, s, lowest(lacking));
    }
    return true;
}

bool row_cache_prepare(struct row_cache *g, const uint8_t *slots, uint32_t first, uint32_t count)
{
    uint64_t set = 0;
    for (uint32_t i = first; i < count; i++) /* bound: ROW_CACHE_SLOTS */
        if (!read_row(g, slots[i]))
            return false;
    for (uint32_t i = 0; i < count; i++) { /* bound: ROW_CACHE_SLOTS */
        set |= (uint64_t)1 << slots[i];
        if (i >= first && !multiply_all(g, slots[i], set))
            return false;
    }
    g->prepared |= set;
    return true;
}

void row_cache_expect(struct row_cache *g, const struct bank_view *bank, uint16_t row)
{
    if (g->stride == 0 || row == BANK_NONE || !may_work(g))
        return;
    uint8_t s = row_cache_slot(g, bank, row);
    if (s != ROW_CACHE_NO_SLOT && read_row(g, s))
        multiply_all(g, s, g->prepared | (uint64_t)1 << s);
}

const float *row_cache_pair(const struct row_cache *g, uint8_t slot, uint8_t other, bool *turned)
{
    *turned = slot < other;
    return g->pair[*turned ? place(other, slot) : place(slot, other)];
}
