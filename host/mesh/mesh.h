/* A tetrahedral mesh in memory and its surface. Coordinates are metres once mesh_scale ran; before, the file's own
 * unit. Tetrahedra are positively oriented: (P1-P0)x(P2-P0).(P3-P0) > 0 (mesh_check repairs the order). */
#ifndef TROCAR_MESH_H
#define TROCAR_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "failure.h"

struct mesh_label {
    int32_t number;
    char name[64]; /* physical group, Vega set or region; "" when the file has only numbers */
};

/* Numbers that the mesh file has for each node beside its place; NaN where it has none. */
struct mesh_data {
    char name[64];
    size_t components, nodes; /* nodes it has values for: all of the mesh once it is read */
    double *value;            /* `components` per node; NULL: the file has no such array */
};

struct mesh {
    size_t node_count;
    double *nodes; /* 3 per node */
    size_t tetrahedron_count;
    uint32_t *tetrahedra; /* 4 per element */
    int32_t *labels;      /* 1 per element; 0 when the file has none */
    size_t label_count;   /* distinct labels that occur in `labels` */
    struct mesh_label *label;
    size_t data_count;
    struct mesh_data *data;  /* as mesh_read_data was asked for */
    uint32_t file_hash;      /* CRC-32 of the file's bytes (of both files for TetGen, .node then .ele) */
    char path[1024];         /* as given */
    size_t ignored_elements; /* points, lines, triangles and quadrangles that the file has beside its tetrahedra */
    char warning[400];       /* what the reader had to leave out, a clause to print once; "" if nothing */
};

/* The boundary of a mesh. Vertices are numbered anew: vertex v is mesh node node[v], in increasing node order. */
struct surface {
    size_t vertex_count;
    uint32_t *node;      /* vertex -> mesh node */
    uint32_t *vertex_of; /* mesh node -> vertex, UINT32_MAX inside; node_count entries */
    size_t triangle_count;
    uint32_t *triangles;  /* 3 vertices each, counter-clockwise seen from outside */
    uint32_t *neighbours; /* 3 per triangle: the triangle across the edge opposite vertex k */
    double *normals;      /* 3 per vertex: angle-weighted outward unit normal */
    double *areas;        /* 1 per vertex: a third of the area of its triangles, m2 */
};

/* What mesh_check found. Counts are of the file as read. */
struct mesh_report {
    size_t nodes, tetrahedra, surface_vertices, surface_triangles;
    size_t reoriented;         /* elements listed with negative orientation, repaired by a swap */
    size_t duplicate_nodes;    /* merged */
    size_t duplicate_elements; /* removed */
    size_t unused_nodes;       /* dropped */
    size_t degenerate;         /* |volume| < 1e-9 of the mean edge length cubed: an error */
    size_t overlapping;        /* inverted relative to a neighbour across a shared face: an error */
    size_t nonmanifold_edges, nonmanifold_vertices;
    size_t components;
    size_t genus; /* of the surface, all components together */
    double extent[3], minimum[3], maximum[3];
    double volume;
    double dihedral_min_deg, dihedral_max_deg;
    size_t dihedral_histogram[18]; /* bins of 10 degrees over all 6 angles of all elements */
    double edge_min, edge_mean, edge_max;
};

enum mesh_unit { MESH_UNIT_NONE, MESH_UNIT_M, MESH_UNIT_CM, MESH_UNIT_MM };

/* Read FILE: Gmsh 1, 2, 4 (ASCII, binary), legacy VTK, VTU, TetGen (.node or .ele), Vega .veg; STL, OBJ, PLY, VTP
 * surfaces are filled with tetrahedra by build/trocar-mesher (Gmsh) at element size `surface_size` in file units (0:
 * keep the surface's own triangles). The format follows from the content where it can, else the extension. Errors name
 * the file and the line (text) or the byte (binary). */
int mesh_read(const char *path, double surface_size, struct mesh *mesh, struct failure *why);

/* The same, with the arrays of node data of these names (at most 63 bytes each): POINT_DATA of VTK files, $NodeData of
 * Gmsh files of version 2 and later. An array that the file lacks is no error here. mesh_check drops and merges values
 * with their nodes; of nodes at one place the first one's stay. */
int mesh_read_data(const char *path, double surface_size, const char *const *name, size_t names, struct mesh *mesh,
                   struct failure *why);

/* Repair what can be repaired without changing the body (orientation, duplicate and unused nodes, duplicate elements),
 * measure, and judge: returns STATUS_OK, or the first reason for which the mesh cannot be used. `report` is filled in
 * either case. Several components are an error unless `allow_components`. */
int mesh_check(struct mesh *mesh, bool allow_components, struct mesh_report *report, struct failure *why);

/* The file can be read and its content, or else its extension, is that of a mesh format; it may be damaged all the same. */
bool mesh_is_known(const char *path);

/* Scale to metres: by unit, or so that the longest side of the bounding box is `extent_m` (> 0 wins over unit). */
int mesh_scale(struct mesh *mesh, double extent_m, enum mesh_unit unit, struct failure *why);

/* Extract the surface of a checked mesh. */
int mesh_surface(const struct mesh *mesh, struct surface *surface, struct failure *why);

/* Write Gmsh 2.2 ASCII with labels. */
int mesh_write_msh(const struct mesh *mesh, const char *path, struct failure *why);

void mesh_free(struct mesh *mesh);
void surface_free(struct surface *surface);

#endif
