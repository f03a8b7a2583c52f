/* The finite-element space on a mesh: linear tetrahedra (P1, 4 nodes) or quadratic ones (P2, 10 nodes, straight edges).
 * Its nodes are the mesh's, then, for P2, the middle of every edge, in increasing order of the edge's ends. */
#ifndef TROCAR_SPACE_H
#define TROCAR_SPACE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "element.h"
#include "failure.h"
#include "mesh.h"

struct space {
    const struct mesh *mesh; /* outlives the space */
    enum element_order order;
    size_t node_count, edge_count; /* edges: P2 only */
    uint32_t (*edge)[2];           /* P2: ends of the edge whose middle is node mesh->node_count + e, low < high */
    uint32_t *nodes;               /* element_nodes(order) per element, as element.h numbers them */
};

int space_create(const struct mesh *mesh, enum element_order order, struct space *space, struct failure *why);
void space_free(struct space *space);

/* Node in the middle of the edge between two mesh nodes; they must be the ends of one. P2 only. */
uint32_t space_middle(const struct space *space, uint32_t a, uint32_t b);

/* The mesh nodes that a node is the mean of: itself twice, or the ends of its edge. */
void space_ends(const struct space *space, size_t node, uint32_t ends[2]);

#endif
