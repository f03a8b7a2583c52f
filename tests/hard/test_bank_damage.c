/* A damaged bank: cut anywhere, any bit turned over, or rewritten at random with right checksums. The first two are always
 * refused; whatever the third lets pass is safe to read and to run. TROCAR_LONG=1: every cut, every bit, more rewrites. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "bank_fixture.h"
#include "bank.h"
#include "random.h"
#include "tick.h"

static unsigned char *bytes;
static size_t length;
static bool thorough;

static int setup(void **state)
{
    (void)state;
    struct bank_fixture_options o = bank_fixture_default;
    o.subdivisions = 1;
    bytes = bank_fixture(&o, &length);
    thorough = getenv("TROCAR_LONG") != NULL;
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    free(bytes);
    return 0;
}

/* In memory of exactly this length, so that the sanitizer sees a byte too far. */
static int open_cut(size_t cut)
{
    unsigned char *copy = bank_fixture_memory(cut);
    memcpy(copy, bytes, cut);
    struct bank_view view;
    int status = bank_view_open(&view, copy, cut);
    free(copy);
    return status;
}

static void every_cut_is_refused(void **state)
{
    (void)state;
    random_seed("cuts", 1);
    const struct bank_section *s = (const struct bank_section *)(bytes + sizeof(struct bank_header));
    size_t tried = 0;
    for (size_t cut = 0; cut < length; cut += thorough || cut < 1024 ? 1 : 1 + random_below(64), tried++)
        assert_int_equal(open_cut(cut), STATUS_BANK_LENGTH);
    for (int k = 0; k < 8; k++)
        for (int by = -1; by <= 1; by++) {
            assert_int_equal(open_cut(s[k].offset + by), STATUS_BANK_LENGTH);
            if (s[k].offset + s[k].length + by < length)
                assert_int_equal(open_cut(s[k].offset + s[k].length + by), STATUS_BANK_LENGTH);
        }
    print_message("# %zu cuts\n", tried);
}

static void bytes_behind_the_end_are_refused(void **state)
{
    (void)state;
    unsigned char *copy = bank_fixture_memory(length + 16);
    memcpy(copy, bytes, length);
    struct bank_view view;
    for (size_t more = 1; more <= 16; more++)
        assert_int_equal(bank_view_open(&view, copy, length + more), STATUS_BANK_LENGTH);
    free(copy);
}

static void flip(size_t bit)
{
    bytes[bit / 8] ^= (unsigned char)(1 << bit % 8);
}

static void every_flipped_bit_is_refused(void **state)
{
    (void)state;
    random_seed("flips", 2);
    struct bank_view view;
    size_t head = 8 * (sizeof(struct bank_header) + 8 * sizeof(struct bank_section)), tried = 0;
    for (size_t bit = 0; bit < 8 * length; bit += thorough || bit < head ? 1 : 1 + random_below(400), tried++) {
        flip(bit);
        int status = bank_view_open(&view, bytes, length);
        flip(bit);
        if (bit < 32)
            assert_int_equal(status, STATUS_BANK_MAGIC);
        else if (bit < 48)
            assert_int_equal(status, STATUS_BANK_VERSION);
        else
            assert_int_equal(status, STATUS_BANK_CRC);
    }
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
    print_message("# %zu bits\n", tried);
}

