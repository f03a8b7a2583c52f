#include "grid.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Margin of a cell, in cells: what the traversal on the controller may lose to rounding (header of bank_format.h), and
 * a little more for the rounding here. */
static const double margin = 1e-3 + 1e-6;
static const double target_in_cell = 12;

struct body_box {
    const float *positions;
    const uint32_t *triangles;
    size_t vertex_count, triangle_count;
    double low[3], high[3];
};

/* Separating axis test of a triangle against a cube with centre `c` and half side `h` (Akenine-Moller 2001): 3 + 1 + 9
 * axes. */
static bool meets(const double v[3][3], const double c[3], double h)
{
    double p[3][3], edge[3][3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            p[i][k] = v[i][k] - c[k];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            edge[i][k] = p[(i + 1) % 3][k] - p[i][k];
    for (int k = 0; k < 3; k++)
        if (fmin(p[0][k], fmin(p[1][k], p[2][k])) > h || fmax(p[0][k], fmax(p[1][k], p[2][k])) < -h)
            return false;
    double n[3], reach = 0, distance = 0;
    for (int k = 0; k < 3; k++) {
        int a = (k + 1) % 3, b = (k + 2) % 3;
        n[k] = edge[0][a] * edge[1][b] - edge[0][b] * edge[1][a];
        reach += h * fabs(n[k]);
        distance += n[k] * p[0][k];
    }
    if (fabs(distance) > reach)
        return false;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) { /* axis: unit vector k times edge i */
            int a = (k + 1) % 3, b = (k + 2) % 3;
            double low = INFINITY, high = -INFINITY, r = h * (fabs(edge[i][a]) + fabs(edge[i][b]));
            for (int j = 0; j < 3; j++) {
                double s = edge[i][a] * p[j][b] - edge[i][b] * p[j][a];
                low = fmin(low, s);
                high = fmax(high, s);
            }
            if (low > r || high < -r)
                return false;
        }
    return true;
}

/* Origin and cell counts for a cell size: the box padded by 1 % of a cell, so that no rounding puts a vertex outside.
 * False when the counts exceed the format's. */
static bool lay_out(const struct body_box *body, double cell_m, struct bank_grid *g)
{
    double cells = 1;
    *g = (struct bank_grid){.cell_m = (float)cell_m};
    for (int k = 0; k < 3; k++) {
        g->origin_m[k] = (float)(body->low[k] - 0.01 * cell_m);
        double count = ceil((body->high[k] - g->origin_m[k]) / g->cell_m + 0.01);
        if (!(count <= BANK_MAX_GRID_AXIS))
            return false;
        g->cells[k] = (uint16_t)count;
        cells *= count;
    }
    return cells <= BANK_MAX_GRID_CELLS;
}

/* Bounds in cells, per axis, of the cells that a triangle's enlarged box reaches. */
static void reach(const struct bank_grid *g, const double v[3][3], double enlarge, int first[3], int last[3])
{
    for (int k = 0; k < 3; k++) {
        double low = (fmin(v[0][k], fmin(v[1][k], v[2][k])) - g->origin_m[k]) / g->cell_m;
        double high = (fmax(v[0][k], fmax(v[1][k], v[2][k])) - g->origin_m[k]) / g->cell_m;
        first[k] = (int)fmax(0, floor(low - enlarge));
        last[k] = (int)fmin(g->cells[k] - 1, floor(high + enlarge));
    }
}

static bool meets_cell(const struct bank_grid *g, const double v[3][3], int x, int y, int z, double enlarge)
{
    double cell = g->cell_m, centre[3] = {g->origin_m[0] + (x + 0.5) * cell, g->origin_m[1] + (y + 0.5) * cell,
                                          g->origin_m[2] + (z + 0.5) * cell};
    return meets(v, centre, (0.5 + enlarge) * cell);
}

static size_t cell_number(const struct bank_grid *g, int x, int y, int z)
{
    return x + g->cells[0] * (y + (size_t)g->cells[1] * z);
}

/* Every (triangle, cell) that meet, in rising order of the triangle: counted into at[cell + 1] when `entry` is NULL, else
 * written at entry[at[cell]++]. */
