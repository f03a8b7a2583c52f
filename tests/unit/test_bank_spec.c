/* The example of shared/SPEC.md is a bank: its bytes are those that its description gives, and it opens. With
 * TROCAR_SPEC_DUMP set, prints the dump that belongs there. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "bank_fixture.h"
#include "bank_view.h"
#include "grid.h"

/* A regular tetrahedron around the origin, one vertex free, two cells along each axis, each of which lists every triangle. */
static unsigned char *example(size_t *length)
{
    static const float s = 0.0625f, u = 0.57735027f;
    float x[4][3] = {{s, s, s}, {s, -s, -s}, {-s, s, -s}, {-s, -s, s}};
    float n[4][3] = {{u, u, u}, {u, -u, -u}, {-u, u, -u}, {-u, -u, u}};
    /* triangle k lies opposite vertex k, so a neighbour has the number of the vertex that it lacks */
    struct bank_triangle t[4] = {
        {{1, 3, 2}, {1, 3, 2}}, {{0, 2, 3}, {0, 2, 3}}, {{0, 3, 1}, {0, 3, 1}}, {{0, 1, 2}, {0, 1, 2}}};
    struct {
        struct bank_grid head;
        uint32_t base[1];
        uint16_t start[9], entry[32];
    } grid = {.head = {.origin_m = {-0.0703125f, -0.0703125f, -0.0703125f},
                       .cell_m = 0.0703125f,
                       .cells = {2, 2, 2},
                       .max_in_cell = 4,
                       .entries = 32}};
    for (int c = 0; c < 9; c++)
        grid.start[c] = (uint16_t)(4 * c);
    for (int e = 0; e < 32; e++)
        grid.entry[e] = e % 4;
    uint16_t row[4] = {0, BANK_NONE, BANK_NONE, BANK_NONE};
    float G[9] = {0.5f, 0.125f, 0.125f, 0.125f, 0.5f, 0.125f, 0.125f, 0.125f, 0.5f};
    struct bank_contact contact = {.regularisation_m_N = 0.0009765625f,
                                   .coupling_stiffness_N_m = 1024,
                                   .coupling_damping_Ns_m = 0.25f,
                                   .force_limit_N = 8,
                                   .force_rate_N_s = 2048,
                                   .decay_s = 0.03125f,
                                   .typical_compliance_m_N = 0.5f};
    struct bank_axis angle = {.per_count = 0x1p-13f,
                              .count_zero = 8192,
                              .count_modulus = 16384,
                              .minimum = -0.5f,
                              .maximum = 0.5f,
                              .speed_limit = 32,
                              .effort_limit = 2};
    struct bank_tool tool = {.trocar_m = {0, 0, 0.25f},
                             .rotation = {1, 0, 0, 0, -1, 0, 0, 0, -1},
                             .axis = {angle, angle, angle},
                             .gravity_N = 0.5f,
                             .gravity_arm_m = 0.0625f,
                             .gravity_direction = {0, 0, -1},
                             .tip_radius_m = 0.00390625f,
                             .point_count = 1};
    tool.axis[2].per_count = 0x1p-15f;
    tool.axis[2].zero = 0.1875f;
    tool.axis[2].minimum = 0.125f;
    tool.axis[2].maximum = 0.25f;
    tool.axis[2].effort_limit = 8;
    struct fixture_part part[] = {
        {BANK_VERT, BANK_REQUIRED, 1, 4, sizeof x, x},
        {BANK_NORM, BANK_REQUIRED, 1, 4, sizeof n, n},
        {BANK_TRIA, BANK_REQUIRED, 1, 4, sizeof t, t},
        {BANK_GRID, BANK_REQUIRED, 2, 8, 32 + 4 + 2 * 9 + 2 * 32, &grid},
        {BANK_ROWS, BANK_REQUIRED, 1, 4, sizeof row, row},
        {BANK_CONT, BANK_REQUIRED, 1, 1, sizeof contact, &contact},
        {BANK_TOOL, BANK_REQUIRED, 1, 1, sizeof tool, &tool},
        {BANK_GHLF, BANK_REQUIRED, 1, 1, sizeof G, G},
    };
    return bank_fixture_join(part, 8, length);
}

static void the_example_opens(void **state)
{
    (void)state;
    size_t length;
    unsigned char *bytes = example(&length);
    struct bank_view view;
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
    assert_int_equal(view.vertex_count, 4);
    assert_int_equal(view.row_count, 1);
    assert_int_equal(grid_missing(&view), UINT32_MAX);
    free(bytes);
}

static void the_specification_shows_its_bytes(void **state)
{
    (void)state;
    size_t length, shown = 0;
    unsigned char *bytes = example(&length);
    if (getenv("TROCAR_SPEC_DUMP"))
        for (size_t k = 0; k < length; k += 16) {
            printf("%08zx ", k);
            for (size_t b = k; b < k + 16; b++)
                printf(" %02x", bytes[b]);
            puts("");
        }
    FILE *spec = fopen("shared/SPEC.md", "r");
    assert_non_null(spec); /* run from the checkout's root */
    char line[300];
    bool here = false;
    while (fgets(line, sizeof line, spec)) {
        if (!strncmp(line, "## ", 3))
            here = !strcmp(line, "## Bank\n");
        unsigned at, value[16];
        int used = 0;
        if (!here || sscanf(line, "%8x  %n", &at, &used) != 1 || used != 10)
            continue;
        const char *p = line + used;
        for (int b = 0; b < 16; b++, p += 3)
            assert_int_equal(sscanf(p, "%2x", &value[b]), 1);
        assert_true(at + 16 <= length);
        for (int b = 0; b < 16; b++)
            if (value[b] != bytes[at + b])
                fail_msg("byte 0x%x is %02x in SPEC.md, %02x in the example", at + b, value[b], bytes[at + b]);
        shown += 16;
    }
    fclose(spec);
    assert_int_equal(shown, length);
    free(bytes);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_example_opens),
        cmocka_unit_test(the_specification_shows_its_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
