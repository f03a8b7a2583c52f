/* Arrays of node data, from the readers to their users. */
#ifndef TROCAR_MESH_DATA_H
#define TROCAR_MESH_DATA_H

#include "mesh.h"

/* An entry for `name` (cut to 63 bytes), found or not; NULL without memory. */
struct mesh_data *mesh_data_want(struct mesh *mesh, const char *name);
/* The wanted array of that name, still empty or not; NULL when nobody asked for it. */
struct mesh_data *mesh_data_wanted(struct mesh *mesh, const char *name);
/* The array with a value for every node, or NULL. */
const struct mesh_data *mesh_data_find(const struct mesh *mesh, const char *name);

/* Values of the next `nodes` nodes; ignored when earlier ones had other components. False without memory. */
bool mesh_data_append(struct mesh_data *data, size_t components, const double *values, size_t nodes);
/* Arrays that do not cover the mesh's nodes are emptied: of a surface that was filled, the nodes are not the file's. */
void mesh_data_settle(struct mesh *mesh);
/* Node `from` becomes node `to`, with to <= from. */
void mesh_data_move(struct mesh *mesh, size_t from, size_t to);
void mesh_data_free(struct mesh *mesh);

#endif
