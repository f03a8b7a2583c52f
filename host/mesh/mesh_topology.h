/* The faces of a mesh's tetrahedra and the edges of triangles, sorted so that those that coincide stand together; and
 * disjoint sets. Shared by the check of a mesh, the extraction of its surface and the check of a triangle surface. */
#ifndef TROCAR_MESH_TOPOLOGY_H
#define TROCAR_MESH_TOPOLOGY_H

#include "mesh.h"

/* Corners of the face opposite corner k, counter-clockwise seen from outside a positively oriented tetrahedron. */
extern const unsigned char face_corner[4][3];

struct face {
    uint32_t node[3]; /* increasing */
    uint32_t element;
    uint8_t opposite; /* the corner of the element that is not on the face */
    uint8_t odd;      /* outward order is an odd permutation of `node` */
};

/* 4 faces per element, sorted by node; malloc. */
int mesh_faces(const struct mesh *mesh, struct face **faces, struct failure *why);
bool same_face(const struct face *a, const struct face *b);

struct side {
    uint32_t low, high; /* ends of the edge */
    uint32_t triangle;
    uint8_t opposite; /* the corner of the triangle that is not on the edge */
    uint8_t forward;  /* the triangle runs from low to high */
};

/* 3 sides per triangle, sorted by edge, then by triangle; malloc. */
int triangle_sides(const uint32_t *triangles, size_t count, const char *path, struct side **sides, struct failure *why);
bool same_edge(const struct side *a, const struct side *b);

/* Disjoint sets over 0..count-1: parent[i] = i at the start. */
uint32_t *sets_start(size_t count, const char *path, struct failure *why);
uint32_t sets_root(uint32_t *parent, uint32_t i);
void sets_join(uint32_t *parent, uint32_t a, uint32_t b);

/* What the surface made of these triangles is like. */
struct manifold {
    size_t open_edges;                        /* with one triangle */
    size_t crowded_edges;                     /* with more than two */
    size_t misoriented_edges;                 /* two triangles that run along it in the same direction */
    size_t pinched_vertices;                  /* whose triangles form more than one fan */
    size_t shells;                            /* pieces connected over edges */
    uint32_t crowded_at, open_at, pinched_at; /* a vertex of the first such, UINT32_MAX if none */
    int64_t euler; /* vertices - edges + triangles, a pinched vertex counted once per fan; 2 x shells - 2 x genus if
                      closed */
};

int manifold_of(const uint32_t *triangles, size_t triangle_count, size_t vertex_count, const char *path,
                struct manifold *found, struct failure *why);

#endif
