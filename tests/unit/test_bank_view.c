/* Every rule of a bank, broken one at a time in a bank whose checksums are right: each is refused with its own status and
 * the section and record at fault. */
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "bank_fixture.h"
#include "bank_view.h"
#include "tick.h"

static unsigned char *bytes;
static size_t length;
static unsigned char *pristine;

static int setup(void **state)
{
    (void)state;
    struct bank_fixture_options o = bank_fixture_default;
    o.subdivisions = 1;
    o.instruments = 2;
    pristine = bank_fixture(&o, &length);
    bytes = bank_fixture_memory(length + 64);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    free(pristine);
    free(bytes);
    return 0;
}

static void *section(uint32_t tag)
{
    return bytes + bank_fixture_section(bytes, tag)->offset;
}

static void fresh(void)
{
    memcpy(bytes, pristine, length);
}

/* Seal what was broken, open, expect. */
static void refused(int status, uint32_t tag, uint32_t record)
{
    struct bank_view view;
    bank_fixture_seal(bytes, length);
    assert_int_equal(bank_view_open(&view, bytes, length), status);
    assert_int_equal(view.fault_tag, tag);
    assert_int_equal(view.fault_record, record);
    assert_null(view.header);
    assert_null(view.positions);
    fresh();
}

static void the_synthetic_bank_is_good(void **state)
{
    (void)state;
    struct bank_view view;
    fresh();
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
    assert_int_equal(view.vertex_count, 42);
    assert_int_equal(view.triangle_count, 80);
    assert_int_equal(view.tool_count, 2);
    assert_ptr_equal(view.positions, section(BANK_VERT));
    assert_ptr_equal(view.half, section(BANK_GHLF));
    assert_ptr_equal(view.tools, section(BANK_TOOL));
    assert_null(bank_view_section(&view, BANK_PROV));
}

static void compliance_blocks_of_swapped_rows_are_transposed(void **state)
{
    (void)state;
    struct bank_view view;
    bool skew = false;
    fresh();
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
    for (uint32_t i = 0; i < view.row_count; i++)
        for (uint32_t j = 0; j <= i; j++) {
            float ij[9], ji[9];
            bank_view_compliance(&view, i, j, ij);
            bank_view_compliance(&view, j, i, ji);
            assert_memory_equal(ij, view.half + 9 * (i * (i + 1) / 2 + j), sizeof ij);
            for (int k = 0; k < 9; k++)
                assert_true(ij[k] == ji[3 * (k % 3) + k / 3]);
            skew = skew || ij[1] != ij[3];
        }
    assert_true(skew); /* or the test shows nothing */
}

static void unaligned_bytes(void **state)
{
    (void)state;
    struct bank_view view;
    memcpy(bytes + 8, pristine, length);
    assert_int_equal(bank_view_open(&view, bytes + 8, length), STATUS_BANK_ALIGNMENT);
}

static void header_rules(void **state)
{
    (void)state;
    struct bank_header *h = (struct bank_header *)bytes;
    fresh();
    h->magic ^= 1;
    refused(STATUS_BANK_MAGIC, 0, 0);
    h->format_version = 2;
    refused(STATUS_BANK_VERSION, 0, 0);
    h->header_bytes = 80;
    refused(STATUS_BANK_LENGTH, 0, 0);
    h->total_bytes -= 16;
    refused(STATUS_BANK_LENGTH, 0, 0);
    h->total_bytes += 16;
    refused(STATUS_BANK_LENGTH, 0, 0);
    h->reserved[5] = 1;
    refused(STATUS_BANK_SECTION, 0, 0);
    h->section_count = 0;
    refused(STATUS_BANK_SECTION, 0, 0);
    h->section_count = BANK_MAX_SECTIONS + 1;
    refused(STATUS_BANK_SECTION, 0, 0);
    h->section_count = 0xFFFFFFFF;
    refused(STATUS_BANK_SECTION, 0, 0);
    h->image_abi = FIRMWARE_ABI + 1;
    refused(STATUS_BANK_ABI, 0, 0);
    h->effects = 1u << 31;
    refused(STATUS_BANK_EFFECT, 0, 1u << 31);
}

