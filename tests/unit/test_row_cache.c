/* The row cache: what it hands out is the bank's compliance, its work stays within the tick, and the controller on a
 * factor bank renders what it renders on the same compliance stored plainly. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "factor_fixture.h"
#include "random.h"
#include "row_cache.h"
#include "tick_bench.h"

/* Only the compressed bank of the fixture. */
static unsigned char *compressed(const struct bank_fixture_options *options, double step, size_t *length)
{
    struct factor_fixture f;
    assert_int_equal(factor_fixture(options, step, &f), STATUS_OK);
    unsigned char *bytes = f.bytes;
    f.bytes = NULL;
    *length = f.length;
    factor_fixture_free(&f);
    return bytes;
}

/* One portion or product may pass the limit: a portion of columns all of which hold a block, the longest product. */
static uint32_t work_bound(const struct bank_view *bank)
{
    uint32_t block = ROW_CACHE_COLUMN_WORK + ROW_CACHE_BLOCK_WORK + ROW_CACHE_BLOCK_WORDS * ROW_CACHE_WORD_WORK;
    uint32_t portion = ROW_CACHE_PORTION * block;
    uint32_t product = row_max_blocks(bank) * (2 * ROW_CACHE_STEP_WORK + ROW_CACHE_DOT_WORK);
    return ROW_CACHE_WORK + (portion > product ? portion : product);
}

static void blocks_are_those_of_the_bank_whatever_was_asked_before(void **state)
{
    (void)state;
    size_t length;
    struct bank_fixture_options o = bank_fixture_default;
    o.subdivisions = 3;
    unsigned char *bytes = compressed(&o, 0.003, &length);
    struct bank_view bank;
    assert_int_equal(bank_view_open(&bank, bytes, length), STATUS_OK);
    size_t room = row_cache_memory(&bank);
    void *memory = malloc(room);
    static struct row_cache g;
    assert_false(row_cache_start(&g, &bank, memory, room - 1));
    assert_true(row_cache_start(&g, &bank, memory, room));
    printf("# %u rows, longest %u blocks, %zu bytes of memory\n", bank.row_count, row_max_blocks(&bank), room);
    random_seed("requests", 40);
    unsigned checked = 0, unfinished = 0;
    for (int tick = 0; tick < 3000; tick++) {
        uint8_t slots[ROW_CACHE_SLOTS];
        uint16_t rows[ROW_CACHE_SLOTS];
        uint32_t count = 1 + random_below(12);
        unsigned place = random_below(bank.row_count);
        row_cache_begin(&g);
        for (uint32_t i = 0; i < count; i++) { /* some again and again, some from anywhere */
            rows[i] = (uint16_t)(random_below(3) ? (place / 7 + 3 * i) % bank.row_count : random_below(bank.row_count));
            slots[i] = row_cache_slot(&g, &bank, rows[i]);
            assert_true(slots[i] != ROW_CACHE_NO_SLOT);
        }
        bool ready = row_cache_prepare(&g, slots, 0, count);
        unfinished += !ready;
        assert_true(g.most_work <= work_bound(&bank));
        for (uint32_t i = 0; ready && i < count; i++)
            for (uint32_t j = 0; j < count; j++) {
                float direct[9];
                bool turned;
                const float *cached = row_cache_pair(&g, slots[i], slots[j], &turned);
                bank_view_compliance(&bank, rows[i], rows[j], direct);
                for (int e = 0; e < 9; e++) {
                    float of_cache = cached[turned ? 3 * (e % 3) + e / 3 : e];
                    assert_true(fabsf(of_cache - direct[e]) <= 2e-7f * fabsf(direct[e]));
                }
                checked++;
            }
    }
    printf("# %u blocks compared, %u requests not ready in their tick, %u rows read, %u dropped, most work %u\n",
           checked, unfinished, g.rows_read, g.rows_dropped, g.most_work);
    assert_true(checked > 10000 && unfinished > 0 && g.rows_dropped > 100);
    free(memory);
    free(bytes);
}

