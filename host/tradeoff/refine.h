/* A mesh refined: every tetrahedron is split into eight (Bey, Computing 55, 1995: four at the corners, the octahedron
 * between them along one diagonal, the same for every element), so the body and its faceted surface stay what they are. */
#ifndef TROCAR_TRADEOFF_REFINE_H
#define TROCAR_TRADEOFF_REFINE_H

#include "mesh.h"

/* `fine` takes the refined mesh: the nodes of `coarse` first, in their order, then one per edge. `parent`, unless NULL,
 * takes the two ends of the edge of each new node (malloc, 2 per new node). STATUS_MEMORY. */
int refine_mesh(const struct mesh *coarse, struct mesh *fine, uint32_t **parent, struct failure *why);

#endif
