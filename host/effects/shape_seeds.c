#include "shape_seeds.h"

#include <math.h>
#include <stdlib.h>

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void subtract(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

/* a + v (b - a) + w (c - a) */
static void combine(const double corner[9], double v, double w, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = corner[k] + v * (corner[3 + k] - corner[k]) + w * (corner[6 + k] - corner[k]);
}

double shape_nearest(const double corner[9], const double x[3], double nearest[3])
{
    const double *a = corner, *b = corner + 3, *c = corner + 6;
    double ab[3], ac[3], ax[3], bx[3], cx[3], away[3];
    subtract(b, a, ab);
    subtract(c, a, ac);
    subtract(x, a, ax);
    subtract(x, b, bx);
    subtract(x, c, cx);
    double d1 = dot(ab, ax), d2 = dot(ac, ax), d3 = dot(ab, bx), d4 = dot(ac, bx), d5 = dot(ab, cx), d6 = dot(ac, cx);
    double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
    if (d1 <= 0 && d2 <= 0)
        combine(corner, 0, 0, nearest);
    else if (d3 >= 0 && d4 <= d3)
        combine(corner, 1, 0, nearest);
    else if (d6 >= 0 && d5 <= d6)
        combine(corner, 0, 1, nearest);
    else if (vc <= 0 && d1 >= 0 && d3 <= 0)
        combine(corner, d1 / (d1 - d3), 0, nearest);
    else if (vb <= 0 && d2 >= 0 && d6 <= 0)
        combine(corner, 0, d2 / (d2 - d6), nearest);
    else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        combine(corner, 1 - w, w, nearest);
    } else {
        double share = 1 / (va + vb + vc);
        combine(corner, vb * share, vc * share, nearest);
    }
    subtract(x, nearest, away);
    return sqrt(dot(away, away));
}

struct triangles {
    const double *positions;
    const uint32_t *triangle;
    size_t count;
};

static void corners(const struct triangles *t, size_t i, double corner[9])
{
    for (int k = 0; k < 9; k++)
        corner[k] = t->positions[3 * (size_t)t->triangle[3 * i + (size_t)(k / 3)] + (size_t)(k % 3)];
}

static void normal_of(const double corner[9], double n[3])
{
    double ab[3], ac[3];
    subtract(corner + 3, corner, ab);
    subtract(corner + 6, corner, ac);
    for (int k = 0; k < 3; k++)
        n[k] = ab[(k + 1) % 3] * ac[(k + 2) % 3] - ab[(k + 2) % 3] * ac[(k + 1) % 3];
}

/* Origin and cells for a cell's size; their number, or more than BANK_MAX_GRID_CELLS. */
static double lay_out(const double low[3], const double high[3], double cell_m, struct bank_shape *shape)
{
    double cells = 1;
    shape->cell_m = (float)cell_m;
    for (int k = 0; k < 3; k++) {
        double margin = (double)shape->band_m + 0.01 * cell_m;
        shape->origin_m[k] = (float)(low[k] - margin);
        double count = ceil((high[k] + margin - (double)shape->origin_m[k]) / (double)shape->cell_m);
        if (count > BANK_MAX_GRID_AXIS)
            return INFINITY;
        shape->cells[k] = (uint16_t)count;
        cells *= count;
    }
    return cells;
}

static double mean_edge(const struct triangles *t)
{
    double sum = 0;
    for (size_t i = 0; i < t->count; i++) {
        double corner[9], side[3];
        corners(t, i, corner);
        subtract(corner + 3, corner, side);
        sum += sqrt(dot(side, side));
    }
    return sum / (double)t->count;
}

/* Each triangle offers itself to the cells that it is near to. In the first round the nearest wins; in the second the nearest
 * of those that face away from that one. */
static void offer(const struct triangles *t, const struct bank_shape *shape, int round, double *distance,
                  uint16_t *seed)
{
    const double cell = (double)shape->cell_m, reach = (double)shape->band_m + 0.5 * sqrt(3.0) * cell;
    for (size_t i = 0; i < t->count; i++) {
        double corner[9], n[3];
        int first[3], last[3];
        corners(t, i, corner);
        normal_of(corner, n);
        for (int k = 0; k < 3; k++) {
            double low = fmin(corner[k], fmin(corner[3 + k], corner[6 + k])) - reach,
                   high = fmax(corner[k], fmax(corner[3 + k], corner[6 + k])) + reach;
            first[k] = (int)fmax(0, floor((low - (double)shape->origin_m[k]) / cell));
            last[k] = (int)fmin(shape->cells[k] - 1, floor((high - (double)shape->origin_m[k]) / cell));
        }
        for (int z = first[2]; z <= last[2]; z++)
            for (int y = first[1]; y <= last[1]; y++)
                for (int x = first[0]; x <= last[0]; x++) {
                    size_t c = (size_t)x + shape->cells[0] * ((size_t)y + shape->cells[1] * (size_t)z);
                    double middle[3] = {(double)shape->origin_m[0] + (x + 0.5) * cell,
                                        (double)shape->origin_m[1] + (y + 0.5) * cell,
                                        (double)shape->origin_m[2] + (z + 0.5) * cell};
                    double place[3], d = shape_nearest(corner, middle, place);
                    if (d > reach || d >= distance[c])
                        continue;
                    if (round == 1) {
                        double other[9], facing[3];
                        corners(t, seed[2 * c], other);
                        normal_of(other, facing);
                        if (dot(facing, n) >= 0)
                            continue;
                    }
                    distance[c] = d;
                    seed[2 * c + (size_t)round] = (uint16_t)i;
                }
    }
}

int shape_seeds(size_t vertices, const double *positions, size_t triangles, const uint32_t *triangle,
                struct bank_shape *shape, uint16_t **seed, struct failure *why)
{
    const struct triangles t = {.positions = positions, .triangle = triangle, .count = triangles};
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t v = 0; v < vertices; v++)
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], positions[3 * v + (size_t)k]);
            high[k] = fmax(high[k], positions[3 * v + (size_t)k]);
        }
    double cell_m = 2 * mean_edge(&t), cells = lay_out(low, high, cell_m, shape);
    for (int step = 0; step < 60 && !(cells <= BANK_MAX_GRID_CELLS); step++)
        cells = lay_out(low, high, cell_m *= 1.2, shape);
    if (!(cells <= BANK_MAX_GRID_CELLS))
        return failure_set(why, STATUS_MESH_TOO_LARGE, NULL, NULL, "no grid of seeds fits the body");
    size_t count = (size_t)cells;
    double *distance = malloc(count * sizeof *distance);
    *seed = malloc(2 * count * sizeof **seed);
    if (!distance || !*seed) {
        free(distance);
        free(*seed);
        *seed = NULL;
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for %zu cells of seeds", count);
    }
    for (size_t i = 0; i < 2 * count; i++)
        (*seed)[i] = BANK_NONE;
    for (int round = 0; round < 2; round++) {
        for (size_t c = 0; c < count; c++)
            distance[c] = INFINITY;
        offer(&t, shape, round, distance, *seed);
    }
    free(distance);
    return STATUS_OK;
}
