/* The uniform grid over the surface that the controller walks (section GRID of bank_format.h). */
#ifndef TROCAR_GRID_H
#define TROCAR_GRID_H

#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "bank_view.h"
#include "failure.h"

struct grid {
    struct bank_grid header;
    uint32_t *base;  /* cells / 32 + 1 */
    uint16_t *start; /* cells + 1, from the base of its 32 cells */
    uint16_t *entry; /* header.entries */
    size_t cells, occupied;
};

/* Positions (3 float32 per vertex, m, as the bank stores them) and triangles (3 vertices each). The cell is the largest
 * for which an occupied cell holds 12 triangles on average, within the limits of the format; where BANK_MAX_GRID_CELLS
 * forces a larger one, it is taken as long as no cell holds more than BANK_MAX_CELL_TRIANGLES. Refuses (MESH_TOO_LARGE)
 * when no cell size fits, and when the body lies so far from its origin that float32 cannot tell 1e-3 of a cell apart.
 * Time: about 20 passes over the triangles. Free with grid_free. */
int grid_build(size_t vertex_count, const float *positions, size_t triangle_count, const uint32_t *triangles,
               struct grid *grid, struct failure *why);
void grid_free(struct grid *grid);

/* First triangle of a bank that its grid does not list in a cell which the triangle meets by more than 1e-6 of a cell less
 * than the format's margin; UINT32_MAX when there is none. */
uint32_t grid_missing(const struct bank_view *bank);

#endif
