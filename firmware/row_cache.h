/* Compliance between the rows that are in use: decoded once, kept in RAM, and paid for in portions.
 *
 * With a factor bank (section FACT) the block G_ij costs two decoded rows and their dot product, too much to do for a
 * whole contact in one tick. So rows stay decoded in slots, products stay in a table over pairs of slots, and a tick does
 * at most ROW_CACHE_WORK of either, or what the bank says (CONT row_work). What is needed now comes first, in the order asked; what will be needed soon
 * (row_cache_expect) uses what is left. A contact whose rows are not there yet waits (contact.h says how).
 * With a plain bank (GHLF) there is nothing to prepare: every block is read in place and no memory is needed.
 *
 * Work is counted in instructions of a Cortex-M7, true to a tenth (fitted to portions and products counted in the emulator;
 * tests/rig/budgets.t holds it against them), so what a tick spends on rows is bounded on purpose, not by luck.
 *
 * Memory, given at start: ROW_CACHE_SLOTS rows of row_max_blocks blocks of 20 bytes, and the table, 36 bytes per pair.
 * The number of slots is fixed, since what is ready when depends on it, and torques shall not depend on the board. */
#ifndef TROCAR_ROW_CACHE_H
#define TROCAR_ROW_CACHE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bank_view.h"
#include "row.h"

enum {
    ROW_CACHE_SLOTS = 48,    /* rows in use at once: 16 contacts on triangles of their own */
    ROW_CACHE_PORTION = 32,  /* columns that are read between two looks at the work left */
    ROW_CACHE_WORK = 240000, /* per tick: 480 thousand less what seven contacts take at most (host/bank/worst_tick.h) */
    ROW_CACHE_COLUMN_WORK = 58, /* a column looked at, */
    ROW_CACHE_BLOCK_WORK = 255, /* a block found, */
    ROW_CACHE_WORD_WORK = 112,  /* a word of code read, */
    ROW_CACHE_STEP_WORK = 2,    /* in a product a block of either row, */
    ROW_CACHE_DOT_WORK = 72,    /* and a pair of blocks in one column */
    ROW_CACHE_BLOCK_WORDS = 6,  /* words of a block, at most on the average of a portion: ten bits a value */
    ROW_CACHE_NO_SLOT = 0xFF,
    ROW_CACHE_HINTS = 256
};

struct row_cache_slot {
    bool held, ready; /* holds a row; the row is complete */
    uint16_t row;
    uint32_t blocks; /* read so far */
    uint32_t used;   /* tick in which it was last asked for */
    uint64_t known;  /* bit t: the product with slot t is in the table */
    struct row_reader reader;
};

struct row_cache {
    struct row_block *blocks;                              /* slot s: from s * stride */
    float (*pair)[9];                                      /* slots s >= t: G between them at s (s + 1) / 2 + t */
    uint32_t stride;                                       /* 0: plain bank */
    float scale;                                           /* step squared */
    uint32_t tick, work, work_limit;                       /* work: done in this tick */
    uint64_t prepared;                                     /* bit s: slot s was prepared in this tick */
    uint32_t rows_read, rows_dropped, products, most_work; /* counters; most_work: of one tick */
    uint8_t
        hint[ROW_CACHE_HINTS]; /* row modulo ROW_CACHE_HINTS: the slot where such a row was last seen, to look first */
    struct row_cache_slot slot[ROW_CACHE_SLOTS];
};

/* Memory that a bank needs, bytes; 0 for a plain bank. */
size_t row_cache_memory(const struct bank_view *bank);

/* `memory`: `bytes` bytes, aligned to 4, kept by the caller. False when they are fewer than row_cache_memory. */
bool row_cache_start(struct row_cache *g, const struct bank_view *bank, void *memory, size_t bytes);

/* Start of a tick: no work is done yet. */
void row_cache_begin(struct row_cache *g);

/* A slot for `row`, which is now in use in this tick; ROW_CACHE_NO_SLOT when all are in use. Does no reading yet. */
uint8_t row_cache_slot(struct row_cache *g, const struct bank_view *bank, uint16_t row);

/* Have the rows of `slots` ready, and the products of those from `first` on with all of them (the caller has prepared the
 * others). False when the tick's work ran out: ask again in the next. The work may be passed by one portion or product. */
bool row_cache_prepare(struct row_cache *g, const uint8_t *slots, uint32_t first, uint32_t count);

/* A row that may be wanted soon: read on with the work that is left, and its products with what has been prepared. */
void row_cache_expect(struct row_cache *g, const struct bank_view *bank, uint16_t row);

/* G between two prepared slots, row-major, m/N; its transpose when *turned. */
const float *row_cache_pair(const struct row_cache *g, uint8_t slot, uint8_t other, bool *turned);

#endif