static void table_rules(void **state)
{
    (void)state;
    struct bank_section *s = (struct bank_section *)(bytes + sizeof(struct bank_header));
    fresh();
    assert_int_equal(s[1].tag, BANK_NORM);
    s[1].reserved[1] = 7;
    refused(STATUS_BANK_SECTION, BANK_NORM, 1);
    s[1].offset += 16; /* a gap */
    refused(STATUS_BANK_SECTION, BANK_NORM, 1);
    s[1].offset = s[0].offset; /* an overlap */
    refused(STATUS_BANK_SECTION, BANK_NORM, 1);
    s[1].offset = 0xFFFFFFF0;
    refused(STATUS_BANK_SECTION, BANK_NORM, 1);
    s[1].length = 0xFFFFFFFF; /* the sum wraps in 32 bits */
    refused(STATUS_BANK_LENGTH, BANK_NORM, 1);
    s[1].length = 0xFFFFFFF1; /* the padded length wraps to 0 */
    refused(STATUS_BANK_LENGTH, BANK_NORM, 1);
    s[8].length -= 16; /* bytes behind the last section */
    refused(STATUS_BANK_LENGTH, 0, 9);
    s[1].flags = 4;
    refused(STATUS_BANK_SECTION, BANK_NORM, 1);
    s[1].flags = BANK_REQUIRED | BANK_HOST_ONLY;
    refused(STATUS_BANK_SECTION, BANK_NORM, 1);
    s[1].flags = 0; /* a controller cannot do without it */
    refused(STATUS_BANK_SECTION, BANK_NORM, 1);
    s[1].version = 2;
    refused(STATUS_BANK_VERSION, BANK_NORM, 1);
    s[1].tag = BANK_VERT;
    refused(STATUS_BANK_SECTION, BANK_VERT, 1);
    s[1].tag = BANK_TAG('N', 'E', 'W', '1');
    refused(STATUS_BANK_REQUIRED, BANK_TAG('N', 'E', 'W', '1'), 1);
    s[1].tag = BANK_TAG('N', 'E', 'W', '1');
    s[1].flags = 0;
    refused(STATUS_BANK_MISSING, BANK_NORM, 0);
    bytes[s[4].offset + s[4].length] = 1; /* padding of ROWS: 84 bytes */
    refused(STATUS_BANK_SECTION, BANK_ROWS, 4);
}

/* Every known tag turned into an unknown, optional one: the bank lacks it. */
static void every_section_is_missed(void **state)
{
    (void)state;
    struct bank_section *s = (struct bank_section *)(bytes + sizeof(struct bank_header));
    fresh();
    for (int k = 0; k < 8; k++) {
        uint32_t tag = s[k].tag;
        s[k].tag = BANK_TAG('x', 'x', 'x', 'x');
        s[k].flags = 0;
        refused(STATUS_BANK_MISSING, tag == BANK_GHLF ? BANK_FACT : tag, 0); /* either of the two will do */
    }
}

/* A count that its length does not hold: huge counts in a small file, and one too many or too few. */
static void counts_are_held_against_lengths(void **state)
{
    (void)state;
    struct bank_section *s = (struct bank_section *)(bytes + sizeof(struct bank_header));
    fresh();
    for (int k = 0; k < 8; k++) {
        uint32_t count = s[k].count, wrong[] = {0, count - 1, count + 1, 65535, 0x55555556, 0x80000000, 0xFFFFFFFF};
        for (size_t w = 0; w < sizeof wrong / sizeof wrong[0]; w++) {
            s[k].count = wrong[w];
            bank_fixture_seal(bytes, length);
            struct bank_view view;
            assert_int_equal(bank_view_open(&view, bytes, length), STATUS_BANK_LENGTH);
            fresh();
        }
    }
}