/* Read everything that a view offers; what the sum is does not matter. */
static double read_all(const struct bank_view *view)
{
    double sum = 0;
    for (uint32_t v = 0; v < 3 * view->vertex_count; v++)
        sum += (double)view->positions[v] + (double)view->normals[v];
    for (uint32_t t = 0; t < view->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            sum += (double)view->positions[3 * view->triangles[t].vertex[k]] +
                   view->triangles[view->triangles[t].neighbour[k]].vertex[0];
    uint32_t cells = (uint32_t)view->grid->cells[0] * view->grid->cells[1] * view->grid->cells[2];
    for (uint32_t c = 0; c < cells; c++)
        for (uint32_t e = bank_view_cell_start(view, c); e < bank_view_cell_start(view, c + 1); e++)
            sum += view->triangles[view->cell_triangle[e]].vertex[0];
    for (uint32_t v = 0; v < view->vertex_count; v++)
        for (uint32_t w = 0; w < view->vertex_count; w++) {
            float block[9];
            if (view->row_of[v] == BANK_NONE || view->row_of[w] == BANK_NONE)
                continue;
            bank_view_compliance(view, view->row_of[v], view->row_of[w], block);
            sum += (double)block[0] + (double)block[8];
        }
    for (uint32_t k = 0; k < view->header->section_count; k++)
        sum += bank_view_section(view, view->sections[k].tag)->length;
    return sum;
}

/* A controller that runs on the bank: the motors are told finite numbers, whatever the bank says. */
static void run(const struct bank_view *view)
{
    static struct controller c;
    struct tick_output out[TICK_INSTRUMENTS];
    size_t rows = row_cache_memory(view);
    void *memory = rows ? malloc(rows) : NULL;
    assert_int_equal(controller_start(&c, view, memory, rows), STATUS_OK);
    for (unsigned k = 0; k < 60; k++) {
        struct tick_input in[TICK_INSTRUMENTS] = {
            {.fresh = true, .sequence = (uint8_t)(k & 15), .acknowledge = k == 25}};
        for (int a = 0; a < 3; a++) {
            const struct bank_axis *axis = &view->tools[0].axis[a];
            in[0].counts[a] = (uint16_t)((axis->count_zero + (a == 2 ? 30 * k : 0)) % axis->count_modulus);
        }
        tick(&c, view, in, out);
        for (int a = 0; a < 3; a++)
            assert_true(isfinite(out[0].torque[a]));
    }
    free(memory);
}

static void show(const struct bank_view *view)
{
    uint32_t triangle[4];
    double weights[8], displacement[12], *u = malloc(3 * view->vertex_count * sizeof *u);
    struct failure why;
    for (int c = 0; c < 4; c++) {
        triangle[c] = random_below(view->triangle_count);
        weights[2 * c] = 0.3;
        weights[2 * c + 1] = 0.3;
        for (int k = 0; k < 3; k++)
            displacement[3 * c + k] = random_range(-0.01, 0.01);
    }
    int status = field_from_contacts(view, 4, triangle, weights, displacement, u, NULL, &why);
    assert_true(status == STATUS_OK || status == STATUS_BANK_NONFINITE);
    free(u);
}

/* One to four changes anywhere: a bit, a byte, a number that matters, a piece copied over another. */
static void rewrite(unsigned char *copy)
{
    static const uint32_t numbers[] = {0,          1,          2,          15,         16,         0x7FFFFFFF,
                                       0x80000000, 0xFFFFFFFF, 0xFFFF,     0xFFFFFFF0, 0x7F800000, 0x7FC00000,
                                       0xFF800000, 0x00000001, 0x7F7FFFFF, 0x3F800000, 0xBF800000, 0x80000001};
    size_t head = sizeof(struct bank_header) + 8 * sizeof(struct bank_section);
    for (unsigned k = 1 + random_below(4); k > 0; k--) {
        size_t at = random_below((unsigned)(random_below(3) ? length : head)) & ~(size_t)3;
        unsigned how = random_below(5);
        if (how == 0)
            copy[at] ^= (unsigned char)(1 << random_below(8));
        else if (how == 1)
            copy[at + random_below(4)] = (unsigned char)random_bits();
        else if (how == 2)
            memcpy(copy + at, &numbers[random_below(sizeof numbers / sizeof numbers[0])], 4);
        else if (how == 3) {
            uint32_t value;
            memcpy(&value, copy + at, 4);
            value += random_below(9) - 4;
            memcpy(copy + at, &value, 4);
        } else {
            size_t from = random_below((unsigned)length), piece = 1 + random_below(64);
            piece = from + piece > length ? length - from : piece;
            piece = at + piece > length ? length - at : piece;
            memmove(copy + at, copy + from, piece);
        }
    }
}

static void rewritten_banks_are_refused_or_safe(void **state)
{
    (void)state;
    random_seed("rewrites", 3);
    unsigned char *copy = bank_fixture_memory(length);
    size_t rounds = thorough ? 400000 : 6000, passed = 0;
    for (size_t k = 0; k < rounds; k++) {
        memcpy(copy, bytes, length);
        rewrite(copy);
        struct bank_header *h = (struct bank_header *)copy;
        if (random_below(8)) { /* mostly past the first checks, to reach the later ones */
            memcpy(copy, bytes, 16);
            h->section_count = 8;
        }
        bank_fixture_seal(copy, length);
        struct bank_view view;
        int status = bank_view_open(&view, copy, length);
        if (status) {
            assert_in_range(-status, -STATUS_BANK_MAGIC, -STATUS_BANK_ALIGNMENT);
            continue;
        }
        passed++;
        assert_false(isnan(read_all(&view)));
        run(&view);
        show(&view);
    }
    print_message("# %zu of %zu rewritten banks were readable\n", passed, rounds);
    assert_true(passed > rounds / 100); /* or the test reaches nothing */
    free(copy);
}

static void garbage_is_not_a_bank(void **state)
{
    (void)state;
    random_seed("garbage", 4);
    unsigned char *junk = bank_fixture_memory(4096);
    struct bank_view view;
    for (int k = 0; k < 2000; k++) {
        for (size_t b = 0; b < 4096; b++)
            junk[b] = (unsigned char)random_bits();
        assert_int_equal(bank_view_open(&view, junk, 8 + random_below(4089)), STATUS_BANK_MAGIC);
    }
    free(junk);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_cut_is_refused),         cmocka_unit_test(bytes_behind_the_end_are_refused),
        cmocka_unit_test(every_flipped_bit_is_refused), cmocka_unit_test(rewritten_banks_are_refused_or_safe),
        cmocka_unit_test(garbage_is_not_a_bank),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