static void slots_in_use_are_never_taken_away(void **state)
{
    (void)state;
    size_t length;
    unsigned char *bytes = compressed(NULL, 0.01, &length);
    struct bank_view bank;
    assert_int_equal(bank_view_open(&bank, bytes, length), STATUS_OK);
    size_t room = row_cache_memory(&bank);
    void *memory = malloc(room);
    static struct row_cache g;
    assert_true(row_cache_start(&g, &bank, memory, room));
    row_cache_begin(&g);
    uint64_t taken = 0;
    for (uint16_t row = 0; row < ROW_CACHE_SLOTS; row++) {
        uint8_t s = row_cache_slot(&g, &bank, row);
        assert_false(taken >> s & 1);
        taken |= (uint64_t)1 << s;
        assert_int_equal(row_cache_slot(&g, &bank, row), s);
    }
    assert_int_equal(row_cache_slot(&g, &bank, ROW_CACHE_SLOTS), ROW_CACHE_NO_SLOT);
    free(memory);
    free(bytes);
}

/* A bank whose factor's compliance is stored plainly as well: every block as the factor gives it. */
static unsigned char *plain_copy(const struct bank_view *factor, size_t *length)
{
    uint32_t n = factor->row_count;
    struct fixture_part part[BANK_MAX_SECTIONS];
    float *half = malloc((size_t)n * (n + 1) / 2 * 36);
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t j = 0; j <= i; j++)
            bank_view_compliance(factor, i, j, half + 9 * ((size_t)i * (i + 1) / 2 + j));
    unsigned parts = factor->header->section_count;
    for (unsigned k = 0; k < parts; k++) {
        const struct bank_section *s = &factor->sections[k];
        part[k] = (struct fixture_part){s->tag,   s->flags,  s->version,
                                        s->count, s->length, (unsigned char *)factor->header + s->offset};
        if (s->tag == BANK_FACT)
            part[k] = (struct fixture_part){BANK_GHLF, BANK_REQUIRED, 1, n, n * (n + 1) / 2 * 36, half};
    }
    unsigned char *bytes = bank_fixture_join(part, parts, length);
    free(half);
    return bytes;
}

static void open_bench(struct bench *b, unsigned char *bytes, size_t length)
{
    memset(b, 0, sizeof *b);
    b->bytes = bytes;
    assert_int_equal(bank_view_open(&b->bank, bytes, length), STATUS_OK);
    size_t rows = row_cache_memory(&b->bank);
    b->rows = rows ? malloc(rows) : NULL;
    assert_int_equal(node_start(&b->node, &b->bank, 1, b->rows, rows), STATUS_OK);
    node_transmit(&b->node, &b->boot);
}

static void force_of(const struct bench *b, double f[3])
{
    for (int k = 0; k < 3; k++)
        f[k] = (double)b->node.controller.contact.force_N[0][k];
}

/* Press, slide at 0.3 m/s, and jump between places: the same forces as with everything at hand, but for the ticks after
 * a jump or a first touch; there the force is late, never wrong by more than what it lacks. */
