/* Where the walk to the nearest place of the surface begins: a coarse grid whose cells name one or two triangles each, section SHAP
 * of bank_format.h. */
#ifndef TROCAR_SHAPE_SEEDS_H
#define TROCAR_SHAPE_SEEDS_H

#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "failure.h"

/* positions: 3 per vertex, m, as the bank has them; triangles: 3 vertices each. The shape's band_m is given; lays out its grid
 * (origin_m, cell_m, cells) around the surface and the band, cells twice the mean edge or as large as BANK_MAX_GRID_CELLS asks for.
 * `seed`: 2 per cell, malloc, the caller frees. Work: triangles times the cells that the band reaches from each.
 * MEMORY, MESH_TOO_LARGE. */
int shape_seeds(size_t vertices, const double *positions, size_t triangles, const uint32_t *triangle,
                struct bank_shape *shape, uint16_t **seed, struct failure *why);

/* The nearest point of a triangle (corners 3 x 3) to x; returns the distance. Ericson, Real-Time Collision Detection, 5.1.5. */
double shape_nearest(const double corner[9], const double x[3], double nearest[3]);

#endif