static void optional_unknown_sections_are_skipped(void **state)
{
    (void)state;
    struct bank_section *s = (struct bank_section *)(pristine + sizeof(struct bank_header));
    struct fixture_part part[11];
    size_t more;
    char text[21] = "what is not known yet";
    part[0] = (struct fixture_part){BANK_TAG('F', 'U', 'T', '1'), 0, 9, 3, sizeof text, text};
    for (int k = 0; k < 9; k++)
        part[k + 1] =
            (struct fixture_part){s[k].tag, s[k].flags, s[k].version, s[k].count, s[k].length, pristine + s[k].offset};
    part[10] = (struct fixture_part){BANK_TAG('F', 'U', 'T', '2'), BANK_HOST_ONLY, 1, 0, 0, text};
    unsigned char *extended = bank_fixture_join(part, 11, &more);
    ((struct bank_header *)extended)->effects = EFFECT_SECOND;
    bank_fixture_seal(extended, more);
    struct bank_view view;
    assert_int_equal(bank_view_open(&view, extended, more), STATUS_OK);
    assert_int_equal(bank_view_section(&view, BANK_TAG('F', 'U', 'T', '1'))->length, sizeof text);
    assert_int_equal(view.vertex_count, 42);
    free(extended);
    part[0].flags = BANK_REQUIRED;
    extended = bank_fixture_join(part, 10, &more);
    assert_int_equal(bank_view_open(&view, extended, more), STATUS_BANK_REQUIRED);
    assert_int_equal(view.fault_tag, BANK_TAG('F', 'U', 'T', '1'));
    free(extended);
}

static const float bad_float[] = {NAN, INFINITY, -INFINITY, FLT_MAX};

static void vertices_and_normals(void **state)
{
    (void)state;
    fresh();
    for (int k = 0; k < 4; k++) {
        ((float *)section(BANK_VERT))[3 * 17 + 1] = bad_float[k];
        refused(STATUS_BANK_NONFINITE, BANK_VERT, 17);
        ((float *)section(BANK_NORM))[3 * 41 + 2] = bad_float[k];
        refused(STATUS_BANK_NONFINITE, BANK_NORM, 41);
    }
    for (int k = 0; k < 3; k++)
        ((float *)section(BANK_NORM))[k] *= 1.002f;
    refused(STATUS_BANK_NONFINITE, BANK_NORM, 0);
}

static void triangles(void **state)
{
    (void)state;
    struct bank_triangle *t = NULL;
    fresh();
    t = section(BANK_TRIA);
    t[5].vertex[1] = 42;
    refused(STATUS_BANK_INDEX, BANK_TRIA, 5);
    t[5].vertex[1] = BANK_NONE;
    refused(STATUS_BANK_INDEX, BANK_TRIA, 5);
    t[5].vertex[1] = t[5].vertex[0];
    refused(STATUS_BANK_INDEX, BANK_TRIA, 5);
    t[5].neighbour[2] = 80;
    refused(STATUS_BANK_INDEX, BANK_TRIA, 5);
    t[5].neighbour[2] = BANK_NONE;
    refused(STATUS_BANK_INDEX, BANK_TRIA, 5);
    t[5].neighbour[2] = 5;
    refused(STATUS_BANK_INDEX, BANK_TRIA, 5);
    t[0].neighbour[0] = t[0].neighbour[1]; /* a triangle that is there, across another edge */
    refused(STATUS_BANK_INDEX, BANK_TRIA, 0);
    uint16_t keep = t[0].vertex[0]; /* turned inside out */
    t[0].vertex[0] = t[0].vertex[1];
    t[0].vertex[1] = keep;
    refused(STATUS_BANK_INDEX, BANK_TRIA, 0);
    float *x = section(BANK_VERT); /* two corners in one place: no area */
    memcpy(x + 3 * t[0].vertex[0], x + 3 * t[0].vertex[1], 12);
    refused(STATUS_BANK_NONFINITE, BANK_TRIA, 0);
}