static void a_factor_bank_feels_like_a_plain_one(void **state)
{
    (void)state;
    struct bank_fixture_options o = bank_fixture_default;
    o.subdivisions = 3;
    size_t length, plain_length;
    unsigned char *bytes = compressed(&o, 0.003, &length);
    struct bench *b = calloc(2, sizeof *b);
    open_bench(&b[0], bytes, length);
    unsigned char *plain = plain_copy(&b[0].bank, &plain_length);
    open_bench(&b[1], plain, plain_length);
    for (int k = 0; k < 2; k++)
        bench_start(&b[k], 0, 0, 0.10);
    double peak = 0, worst_step = 0, last[3] = {0};
    unsigned late = 0, contact = 0;
    for (int i = 0; i < 6000; i++) {
        /* Down, then circles of 25 mm at up to 0.3 m/s over the sphere's top. */
        double angle = i < 500 ? 0 : (i - 500) * 0.012, reach = i < 500 ? 0 : 0.2 * fmin(1, (i - 500) / 500.0);
        double q[3] = {reach * cos(angle), reach * sin(angle), 0.10 + 0.027 * fmin(1, i / 500.0)};
        double f[2][3], difference = 0, step = 0, size = 0;
        for (int k = 0; k < 2; k++) {
            bench_tick(&b[k], q[0], q[1], q[2]);
            force_of(&b[k], f[k]);
        }
        for (int k = 0; k < 3; k++) {
            difference += (f[0][k] - f[1][k]) * (f[0][k] - f[1][k]);
            step += (f[0][k] - last[k]) * (f[0][k] - last[k]);
            size += f[1][k] * f[1][k];
            last[k] = f[0][k];
        }
        peak = fmax(peak, sqrt(size));
        contact += b[1].node.controller.contact.count > 0;
        late += sqrt(difference) > 1e-4 * peak;
        worst_step = fmax(worst_step, sqrt(step));
    }
    const struct controller *c = &b[0].node.controller;
    printf(
        "# peak %.3f N, %u of %u ticks in contact differ, %u contacts held, %u waited; largest step %.4f N; work %u\n",
        peak, late, contact, c->contact.held, c->contact.waiting, worst_step, c->rows.most_work);
    assert_true(contact > 4000 && late < contact / 50);
    assert_true(worst_step < 0.05 * peak);
    assert_true(c->rows.most_work <= work_bound(&b[0].bank));

    /* Still after a jump: all contacts are there within a bounded number of ticks, and the force is the plain one. */
    unsigned slowest = 0;
    random_seed("jumps", 41);
    double from[2] = {0.2 * cos(5500 * 0.012), 0.2 * sin(5500 * 0.012)};
    for (int jump = 0; jump < 40; jump++) {
        double q[2] = {random_range(-0.25, 0.25), random_range(-0.25, 0.25)};
        for (int k = 0; k < 2; k++) { /* lift, cross over within 60 ms, come down within 4 ms */
            for (int i = 0; i < 4; i++)
                bench_tick(&b[k], from[0], from[1], 0.127 - 0.0055 * i);
            for (int i = 0; i <= 60; i++)
                bench_tick(&b[k], from[0] + (q[0] - from[0]) * i / 60, from[1] + (q[1] - from[1]) * i / 60, 0.105);
            for (int i = 1; i <= 4; i++)
                bench_tick(&b[k], q[0], q[1], 0.105 + 0.0055 * i);
        }
        unsigned ticks = 0;
        double f[2][3], difference = 1, size = 0;
        while (difference > 1e-4 * peak && ticks < 100) {
            difference = 0;
            for (int k = 0; k < 2; k++) {
                bench_tick(&b[k], q[0], q[1], 0.127);
                force_of(&b[k], f[k]);
            }
            for (int k = 0; k < 3; k++)
                difference += fabs(f[0][k] - f[1][k]);
            ticks++;
        }
        for (int k = 0; k < 3; k++)
            size += f[1][k] * f[1][k];
        memcpy(from, q, sizeof from);
        slowest = ticks > slowest ? ticks : slowest;
        assert_int_equal(b[0].node.controller.instrument[0].safety.state, SAFETY_RUN);
    }
    printf("# after a jump of the tool into the body the force is complete within %u ticks\n", slowest);
    assert_true(slowest <= 30);
    bench_close(&b[0]);
    bench_close(&b[1]);
    free(b);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(blocks_are_those_of_the_bank_whatever_was_asked_before),
        cmocka_unit_test(slots_in_use_are_never_taken_away),
        cmocka_unit_test(a_factor_bank_feels_like_a_plain_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
