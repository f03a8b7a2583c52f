/* The packed grid: whatever point of a triangle a segment hits, the cell in which the controller computes it lists the
 * triangle, also when the point is off by half the margin. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "bank_fixture.h"
#include "bank_view.h"
#include "grid.h"
#include "random.h"

static uint32_t at(const struct grid *grid, size_t cell)
{
    return grid->base[cell / 32] + grid->start[cell];
}

static bool listed(const struct grid *grid, size_t cell, uint32_t triangle)
{
    for (uint32_t e = at(grid, cell); e < at(grid, cell + 1); e++)
        if (grid->entry[e] == triangle)
            return true;
    return false;
}

static void holds_the_rules(const struct grid *grid, size_t triangles)
{
    const struct bank_grid *g = &grid->header;
    uint32_t longest = 0;
    assert_int_equal(grid->cells, (size_t)g->cells[0] * g->cells[1] * g->cells[2]);
    assert_true(grid->cells <= BANK_MAX_GRID_CELLS);
    assert_int_equal(at(grid, 0), 0);
    assert_int_equal(at(grid, grid->cells), g->entries);
    for (size_t c = 0; c < grid->cells; c++) {
        assert_true(at(grid, c) <= at(grid, c + 1));
        if (at(grid, c + 1) - at(grid, c) > longest)
            longest = at(grid, c + 1) - at(grid, c);
        for (uint32_t e = at(grid, c); e < at(grid, c + 1); e++) {
            assert_true(grid->entry[e] < triangles);
            assert_true(e == at(grid, c) || grid->entry[e] > grid->entry[e - 1]);
        }
    }
    assert_int_equal(longest, g->max_in_cell);
    assert_true(longest <= BANK_MAX_CELL_TRIANGLES);
}

/* Points of every triangle, corners and edges among them, each pushed to the eight corners of a box of half the margin;
 * the cell is computed as the controller does it, in float32. */
static void lists_every_sampled_point(const struct grid *grid, const float *x, const uint32_t *t, size_t triangles)
{
    const struct bank_grid *g = &grid->header;
    for (size_t f = 0; f < triangles; f++)
        for (int sample = 0; sample < 24; sample++) {
            double a = random_unit(), b = random_unit();
            if (sample < 3) {
                a = sample == 1;
                b = sample == 2;
            } else if (sample < 9) {
                b = sample % 3 == 0 ? 0 : sample % 3 == 1 ? 1 - a : b;
                a = sample % 3 == 2 ? 0 : a;
            } else if (a + b > 1) {
                a = 1 - a;
                b = 1 - b;
            }
            for (int corner = 0; corner < 9; corner++) {
                size_t index[3];
                for (int k = 0; k < 3; k++) {
                    double p = (1 - a - b) * (double)x[3 * t[3 * f] + k] + a * (double)x[3 * t[3 * f + 1] + k] +
                               b * (double)x[3 * t[3 * f + 2] + k];
                    if (corner < 8)
                        p += (corner >> k & 1 ? 5e-4 : -5e-4) * (double)g->cell_m;
                    float s = ((float)p - g->origin_m[k]) / g->cell_m;
                    assert_true(s > 0 && s < g->cells[k]);
                    index[k] = (size_t)s;
                }
                if (!listed(grid, index[0] + g->cells[0] * (index[1] + (size_t)g->cells[1] * index[2]), (uint32_t)f))
                    fail_msg("triangle %zu is not listed in cell %zu %zu %zu", f, index[0], index[1], index[2]);
            }
        }
}

static void check(const struct fixture_surface *s, const double scale[3], const double shift[3], double most_in_mean)
{
    float *x = malloc(3 * s->vertices * sizeof *x);
    uint32_t *t = malloc(3 * s->triangles * sizeof *t);
    for (unsigned v = 0; v < 3 * s->vertices; v++)
        x[v] = (float)(scale[v % 3] * s->x[v / 3][v % 3] + shift[v % 3]);
    for (unsigned f = 0; f < 3 * s->triangles; f++)
        t[f] = s->t[f / 3][f % 3];
    struct grid grid;
    struct failure why;
    assert_int_equal(grid_build(s->vertices, x, s->triangles, t, &grid, &why), STATUS_OK);
    holds_the_rules(&grid, s->triangles);
    lists_every_sampled_point(&grid, x, t, s->triangles);
    assert_true(grid.header.entries <= most_in_mean * (double)grid.occupied);
    grid_free(&grid);
    free(x);
    free(t);
}

