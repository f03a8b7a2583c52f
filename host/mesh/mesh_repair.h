/* The repairs that change how a body is written down, not the body: one node per place, no element twice, no node
 * without an element, corners in positive order. In this order, as each step can make work for the next. */
#ifndef TROCAR_MESH_REPAIR_H
#define TROCAR_MESH_REPAIR_H

#include "mesh.h"

/* The signed volume of element e, and its six edge lengths (edge k joins corners edge_ends[k]). */
extern const unsigned char edge_ends[6][2];
double tetrahedron_volume(const struct mesh *mesh, size_t e);
void tetrahedron_edges(const struct mesh *mesh, size_t e, double length[6]);

/* Fills reoriented, duplicate_nodes, duplicate_elements, unused_nodes of the report. */
int mesh_repair(struct mesh *mesh, struct mesh_report *report, struct failure *why);

#endif
