/* What the two generations of the Gmsh format share; sections of versions 1 and 2 are in read_gmsh.c, of 4 in
 * read_gmsh4.c. */
#ifndef TROCAR_READ_GMSH_H
#define TROCAR_READ_GMSH_H

#include "mesh_build.h"
#include "mesh_node_ids.h"

struct gmsh_entity {
    int64_t tag;
    int32_t physical;
};

struct gmsh {
    struct scan *s;
    struct build build;
    struct node_ids ids;
    int generation; /* 1, 2 or 4 */
    bool binary;
    bool have_nodes, have_elements;
    struct gmsh_entity *volume; /* version 4: the volumes and their first physical group */
    size_t volume_count;
};

const struct cell_kind *gmsh_kind(int64_t type);
/* Add or count one element with its corners given as the file's node numbers. */
int gmsh_element(struct gmsh *g, const struct cell_kind *kind, int64_t number, const int64_t *node, int32_t label);
int gmsh_finish_nodes(struct gmsh *g);
/* Binary sections: from the end of a line that holds only the section's name to the bytes after it, and back. */
int gmsh_begin_binary(struct gmsh *g);

/* $NodeData, of any generation with a $MeshFormat: kept when the mesh wants an array of its name. */
int gmsh_node_data(struct gmsh *g);

int gmsh4_entities(struct gmsh *g);
int gmsh4_nodes(struct gmsh *g);
int gmsh4_elements(struct gmsh *g);

#endif