static uint32_t from(const uint32_t *base, const uint16_t *start, uint32_t c)
{
    return base[c / 32] + start[c];
}

/* Replace a triangle in every list by another number that keeps the list rising: all rules hold but that it is listed. */
static bool forget_a_triangle(const uint32_t *base, const uint16_t *start, uint16_t *entry, uint32_t cells)
{
    for (uint16_t t = 0; t < 80; t++)
        for (int by = -1; by <= 1; by += 2) {
            bool possible = t + by >= 0 && t + by < 80;
            for (uint32_t c = 0; c < cells; c++)
                for (uint32_t e = from(base, start, c); e < from(base, start, c + 1); e++) {
                    if (entry[e] != t)
                        continue;
                    uint32_t beside = e + (uint32_t)by;
                    if (beside >= from(base, start, c) && beside < from(base, start, c + 1) && entry[beside] == t + by)
                        possible = false;
                }
            for (uint32_t e = 0; possible && e < from(base, start, cells); e++)
                if (entry[e] == t)
                    entry[e] = (uint16_t)(t + by);
            if (possible)
                return true;
        }
    return false;
}

static void grid(void **state)
{
    (void)state;
    fresh();
    struct bank_grid *g = section(BANK_GRID);
    uint32_t cells = (uint32_t)g->cells[0] * g->cells[1] * g->cells[2], *base = (uint32_t *)(g + 1);
    uint16_t *start = (uint16_t *)(base + cells / 32 + 1), *entry = start + cells + 1;
    float bad_cell[] = {0, -0.01f, NAN, INFINITY};
    for (int k = 0; k < 4; k++) {
        g->cell_m = bad_cell[k];
        refused(STATUS_BANK_NONFINITE, BANK_GRID, 0);
        g->origin_m[k % 3] = k < 3 ? bad_float[k] : NAN;
        refused(STATUS_BANK_NONFINITE, BANK_GRID, 0);
    }
    g->reserved = 1;
    refused(STATUS_BANK_NONFINITE, BANK_GRID, 0);
    g->cells[1] = 0;
    refused(STATUS_BANK_INDEX, BANK_GRID, 0);
    g->cells[1] = BANK_MAX_GRID_AXIS + 1;
    refused(STATUS_BANK_INDEX, BANK_GRID, 0);
    g->cells[0] = g->cells[1] = g->cells[2] = 1024; /* the product is 2^30 */
    refused(STATUS_BANK_INDEX, BANK_GRID, 0);
    g->cells[0]++;
    refused(STATUS_BANK_LENGTH, BANK_GRID, 0);
    g->entries++;
    refused(STATUS_BANK_LENGTH, BANK_GRID, 0);
    start[0] = 1;
    refused(STATUS_BANK_INDEX, BANK_GRID, 0);
    uint32_t c = 1;
    while (start[c] == start[c + 1]) /* one after an occupied cell */
        c++;
    assert_true(c + 1 < 32);
    start[c + 1] = (uint16_t)(start[c] - 1); /* not rising */
    refused(STATUS_BANK_INDEX, BANK_GRID, c);
    start[c + 1] = 0xFFFF;
    refused(STATUS_BANK_INDEX, BANK_GRID, c);
    base[0] = 1;
    refused(STATUS_BANK_INDEX, BANK_GRID, 0);
    start[c + 1] = 0x7FFF;
    refused(STATUS_BANK_INDEX, BANK_GRID, c);
    entry[start[c]] = 80;
    refused(STATUS_BANK_INDEX, BANK_GRID, c);
    assert_true(start[c + 1] - start[c] >= 2);
    entry[start[c] + 1] = entry[start[c]];
    refused(STATUS_BANK_INDEX, BANK_GRID, c);
    g->max_in_cell++;
    refused(STATUS_BANK_INDEX, BANK_GRID, cells);
    g->max_in_cell = 1;
    refused(STATUS_BANK_INDEX, BANK_GRID, cells);
    g->origin_m[2] += 0.9f * g->cell_m; /* vertices below the grid */
    struct bank_view view;
    bank_fixture_seal(bytes, length);
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_BANK_NONFINITE);
    assert_int_equal(view.fault_tag, BANK_GRID);
    fresh();
    assert_true(forget_a_triangle(base, start, entry, cells));
    bank_fixture_seal(bytes, length);
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_BANK_INDEX);
    assert_int_equal(view.fault_tag, BANK_GRID);
}

