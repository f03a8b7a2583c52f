/* A surface as its file gives it: vertices and triangles, in the file's own unit. Readers fill it; soup_close makes a closed
 * manifold of it or says why not; shells tell the mesher what is inside what. */
#ifndef TROCAR_TRIANGLE_SOUP_H
#define TROCAR_TRIANGLE_SOUP_H

#include "mesh_scan.h"

enum { SOUP_POLYGON = 256 }; /* corners of a polygon, at most */

struct soup {
    size_t vertex_count, vertex_room;
    double *vertices; /* 3 each */
    size_t triangle_count, triangle_room;
    uint32_t *triangles; /* 3 each */
    size_t shell_count;
    uint32_t *shell; /* 1 per triangle, after soup_close */
    int32_t *inside; /* 1 per shell: the shell whose cavity this one is, or -1 if it bounds a body from outside */
};

int soup_vertex(struct soup *soup, struct scan *s, const double x[3]);
/* Indices of vertices read so far (or to come: soup_close checks them). */
int soup_triangle(struct soup *soup, struct scan *s, uint32_t a, uint32_t b, uint32_t c);
/* Cut a polygon of 3 to 256 vertices, which must be there already, into triangles by clipping ears. */
int soup_polygon(struct soup *soup, struct scan *s, const uint32_t *vertex, size_t count);

/* Weld vertices at one place, drop triangles without area that this makes and vertices without triangles, check that the
 * surface is closed and that no edge has more than two triangles, turn the triangles to agree with each other, and every
 * shell outwards (or inwards if it is a cavity). */
int soup_close(struct soup *soup, const char *path, struct failure *why);
void soup_free(struct soup *soup);

#endif