static void visit(const struct body_box *body, const struct bank_grid *g, uint32_t *at, uint16_t *entry)
{
    for (size_t t = 0; t < body->triangle_count; t++) {
        double v[3][3];
        int first[3], last[3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                v[i][k] = body->positions[3 * body->triangles[3 * t + i] + k];
        reach(g, v, margin, first, last);
        for (int z = first[2]; z <= last[2]; z++)
            for (int y = first[1]; y <= last[1]; y++)
                for (int x = first[0]; x <= last[0]; x++) {
                    if (!meets_cell(g, v, x, y, z, margin))
                        continue;
                    size_t c = cell_number(g, x, y, z);
                    if (entry)
                        entry[at[c]++] = (uint16_t)t;
                    else
                        at[c + 1]++;
                }
    }
}

static bool listed(const struct bank_view *bank, size_t cell, uint32_t t)
{
    for (uint32_t e = bank_view_cell_start(bank, cell); e < bank_view_cell_start(bank, cell + 1); e++)
        if (bank->cell_triangle[e] == t)
            return true;
    return false;
}

uint32_t grid_missing(const struct bank_view *bank)
{
    const struct bank_grid *g = bank->grid;
    double enlarge = 1e-3 - 1e-6;
    for (uint32_t t = 0; t < bank->triangle_count; t++) {
        double v[3][3];
        int first[3], last[3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                v[i][k] = (double)bank->positions[3 * bank->triangles[t].vertex[i] + k];
        reach(g, v, enlarge, first, last);
        for (int z = first[2]; z <= last[2]; z++)
            for (int y = first[1]; y <= last[1]; y++)
                for (int x = first[0]; x <= last[0]; x++)
                    if (meets_cell(g, v, x, y, z, enlarge) && !listed(bank, cell_number(g, x, y, z), t))
                        return t;
    }
    return UINT32_MAX;
}

struct census {
    double mean; /* triangles per occupied cell */
    uint32_t most, occupied;
};

static struct census count(const struct body_box *body, const struct bank_grid *g, uint32_t *start)
{
    size_t cells = (size_t)g->cells[0] * g->cells[1] * g->cells[2];
    memset(start, 0, (cells + 1) * sizeof *start);
    visit(body, g, start, NULL);
    struct census found = {0};
    double entries = 0;
    for (size_t c = 1; c <= cells; c++) {
        entries += start[c];
        found.occupied += start[c] > 0;
        if (start[c] > found.most)
            found.most = start[c];
    }
    found.mean = entries / found.occupied;
    return found;
}

/* Bisection on the logarithm of the cell size for the mean; the mean rises with the size. */
static bool choose(const struct body_box *body, struct bank_grid *chosen, struct census *census, uint32_t *start)
{
    double longest = 0;
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, body->high[k] - body->low[k]);
    double low = longest / BANK_MAX_GRID_AXIS / 2, high = 2 * longest;
    bool known = false;
    for (int step = 0; step < 20; step++) {
        double cell = sqrt(low * high);
        struct bank_grid g;
        if (!lay_out(body, cell, &g)) {
            low = cell;
            continue;
        }
        struct census found = count(body, &g, start);
        bool full = found.most > BANK_MAX_CELL_TRIANGLES;
        if (full || found.mean > target_in_cell)
            high = cell;
        else
            low = cell;
        /* of what fits, the best is within the target; failing that, the smallest cell that the format holds */
        bool better = !known || (found.mean <= target_in_cell ? cell > chosen->cell_m || census->mean > target_in_cell
                                                              : found.mean < census->mean);
        if (!full && better) {
            *chosen = g;
            *census = found;
            known = true;
        }
    }
    return known;
}

static int check_precision(const struct body_box *body, const struct bank_grid *g, struct failure *why)
{
    double far = 0;
    for (int k = 0; k < 3; k++)
        far = fmax(far, fmax(fabs(body->low[k]), fabs(body->high[k])));
    /* (x - origin) / cell on the controller: x and origin round at far 2^-24 each, the quotient at cells 2^-23 */
    double rounding = far * FLT_EPSILON / g->cell_m + BANK_MAX_GRID_AXIS * FLT_EPSILON;
    if (far > BANK_MAX_POSITION_M || rounding > 5e-4)
        return failure_set(why, STATUS_MESH_TOO_LARGE, NULL, "move the mesh nearer to its origin",
                           "the body lies %.3g m from the origin, too far for single precision with cells of %.3g m",
                           far, (double)g->cell_m);
    return STATUS_OK;
}

int grid_build(size_t vertex_count, const float *positions, size_t triangle_count, const uint32_t *triangles,
               struct grid *grid, struct failure *why)
{
    *grid = (struct grid){0};
    struct body_box body = {
        .positions = positions, .triangles = triangles, .vertex_count = vertex_count, .triangle_count = triangle_count};
    for (int k = 0; k < 3; k++) {
        body.low[k] = INFINITY;
        body.high[k] = -INFINITY;
        for (size_t v = 0; v < vertex_count; v++) {
            body.low[k] = fmin(body.low[k], positions[3 * v + k]);
            body.high[k] = fmax(body.high[k], positions[3 * v + k]);
        }
    }
    uint32_t *start = calloc(BANK_MAX_GRID_CELLS + 1, sizeof *start);
    struct census census = {0};
    int status = STATUS_OK;
    if (!start)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the collision grid");
    else if (!choose(&body, &grid->header, &census, start))
        status = failure_set(why, STATUS_MESH_TOO_LARGE, NULL, "remesh the surface more evenly",
                             "no collision grid of up to %d cells keeps every cell below %d triangles",
                             BANK_MAX_GRID_CELLS, BANK_MAX_CELL_TRIANGLES);
    else
        status = check_precision(&body, &grid->header, why);
    if (!status) {
        struct bank_grid *g = &grid->header;
        grid->cells = (size_t)g->cells[0] * g->cells[1] * g->cells[2];
        census = count(&body, g, start);
        for (size_t c = 0; c < grid->cells; c++)
            start[c + 1] += start[c];
        g->entries = start[grid->cells];
        g->max_in_cell = (uint16_t)census.most;
        grid->occupied = census.occupied;
        grid->base = malloc((grid->cells / 32 + 1) * sizeof *grid->base);
        grid->start = malloc((grid->cells + 1) * sizeof *grid->start);
        grid->entry = malloc((g->entries ? g->entries : 1) * sizeof *grid->entry);
        if (!grid->base || !grid->start || !grid->entry) {
            grid_free(grid);
            status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the collision grid");
        } else {
            for (size_t c = 0; c <= grid->cells; c++) {
                grid->base[c / 32] = start[c / 32 * 32];
                grid->start[c] = (uint16_t)(start[c] - start[c / 32 * 32]);
            }
            visit(&body, g, start, grid->entry); /* moves each start to the next cell's */
        }
    }
    free(start);
    return status;
}

void grid_free(struct grid *grid)
{
    free(grid->base);
    free(grid->start);
    free(grid->entry);
    *grid = (struct grid){0};
}
