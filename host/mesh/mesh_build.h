/* How a reader fills a mesh: nodes, tetrahedra one by one, names of labels, and a last step that lists the labels.
 * Memory grows with what was really read. On failure the caller frees the mesh; build_free frees the rest. */
#ifndef TROCAR_MESH_BUILD_H
#define TROCAR_MESH_BUILD_H

#include "mesh.h"
#include "mesh_scan.h"

struct build {
    struct mesh *mesh;
    size_t node_room, tetrahedron_room;
    struct mesh_label *name; /* names the file gives, of labels that occur or not */
    size_t name_count, name_room;
};

/* What is done with an element: its four corners are kept, it is counted, or the file is refused. */
enum cell_use { CELL_UNKNOWN, CELL_TETRAHEDRON, CELL_IGNORED, CELL_REFUSED };

struct cell_kind {
    enum cell_use use;
    int nodes; /* 0: any number */
    const char *name;
};

/* Append nodes (grows; coordinates of the new ones are zero). */
int build_nodes(struct build *b, struct scan *s, size_t count);
/* Corners are places of nodes, already checked. */
int build_tetrahedron(struct build *b, struct scan *s, const uint32_t corner[4], int32_t label);
int build_name(struct build *b, struct scan *s, int32_t number, const char *name, size_t length);
/* "element 12 is a hexahedron" */
int build_refuse(struct scan *s, int64_t element, const struct cell_kind *kind);
/* The distinct labels with their names; fails if there is no tetrahedron. */
int build_finish(struct build *b, struct scan *s);
void build_free(struct build *b);

#endif