static void a_sphere(void **state)
{
    (void)state;
    random_seed("sphere", 1);
    for (unsigned level = 0; level < 5; level++) {
        struct fixture_surface s;
        fixture_icosphere(&s, level);
        /* 5120 triangles on a sphere: 65536 cells are not enough for 4 of them in each */
        check(&s, (double[]){0.1, 0.1, 0.1}, (double[]){0, 0, 0}, 12);
        free(s.x);
        free(s.t);
    }
}

static void flat_long_and_far_bodies(void **state)
{
    (void)state;
    random_seed("bodies", 2);
    struct fixture_surface s;
    fixture_icosphere(&s, 3);
    check(&s, (double[]){0.2, 0.1, 0.0005}, (double[]){0, 0, 0}, 12);
    check(&s, (double[]){1.0, 0.001, 0.001}, (double[]){-0.3, 0.2, 0}, 400);
    check(&s, (double[]){0.1, 0.1, 0.1}, (double[]){5, -3, 2}, 12);
    check(&s, (double[]){100, 80, 90}, (double[]){0, 0, 0}, 12);
    free(s.x);
    free(s.t);
}

/* Ten thousand triangles in a thousandth of the body, like a scanned vessel on a limb: no cell may hold more than 255. */
static void uneven_surfaces(void **state)
{
    (void)state;
    random_seed("uneven", 3);
    struct fixture_surface s;
    fixture_icosphere(&s, 4);
    for (unsigned v = 0; v < s.vertices; v++) {
        double shrink = s.x[v][2] > -0.9 ? 0.05 : 1;
        for (int k = 0; k < 3; k++)
            s.x[v][k] *= shrink;
    }
    check(&s, (double[]){0.1, 0.1, 0.1}, (double[]){0, 0, 0}, 30);
    free(s.x);
    free(s.t);
}

static void bodies_too_far_for_single_precision_are_refused(void **state)
{
    (void)state;
    struct fixture_surface s;
    fixture_icosphere(&s, 2);
    float *x = malloc(3 * s.vertices * sizeof *x);
    uint32_t *t = malloc(3 * s.triangles * sizeof *t);
    for (unsigned v = 0; v < 3 * s.vertices; v++)
        x[v] = (float)(0.1 * s.x[v / 3][v % 3] + 900);
    for (unsigned f = 0; f < 3 * s.triangles; f++)
        t[f] = s.t[f / 3][f % 3];
    struct grid grid;
    struct failure why;
    assert_int_equal(grid_build(s.vertices, x, s.triangles, t, &grid, &why), STATUS_MESH_TOO_LARGE);
    assert_non_null(strstr(why.cause, "from the origin"));
    free(x);
    free(t);
    free(s.x);
    free(s.t);
}

/* The brute-force grid of the synthetic bank lists more than is needed; take one needed entry away and it is named. */
static void a_forgotten_entry_is_found(void **state)
{
    (void)state;
    size_t length;
    unsigned char *bytes = bank_fixture(NULL, &length);
    struct bank_view view;
    assert_int_equal(bank_view_open(&view, bytes, length), STATUS_OK);
    assert_int_equal(grid_missing(&view), UINT32_MAX);
    uint16_t *entry = (uint16_t *)(uintptr_t)view.cell_triangle;
    uint32_t cells = bank_fixture_section(bytes, BANK_GRID)->count, e = 0;
    for (uint32_t c = 0; c < cells; c++) /* a list's last number, moved up: still rising */
        if (bank_view_cell_start(&view, c + 1) > bank_view_cell_start(&view, c) &&
            entry[bank_view_cell_start(&view, c + 1) - 1] + 1u < view.triangle_count)
            e = bank_view_cell_start(&view, c + 1) - 1;
    uint32_t found = 0;
    for (; e > 0 && !found; e--) {
        uint16_t keep = entry[e];
        entry[e] = (uint16_t)view.triangle_count;
        found = grid_missing(&view) == keep;
        entry[e] = keep;
    }
    assert_true(found);
    free(bytes);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sphere),
        cmocka_unit_test(flat_long_and_far_bodies),
        cmocka_unit_test(uneven_surfaces),
        cmocka_unit_test(bodies_too_far_for_single_precision_are_refused),
        cmocka_unit_test(a_forgotten_entry_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