static void rows(void **state)
{
    (void)state;
    fresh();
    uint16_t *row_of = section(BANK_ROWS);
    uint32_t n = bank_fixture_section(bytes, BANK_GHLF)->count, fixed = 0, v = 0;
    while (row_of[fixed] != BANK_NONE)
        fixed++;
    while (row_of[v] != 3)
        v++;
    row_of[v] = (uint16_t)n;
    refused(STATUS_BANK_INDEX, BANK_ROWS, v);
    row_of[v] = BANK_NONE; /* one owner too few */
    refused(STATUS_BANK_INDEX, BANK_ROWS, 42);
    row_of[fixed] = 3; /* one too many */
    refused(STATUS_BANK_INDEX, BANK_ROWS, 42);
    row_of[v] = 5; /* row 5 twice, row 3 not at all */
    uint32_t other = 0;
    while (row_of[other] != 5 || other == v)
        other++;
    refused(STATUS_BANK_INDEX, BANK_ROWS, v > other ? v : other);
}

static void compliance(void **state)
{
    (void)state;
    fresh();
    float *g = section(BANK_GHLF);
    uint32_t n = bank_fixture_section(bytes, BANK_GHLF)->count;
    float *diagonal = g + 9 * (4 * 5 / 2 + 4), *beside = g + 9 * (4 * 5 / 2 + 1), *last = g + 9 * (n * (n + 1) / 2) - 7;
    for (int k = 0; k < 4; k++) {
        diagonal[4] = bad_float[k];
        if (k < 3) /* FLT_MAX on the diagonal breaks the symmetric part's bound elsewhere or is a legal, soft point */
            refused(STATUS_BANK_NONFINITE, BANK_GHLF, 4);
        else
            fresh();
        beside[5] = bad_float[k];
        refused(STATUS_BANK_NONFINITE, BANK_GHLF, 4);
        *last = bad_float[k];
        refused(STATUS_BANK_NONFINITE, BANK_GHLF, n - 1);
    }
    diagonal[0] = -diagonal[0];
    refused(STATUS_BANK_NONFINITE, BANK_GHLF, 4);
    diagonal[0] = diagonal[4] = diagonal[8] = 0;
    refused(STATUS_BANK_NONFINITE, BANK_GHLF, 4);
    diagonal[1] += 1e-3f * diagonal[0]; /* not symmetric */
    refused(STATUS_BANK_NONFINITE, BANK_GHLF, 4);
    diagonal[1] = diagonal[3] = 1.1f * diagonal[0]; /* not positive semidefinite */
    refused(STATUS_BANK_NONFINITE, BANK_GHLF, 4);
    beside[0] = 2 * diagonal[0]; /* larger than every diagonal entry */
    refused(STATUS_BANK_NONFINITE, BANK_GHLF, 4);
    for (int k = 0; k < 3; k++) /* a component that is fixed is legal */
        diagonal[k] = diagonal[3 * k] = 0;
    for (uint32_t j = 0; j < 4; j++)
        memset(g + 9 * (4 * 5 / 2 + j), 0, 12);
    bank_fixture_seal(bytes, length);
    struct bank_view view;
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
}

