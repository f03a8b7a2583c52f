#include "mesh_topology.h"

#include <stdlib.h>
#include <string.h>

const unsigned char face_corner[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

static int by_node(const void *a, const void *b)
{
    const struct face *x = a, *y = b;
    for (int k = 0; k < 3; k++)
        if (x->node[k] != y->node[k])
            return x->node[k] < y->node[k] ? -1 : 1;
    return x->element < y->element ? -1 : x->element > y->element;
}

bool same_face(const struct face *a, const struct face *b)
{
    return memcmp(a->node, b->node, sizeof a->node) == 0;
}

int mesh_faces(const struct mesh *mesh, struct face **faces, struct failure *why)
{
    size_t count = 4 * mesh->tetrahedron_count;
    struct face *list = malloc((count ? count : 1) * sizeof *list);
    *faces = list;
    if (!list)
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for %zu faces", count);
    for (size_t i = 0; i < count; i++) {
        const uint32_t *corner = mesh->tetrahedra + i / 4 * 4;
        struct face *f = &list[i];
        *f = (struct face){.element = (uint32_t)(i / 4), .opposite = (uint8_t)(i % 4)};
        for (int k = 0; k < 3; k++)
            f->node[k] = corner[face_corner[i % 4][k]];
        for (int k = 0; k < 3; k++) { /* three exchanges of neighbours sort three numbers */
            int left = k % 2;
            if (f->node[left] > f->node[left + 1]) {
                uint32_t t = f->node[left];
                f->node[left] = f->node[left + 1];
                f->node[left + 1] = t;
                f->odd = !f->odd;
            }
        }
    }
    qsort(list, count, sizeof *list, by_node);
    return STATUS_OK;
}

static int by_edge(const void *a, const void *b)
{
    const struct side *x = a, *y = b;
    if (x->low != y->low)
        return x->low < y->low ? -1 : 1;
    if (x->high != y->high)
        return x->high < y->high ? -1 : 1;
    return x->triangle < y->triangle ? -1 : x->triangle > y->triangle;
}

bool same_edge(const struct side *a, const struct side *b)
{
    return a->low == b->low && a->high == b->high;
}

int triangle_sides(const uint32_t *triangles, size_t count, const char *path, struct side **sides, struct failure *why)
{
    struct side *list = malloc((count ? 3 * count : 1) * sizeof *list);
    *sides = list;
    if (!list)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for %zu edges", 3 * count);
    for (size_t i = 0; i < 3 * count; i++) {
        const uint32_t *v = triangles + i / 3 * 3;
        uint32_t a = v[(i + 1) % 3], b = v[(i + 2) % 3];
        list[i] = (struct side){.low = a < b ? a : b,
                                .high = a < b ? b : a,
                                .triangle = (uint32_t)(i / 3),
                                .opposite = (uint8_t)(i % 3),
                                .forward = a < b};
    }
    qsort(list, 3 * count, sizeof *list, by_edge);
    return STATUS_OK;
}

uint32_t *sets_start(size_t count, const char *path, struct failure *why)
{
    uint32_t *parent = malloc((count ? count : 1) * sizeof *parent);
    if (!parent)
        failure_set(why, STATUS_MEMORY, path, NULL, "no memory for %zu sets", count);
    else
        for (size_t i = 0; i < count; i++)
            parent[i] = (uint32_t)i;
    return parent;
}

uint32_t sets_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i) {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    return i;
}

void sets_join(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = sets_root(parent, a);
    b = sets_root(parent, b);
    if (a < b) /* towards the lower number: the first member names the set */
        parent[b] = a;
    else
        parent[a] = b;
}

/* (i + 1) % 3 of `opposite` and (i + 2) % 3 are the corners on the edge; the one that is vertex v. */
static uint32_t corner_at(const uint32_t *triangles, const struct side *side, uint32_t v)
{
    uint32_t first = 3 * side->triangle + (side->opposite + 1u) % 3,
             second = 3 * side->triangle + (side->opposite + 2u) % 3;
    return triangles[first] == v ? first : second;
}

static void count_edges(const uint32_t *triangles, size_t triangle_count, const struct side *side, uint32_t *fan,
                        uint32_t *shell, struct manifold *found)
{
    size_t edges = 0;
    for (size_t i = 0, end; i < 3 * triangle_count; i = end, edges++) {
        for (end = i + 1; end < 3 * triangle_count && same_edge(&side[i], &side[end]); end++) {
            sets_join(shell, side[i].triangle, side[end].triangle);
            sets_join(fan, corner_at(triangles, &side[i], side[i].low), corner_at(triangles, &side[end], side[i].low));
            sets_join(fan, corner_at(triangles, &side[i], side[i].high),
                      corner_at(triangles, &side[end], side[i].high));
        }
        if (end - i == 1 && found->open_edges++ == 0)
            found->open_at = side[i].low;
        if (end - i > 2 && found->crowded_edges++ == 0)
            found->crowded_at = side[i].low;
        if (end - i == 2 && side[i].forward == side[i + 1].forward)
            found->misoriented_edges++;
    }
    found->euler -= (int64_t)edges;
}

int manifold_of(const uint32_t *triangles, size_t triangle_count, size_t vertex_count, const char *path,
                struct manifold *found, struct failure *why)
{
    *found = (struct manifold){
        .euler = (int64_t)triangle_count, .crowded_at = UINT32_MAX, .open_at = UINT32_MAX, .pinched_at = UINT32_MAX};
    struct side *sides;
    int status = triangle_sides(triangles, triangle_count, path, &sides, why);
    uint32_t *fan = sets_start(3 * triangle_count, path, why), *shell = sets_start(triangle_count, path, why);
    unsigned char *fans = calloc(vertex_count ? vertex_count : 1, 1);
    if (status == STATUS_OK && fan && shell && fans) {
        count_edges(triangles, triangle_count, sides, fan, shell, found);
        for (size_t i = 0; i < triangle_count; i++)
            found->shells += shell[i] == i;
        for (size_t i = 0; i < 3 * triangle_count; i++) {
            if (fan[i] != i)
                continue;
            found->euler++;
            if (fans[triangles[i]] < 2 && ++fans[triangles[i]] == 2 && found->pinched_vertices++ == 0)
                found->pinched_at = triangles[i];
        }
    } else {
        status = failure_set(why, STATUS_MEMORY, path, NULL, "no memory for %zu triangles", triangle_count);
    }
    free(sides);
    free(fan);
    free(shell);
    free(fans);
    return status;
}
