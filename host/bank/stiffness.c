#include "stiffness.h"

#include <stdlib.h>
#include <string.h>

/* Elements around each node: list[start[n] .. start[n+1]-1]. */
struct incidence {
    size_t *start;
    uint32_t *list;
};

static bool incidence_build(const struct space *space, struct incidence *at)
{
    size_t each = element_nodes(space->order), all = each * space->mesh->tetrahedron_count;
    at->start = calloc(space->node_count + 2, sizeof *at->start);
    at->list = malloc((all + 1) * sizeof *at->list);
    if (!at->start || !at->list)
        return false;
    /* counted two places ahead: after the fill, start[n] is where it belongs without a second array */
    for (size_t i = 0; i < all; i++)
        at->start[space->nodes[i] + 2]++;
    for (size_t n = 2; n <= space->node_count + 1; n++)
        at->start[n] += at->start[n - 1];
    for (size_t i = 0; i < all; i++)
        at->list[at->start[space->nodes[i] + 1]++] = (uint32_t)(i / each);
    return true;
}

/* The neighbours of one node that are not below it, the node itself included, in increasing order. */
struct neighbourhood {
    uint32_t *node, *place; /* place[n]: position of node n in `node`; valid for members only */
    size_t *seen;           /* seen[n] == visit: member */
    size_t count, visit;
};

static void neighbourhood_gather(struct neighbourhood *around, const struct space *space, const struct incidence *at,
                                 uint32_t centre)
{
    size_t each = element_nodes(space->order);
    around->visit++;
    around->count = 0;
    for (size_t e = at->start[centre]; e < at->start[centre + 1]; e++)
        for (size_t k = 0; k < each; k++) {
            uint32_t n = space->nodes[each * at->list[e] + k];
            if (n < centre || around->seen[n] == around->visit)
                continue;
            around->seen[n] = around->visit;
            size_t i = around->count++;
            for (; i > 0 && around->node[i - 1] > n;
                 i--) /* insertion: a node has a dozen neighbours, a hundred in P2 */
                around->node[i] = around->node[i - 1];
            around->node[i] = n;
        }
    for (size_t i = 0; i < around->count; i++)
        around->place[around->node[i]] = (uint32_t)i;
}

/* Column pointers of K; returns the number of entries. */
static size_t count_entries(const struct space *space, const struct incidence *at, const int32_t *unknown,
                            struct neighbourhood *around, int32_t *column_start)
{
    size_t entries = 0;
    column_start[0] = 0;
    for (size_t j = 0; j < space->node_count; j++) {
        neighbourhood_gather(around, space, at, (uint32_t)j);
        size_t below = 0; /* free components of the higher neighbours */
        for (size_t i = 1; i < around->count; i++)
            for (int a = 0; a < 3; a++)
                below += unknown[3 * (size_t)around->node[i] + a] >= 0;
        for (int b = 0; b < 3; b++) {
            int32_t column = unknown[3 * j + b];
            if (column < 0)
                continue;
            entries += below;
            for (int a = b; a < 3; a++)
                entries += unknown[3 * j + a] >= 0;
            column_start[column + 1] = (int32_t)entries;
        }
    }
    return entries;
}

static void write_columns(uint32_t j, const struct neighbourhood *around, const double *block, const int32_t *unknown,
                          const int32_t *column_start, int32_t *row, double *value)
{
    for (int b = 0; b < 3; b++) {
        int32_t column = unknown[3 * (size_t)j + b];
        if (column < 0)
            continue;
        int32_t at = column_start[column];
        for (size_t i = 0; i < around->count; i++)
            for (int a = i == 0 ? b : 0; a < 3; a++) {
                int32_t r = unknown[3 * (size_t)around->node[i] + a];
                if (r < 0)
                    continue;
                row[at] = r;
                value[at++] = block[9 * i + 3 * a + b];
            }
    }
}

static void fill_entries(const struct space *space, const struct element *elements, const struct hooke *material,
                         const uint32_t *material_of, const struct incidence *at, const int32_t *unknown,
                         struct springs springs, struct neighbourhood *around, double *block, cholmod_sparse *K)
{
    size_t each = element_nodes(space->order);
    for (uint32_t j = 0; j < space->node_count; j++) {
        neighbourhood_gather(around, space, at, j);
        if (around->count == 0)
            continue;
        memset(block, 0, 9 * around->count * sizeof *block);
        for (size_t e = at->start[j]; e < at->start[j + 1]; e++) {
            size_t t = at->list[e];
            const uint32_t *node = space->nodes + each * t;
            size_t own = 0;
            while (node[own] != j)
                own++;
            for (size_t k = 0; k < each; k++)
                if (node[k] >= j)
                    element_add_block(&elements[t], &material[material_of[t]], space->order, k, own,
                                      block + 9 * around->place[node[k]]);
        }
        if (springs.tensor) {
            static const int at_6[9] = {0, 3, 4, 3, 1, 5, 4, 5, 2};
            for (int c = 0; c < 9; c++)
                block[c] += springs.tensor[j][at_6[c]];
        }
        write_columns(j, around, block, unknown, K->p, K->i, K->x);
    }
}

int stiffness_assemble(const struct space *space, const struct hooke *material, const uint32_t *material_of,
                       const int32_t *unknown, size_t unknowns, struct springs springs, cholmod_common *common,
                       cholmod_sparse **K, struct failure *why)
{
    *K = NULL;
    const struct mesh *mesh = space->mesh;
    size_t nodes = space->node_count;
    struct incidence at = {NULL, NULL};
    struct neighbourhood around = {.node = malloc((nodes + 1) * sizeof *around.node),
                                   .place = malloc((nodes + 1) * sizeof *around.place),
                                   .seen = calloc(nodes + 1, sizeof *around.seen)};
    struct element *elements = malloc((mesh->tetrahedron_count + 1) * sizeof *elements);
    double *block = malloc(9 * (nodes + 1) * sizeof *block);
    int32_t *column_start = malloc((unknowns + 1) * sizeof *column_start);
    bool good =
        incidence_build(space, &at) && around.node && around.place && around.seen && elements && block && column_start;
    if (good) {
        for (size_t t = 0; t < mesh->tetrahedron_count; t++)
            elements[t] = element_geometry(mesh->nodes, mesh->tetrahedra + 4 * t);
        size_t entries = count_entries(space, &at, unknown, &around, column_start);
        if (entries <= INT32_MAX)
            *K = cholmod_allocate_sparse(unknowns, unknowns, entries, 1, 1, -1, CHOLMOD_REAL, common);
        good = *K != NULL;
    }
    if (good) {
        memcpy((*K)->p, column_start, (unknowns + 1) * sizeof *column_start);
        fill_entries(space, elements, material, material_of, &at, unknown, springs, &around, block, *K);
    }
    free(at.start);
    free(at.list);
    free(around.node);
    free(around.place);
    free(around.seen);
    free(elements);
    free(block);
    free(column_start);
    if (!good)
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for the stiffness matrix of %zu unknowns",
                           unknowns);
    return STATUS_OK;
}
