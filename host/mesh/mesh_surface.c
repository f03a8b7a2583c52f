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

static int order_of(const uint32_t *a, const uint32_t *b)
{
    for (int k = 0; k < 3; k++)
        if (a[k] != b[k])
            return a[k] < b[k] ? -1 : 1;
    return 0;
}

static bool is_on_face(const uint32_t *corner, int opposite, uint32_t node)
{
    for (int k = 0; k < 4; k++)
        if (k != opposite && corner[k] == node)
            return true;
    return false;
}

/* The element across the face opposite corner `opposite` of `element`, or UINT32_MAX. */
static uint32_t across(const struct face *face, size_t count, uint32_t element, int opposite, const uint32_t *corner)
{
    uint32_t node[3];
    for (int k = 0, n = 0; k < 4; k++)
        if (k != opposite)
            node[n++] = corner[k];
    for (int k = 0; k < 3; k++)
        if (node[k % 2] > node[k % 2 + 1]) {
            uint32_t t = node[k % 2];
            node[k % 2] = node[k % 2 + 1];
            node[k % 2 + 1] = t;
        }
    size_t low = 0, high = count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (order_of(face[middle].node, node) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    for (; low < count && order_of(face[low].node, node) == 0; low++)
        if (face[low].element != element)
            return face[low].element;
    return UINT32_MAX;
}

/* Where more than two triangles meet at an edge, the neighbour is the triangle at the other end of the same wedge of
 * elements: walk around the edge through the material. Returns the face it ends at as 4 x element + opposite corner. */
static uint64_t walk_wedge(const struct mesh *mesh, const struct face *face, size_t count, uint32_t element,
                           uint32_t opposite_node, uint32_t low, uint32_t high)
{
    for (size_t step = 0; step < mesh->tetrahedron_count; step++) { /* at most all elements stand around one edge */
        const uint32_t *corner = mesh->tetrahedra + 4 * (size_t)element;
        int next =
            0; /* leave by the other face at the edge: opposite the corner that the entered face has off the edge */
        while (next < 4 && (corner[next] == low || corner[next] == high || corner[next] == opposite_node))
            next++;
        if (next == 4) /* an element with a corner twice */
            break;
        uint32_t beyond = across(face, count, element, next, corner);
        if (beyond == UINT32_MAX)
            return 4 * (uint64_t)element + (uint64_t)next;
        /* seen from the next element, the entered face lacks the corner that this element does not share */
        const uint32_t *other = mesh->tetrahedra + 4 * (size_t)beyond;
        int k = 0;
        while (k < 3 && is_on_face(corner, next, other[k]))
            k++;
        opposite_node = other[k];
        element = beyond;
    }
    return UINT64_MAX;
}

struct sides {
    struct side *side;
    size_t count;
    const struct face *boundary; /* 1 per triangle */
    struct face *face;           /* all faces, once an edge needs them */
};

/* The sides i..end-1 share an edge. */
static int join_edge(const struct mesh *mesh, struct surface *surface, struct sides *s, size_t i, size_t end,
                     struct failure *why)
{
    const struct side *side = s->side;
    if (end - i == 2 && side[i].forward != side[i + 1].forward) {
        surface->neighbours[3 * side[i].triangle + side[i].opposite] = side[i + 1].triangle;
        surface->neighbours[3 * side[i + 1].triangle + side[i + 1].opposite] = side[i].triangle;
        return STATUS_OK;
    }
    int status = s->face ? STATUS_OK : mesh_faces(mesh, &s->face, why);
    for (size_t a = i; a < end && status == STATUS_OK; a++) {
        const struct face *from = &s->boundary[side[a].triangle];
        uint32_t found = side[a].triangle; /* itself, in a mesh that overlaps: such a mesh is refused */
        uint64_t to = walk_wedge(mesh, s->face, 4 * mesh->tetrahedron_count, from->element,
                                 mesh->tetrahedra[4 * (size_t)from->element + from->opposite],
                                 surface->node[side[a].low], surface->node[side[a].high]);
        for (size_t b = i; b < end; b++) {
            const struct face *f = &s->boundary[side[b].triangle];
            if (4 * (uint64_t)f->element + f->opposite == to)
                found = side[b].triangle;
        }
        surface->neighbours[3 * side[a].triangle + side[a].opposite] = found;
    }
    return status;
}

static int join_neighbours(const struct mesh *mesh, const struct face *boundary, struct surface *surface,
                           struct failure *why)
{
    struct sides s = {.count = 3 * surface->triangle_count, .boundary = boundary};
    surface->neighbours = malloc((s.count ? s.count : 1) * sizeof *surface->neighbours);
    if (!surface->neighbours)
        return no_memory(mesh, why);
    int status = triangle_sides(surface->triangles, surface->triangle_count, mesh->path, &s.side, why);
    for (size_t i = 0, end; i < s.count && status == STATUS_OK; i = end) {
        for (end = i + 1; end < s.count && same_edge(&s.side[i], &s.side[end]); end++)
            ;
        status = join_edge(mesh, surface, &s, i, end, why);
    }
    free(s.side);
    free(s.face);
    return status;
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
    if (status == STATUS_OK)
        status = join_neighbours(mesh, face, surface, why);
    free(face);
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