static void contact(void **state)
{
    (void)state;
    fresh();
    float *c = section(BANK_CONT);
    for (int field = 0; field < 7; field++) {
        float bad[] = {NAN, INFINITY, -1e-3f, 0};
        for (int k = 0; k < 4; k++) {
            if (field == 2 && k == 3) /* no damping is legal */
                continue;
            c[field] = bad[k];
            refused(STATUS_BANK_NONFINITE, BANK_CONT, 0);
        }
    }
    ((struct bank_contact *)c)->solver_steps = BANK_MAX_SOLVER_STEPS + 1;
    refused(STATUS_BANK_NONFINITE, BANK_CONT, 0);
}

#define TOOL_REFUSED(change)                                                                                           \
    do {                                                                                                               \
        change;                                                                                                        \
        refused(STATUS_BANK_NONFINITE, BANK_TOOL, 1);                                                                  \
    } while (0)

static void instruments(void **state)
{
    (void)state;
    fresh();
    struct bank_tool *t = (struct bank_tool *)section(BANK_TOOL) + 1;
    TOOL_REFUSED(t->trocar_m[2] = NAN);
    TOOL_REFUSED(t->trocar_m[0] = 2e3f);
    TOOL_REFUSED(t->rotation[4] = NAN);
    TOOL_REFUSED(t->rotation[1] = 0.01f);           /* a shear */
    TOOL_REFUSED(t->rotation[0] = 1.001f);          /* a stretch */
    TOOL_REFUSED(t->rotation[8] = -t->rotation[8]); /* a mirror */
    TOOL_REFUSED(t->axis[0].per_count = 0);
    TOOL_REFUSED(t->axis[1].per_count = INFINITY);
    TOOL_REFUSED(t->axis[2].zero = NAN);
    TOOL_REFUSED(t->axis[0].count_modulus = 0);
    TOOL_REFUSED(t->axis[0].count_modulus = BANK_MAX_COUNTS + 1);
    TOOL_REFUSED(t->axis[0].count_zero = t->axis[0].count_modulus);
    TOOL_REFUSED(t->axis[1].minimum = t->axis[1].maximum);
    TOOL_REFUSED(t->axis[1].minimum = -0.71f);
    TOOL_REFUSED(t->axis[0].maximum = 0.71f);
    TOOL_REFUSED(t->axis[2].minimum = -0.001f);
    TOOL_REFUSED(t->axis[2].maximum = NAN);
    TOOL_REFUSED(t->axis[2].speed_limit = 0);
    TOOL_REFUSED(t->axis[2].effort_limit = -1);
    TOOL_REFUSED(t->gravity_N = -1);
    TOOL_REFUSED(t->gravity_arm_m = INFINITY);
    TOOL_REFUSED(t->gravity_direction[2] = 0);
    TOOL_REFUSED(t->tip_radius_m = -0.001f);
    TOOL_REFUSED(t->point_count = 0);
    TOOL_REFUSED(t->point_count = BANK_MAX_TOOL_POINTS + 1);
    TOOL_REFUSED(t->point_m[15][2] = NAN); /* unused points too: a later count may reach them */
    TOOL_REFUSED(t->reserved[3] = 1);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_synthetic_bank_is_good),
        cmocka_unit_test(compliance_blocks_of_swapped_rows_are_transposed),
        cmocka_unit_test(unaligned_bytes),
        cmocka_unit_test(header_rules),
        cmocka_unit_test(table_rules),
        cmocka_unit_test(every_section_is_missed),
        cmocka_unit_test(counts_are_held_against_lengths),
        cmocka_unit_test(optional_unknown_sections_are_skipped),
        cmocka_unit_test(vertices_and_normals),
        cmocka_unit_test(triangles),
        cmocka_unit_test(grid),
        cmocka_unit_test(rows),
        cmocka_unit_test(compliance),
        cmocka_unit_test(contact),
        cmocka_unit_test(instruments),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
