#include "space.h"

#include <stdlib.h>
#include <string.h>

static int by_ends(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    if (x[0] != y[0])
        return x[0] < y[0] ? -1 : 1;
    return (x[1] > y[1]) - (x[1] < y[1]);
}

static void edge_of(uint32_t a, uint32_t b, uint32_t edge[2])
{
    edge[0] = a < b ? a : b;
    edge[1] = a < b ? b : a;
}

static void list_edges(struct space *space)
{
    size_t all = 6 * space->mesh->tetrahedron_count, count = 0;
    for (size_t i = 0; i < all; i++) {
        const uint32_t *corner = space->mesh->tetrahedra + 4 * (i / 6);
        edge_of(corner[element_edge[i % 6][0]], corner[element_edge[i % 6][1]], space->edge[i]);
    }
    qsort(space->edge, all, sizeof space->edge[0], by_ends);
    for (size_t i = 0; i < all; i++)
        if (count == 0 || by_ends(space->edge[count - 1], space->edge[i]) != 0)
            memmove(space->edge[count++], space->edge[i], sizeof space->edge[0]);
    space->edge_count = count;
}

int space_create(const struct mesh *mesh, enum element_order order, struct space *space, struct failure *why)
{
    size_t each = element_nodes(order), elements = mesh->tetrahedron_count;
    *space = (struct space){.mesh = mesh, .order = order, .node_count = mesh->node_count};
    space->nodes = malloc((each * elements + 1) * sizeof *space->nodes);
    if (order == ELEMENT_QUADRATIC)
        space->edge = malloc((6 * elements + 1) * sizeof *space->edge);
    if (!space->nodes || (order == ELEMENT_QUADRATIC && !space->edge)) {
        space_free(space);
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for the nodes of %zu elements", elements);
    }
    if (order == ELEMENT_QUADRATIC)
        list_edges(space);
    space->node_count += space->edge_count;
    for (size_t t = 0; t < elements; t++) {
        const uint32_t *corner = mesh->tetrahedra + 4 * t;
        uint32_t *node = space->nodes + each * t;
        memcpy(node, corner, 4 * sizeof *node);
        for (size_t k = 4; k < each; k++)
            node[k] = space_middle(space, corner[element_edge[k - 4][0]], corner[element_edge[k - 4][1]]);
    }
    return STATUS_OK;
}

void space_free(struct space *space)
{
    free(space->edge);
    free(space->nodes);
    *space = (struct space){0};
}

uint32_t space_middle(const struct space *space, uint32_t a, uint32_t b)
{
    uint32_t key[2];
    edge_of(a, b, key);
    const uint32_t(*found)[2] = bsearch(key, space->edge, space->edge_count, sizeof key, by_ends);
    return (uint32_t)(space->mesh->node_count + (size_t)(found - (const uint32_t(*)[2])space->edge));
}

void space_ends(const struct space *space, size_t node, uint32_t ends[2])
{
    size_t corners = space->mesh->node_count;
    ends[0] = node < corners ? (uint32_t)node : space->edge[node - corners][0];
    ends[1] = node < corners ? (uint32_t)node : space->edge[node - corners][1];
}
