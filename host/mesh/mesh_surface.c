#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh_topology.h"

static int no_memory(const struct mesh *mesh, struct failure *why)
{
    return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for the surface");
}

/* Faces that belong to one element become triangles of nodes; returns how many, in the order of elements. */
static int by_element(const void *a, const void *b)
{
    const struct face *x = a, *y = b;
    if (x->element != y->element)
        return x->element < y->element ? -1 : 1;
    return x->opposite - y->opposite;
}

static size_t keep_boundary(struct face *face, size_t count)
{
    size_t kept = 0;
    for (size_t i = 0, end; i < count; i = end) {
        for (end = i + 1; end < count && same_face(&face[i], &face[end]); end++)
            ;
        if (end - i == 1)
            face[kept++] = face[i];
    }
    qsort(face, kept, sizeof *face, by_element);
    return kept;
}

static int number_vertices(const struct mesh *mesh, const struct face *face, struct surface *surface,
                           struct failure *why)
{
    size_t n = mesh->node_count, count = surface->triangle_count;
    surface->vertex_of = malloc((n ? n : 1) * sizeof *surface->vertex_of);
    surface->triangles = malloc((count ? count : 1) * 3 * sizeof *surface->triangles);
    if (!surface->vertex_of || !surface->triangles)
        return no_memory(mesh, why);
    for (size_t i = 0; i < n; i++)
        surface->vertex_of[i] = UINT32_MAX;
    for (size_t i = 0; i < 3 * count; i++)
        surface->vertex_of[face[i / 3].node[i % 3]] = 0;
    for (size_t i = 0; i < n; i++)
        if (surface->vertex_of[i] == 0)
            surface->vertex_of[i] = (uint32_t)surface->vertex_count++;
    surface->node = malloc((surface->vertex_count ? surface->vertex_count : 1) * sizeof *surface->node);
    if (!surface->node)
        return no_memory(mesh, why);
    for (size_t i = 0; i < n; i++)
        if (surface->vertex_of[i] != UINT32_MAX)
            surface->node[surface->vertex_of[i]] = (uint32_t)i;
    for (size_t i = 0; i < 3 * count; i++) {
        const struct face *f = &face[i / 3];
        uint32_t node = mesh->tetrahedra[4 * (size_t)f->element + face_corner[f->opposite][i % 3]];
        surface->triangles[i] = surface->vertex_of[node];
    }
    return STATUS_OK;
}

/* Across an edge with two triangles each is the other's neighbour. Where more meet (mesh_check refuses that), each
 * triangle takes one that runs the other way, so that walking over the surface stays defined. */
static int join_neighbours(const struct mesh *mesh, struct surface *surface, struct failure *why)
{
    size_t sides = 3 * surface->triangle_count;
    struct side *side;
    surface->neighbours = malloc((sides ? sides : 1) * sizeof *surface->neighbours);
    if (!surface->neighbours)
        return no_memory(mesh, why);
    int status = triangle_sides(surface->triangles, surface->triangle_count, mesh->path, &side, why);
    if (status)
        return status;
    for (size_t i = 0, end; i < sides; i = end) {
        for (end = i + 1; end < sides && same_edge(&side[i], &side[end]); end++)
            ;
        for (size_t a = i; a < end; a++) {
            size_t across = a;
            for (size_t b = i; b < end && across == a; b++)
                if (b != a && side[b].forward != side[a].forward)
                    across = b;
            surface->neighbours[3 * side[a].triangle + side[a].opposite] = side[across].triangle;
        }
    }
    free(side);
    return STATUS_OK;
}

static int measure(const struct mesh *mesh, struct surface *surface, struct failure *why)
{
    size_t n = surface->vertex_count;
    surface->normals = calloc(n ? 3 * n : 1, sizeof *surface->normals);
    surface->areas = calloc(n ? n : 1, sizeof *surface->areas);
    if (!surface->normals || !surface->areas)
        return no_memory(mesh, why);
    for (size_t t = 0; t < surface->triangle_count; t++) {
        const uint32_t *v = surface->triangles + 3 * t;
        const double *p[3];
        for (int k = 0; k < 3; k++)
            p[k] = mesh->nodes + 3 * (size_t)surface->node[v[k]];
        for (int corner = 0; corner < 3; corner++) {
            const double *a = p[corner], *b = p[(corner + 1) % 3], *c = p[(corner + 2) % 3];
            double u[3], w[3], m[3], dot = 0, cross = 0;
            for (int k = 0; k < 3; k++) {
                u[k] = b[k] - a[k];
                w[k] = c[k] - a[k];
            }
            for (int k = 0; k < 3; k++) {
                m[k] = u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3];
                dot += u[k] * w[k];
            }
            cross = hypot(hypot(m[0], m[1]), m[2]);
            surface->areas[v[corner]] += cross / 6;
            for (int k = 0; k < 3 && cross > 0; k++)
                surface->normals[3 * (size_t)v[corner] + k] += atan2(cross, dot) * m[k] / cross;
        }
    }
    for (size_t i = 0; i < n; i++) {
        double *normal = surface->normals + 3 * i, length = hypot(hypot(normal[0], normal[1]), normal[2]);
        for (int k = 0; k < 3; k++)
            normal[k] = length > 0 ? normal[k] / length : k == 2;
    }
    return STATUS_OK;
}

int mesh_surface(const struct mesh *mesh, struct surface *surface, struct failure *why)
{
    struct face *face;
    *surface = (struct surface){0};
    int status = mesh_faces(mesh, &face, why);
    if (status)
        return status;
    surface->triangle_count = keep_boundary(face, 4 * mesh->tetrahedron_count);
    status = number_vertices(mesh, face, surface, why);
    free(face);
    if (status == STATUS_OK)
        status = join_neighbours(mesh, surface, why);
    if (status == STATUS_OK)
        status = measure(mesh, surface, why);
    if (status)
        surface_free(surface);
    return status;
}

void surface_free(struct surface *surface)
{
    free(surface->node);
    free(surface->vertex_of);
    free(surface->triangles);
    free(surface->neighbours);
    free(surface->normals);
    free(surface->areas);
    *surface = (struct surface){0};
}
