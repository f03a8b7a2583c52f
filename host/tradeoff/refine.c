#include "refine.h"

#include <stdlib.h>
#include <string.h>

struct edge {
    uint32_t low, high; /* nodes */
};

static int by_ends(const void *a, const void *b)
{
    const struct edge *x = a, *y = b;
    if (x->low != y->low)
        return x->low < y->low ? -1 : 1;
    return (x->high > y->high) - (x->high < y->high);
}

static struct edge edge_of(const uint32_t *corner, int a, int b)
{
    uint32_t p = corner[a], q = corner[b];
    return p < q ? (struct edge){p, q} : (struct edge){q, p};
}

static const int edge_ends[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

/* The distinct edges, sorted. */
static struct edge *find_edges(const struct mesh *m, size_t *count)
{
    struct edge *edge = malloc((6 * m->tetrahedron_count + 1) * sizeof *edge);
    if (!edge)
        return NULL;
    size_t n = 0, kept = 0;
    for (size_t t = 0; t < m->tetrahedron_count; t++)
        for (int e = 0; e < 6; e++)
            edge[n++] = edge_of(&m->tetrahedra[4 * t], edge_ends[e][0], edge_ends[e][1]);
    qsort(edge, n, sizeof *edge, by_ends);
    for (size_t k = 0; k < n; k++)
        if (kept == 0 || by_ends(&edge[k], &edge[kept - 1]) != 0)
            edge[kept++] = edge[k];
    *count = kept;
    return edge;
}

int refine_mesh(const struct mesh *coarse, struct mesh *fine, uint32_t **parent, struct failure *why)
{
    /* corners 0..3, midpoints 4..9 in the order of edge_ends; the octahedron is cut along 02 - 13 */
    static const int child[8][4] = {{0, 4, 5, 6}, {4, 1, 7, 8}, {5, 7, 2, 9}, {6, 8, 9, 3},
                                    {4, 5, 6, 8}, {4, 7, 5, 8}, {5, 9, 6, 8}, {5, 7, 9, 8}};
    size_t edges = 0;
    *fine = *coarse;
    fine->nodes = NULL, fine->tetrahedra = NULL, fine->labels = NULL, fine->label = NULL;
    struct edge *edge = find_edges(coarse, &edges);
    fine->node_count = coarse->node_count + edges;
    fine->tetrahedron_count = 8 * coarse->tetrahedron_count;
    fine->nodes = malloc((3 * fine->node_count + 1) * sizeof *fine->nodes);
    fine->tetrahedra = malloc((4 * fine->tetrahedron_count + 1) * sizeof *fine->tetrahedra);
    fine->labels = malloc((fine->tetrahedron_count + 1) * sizeof *fine->labels);
    fine->label = malloc((coarse->label_count + 1) * sizeof *fine->label);
    uint32_t *ends = malloc((2 * edges + 1) * sizeof *ends);
    if (!edge || !fine->nodes || !fine->tetrahedra || !fine->labels || !fine->label || !ends ||
        fine->node_count >= UINT32_MAX) {
        free(edge);
        free(ends);
        mesh_free(fine);
        return failure_set(why, STATUS_MEMORY, coarse->path, NULL, "no memory to refine %zu tetrahedra",
                           coarse->tetrahedron_count);
    }
    memcpy(fine->nodes, coarse->nodes, 3 * coarse->node_count * sizeof *fine->nodes);
    if (coarse->label_count)
        memcpy(fine->label, coarse->label, coarse->label_count * sizeof *fine->label);
    for (size_t e = 0; e < edges; e++) {
        ends[2 * e] = edge[e].low, ends[2 * e + 1] = edge[e].high;
        for (int k = 0; k < 3; k++)
            fine->nodes[3 * (coarse->node_count + e) + k] =
                (coarse->nodes[3 * edge[e].low + k] + coarse->nodes[3 * edge[e].high + k]) / 2;
    }
    for (size_t t = 0; t < coarse->tetrahedron_count; t++) {
        uint32_t node[10];
        memcpy(node, &coarse->tetrahedra[4 * t], 4 * sizeof *node);
        for (int e = 0; e < 6; e++) {
            struct edge key = edge_of(node, edge_ends[e][0], edge_ends[e][1]);
            const struct edge *at = bsearch(&key, edge, edges, sizeof *edge, by_ends);
            node[4 + e] = (uint32_t)(coarse->node_count + (size_t)(at - edge));
        }
        for (int c = 0; c < 8; c++) {
            for (int k = 0; k < 4; k++)
                fine->tetrahedra[4 * (8 * t + c) + k] = node[child[c][k]];
            fine->labels[8 * t + c] = coarse->labels[t];
        }
    }
    free(edge);
    if (parent)
        *parent = ends;
    else
        free(ends);
    return STATUS_OK;
}
