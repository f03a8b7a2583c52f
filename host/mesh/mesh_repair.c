#include "mesh_repair.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh_data.h"

const unsigned char edge_ends[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

double tetrahedron_volume(const struct mesh *mesh, size_t e)
{
    const uint32_t *corner = mesh->tetrahedra + 4 * e;
    const double *p = mesh->nodes + 3 * (size_t)corner[0];
    double a[3][3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            a[i][k] = mesh->nodes[3 * (size_t)corner[i + 1] + k] - p[k];
    return (a[2][0] * (a[0][1] * a[1][2] - a[0][2] * a[1][1]) + a[2][1] * (a[0][2] * a[1][0] - a[0][0] * a[1][2]) +
            a[2][2] * (a[0][0] * a[1][1] - a[0][1] * a[1][0])) /
           6;
}

void tetrahedron_edges(const struct mesh *mesh, size_t e, double length[6])
{
    const uint32_t *corner = mesh->tetrahedra + 4 * e;
    for (int i = 0; i < 6; i++) {
        const double *a = mesh->nodes + 3 * (size_t)corner[edge_ends[i][0]];
        const double *b = mesh->nodes + 3 * (size_t)corner[edge_ends[i][1]];
        length[i] = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
    }
}

/* A place with the node that stands there; sorted by place, then by node. */
struct place {
    double x[3];
    uint32_t node;
};

static int by_place(const void *a, const void *b)
{
    const struct place *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p->x[k] != q->x[k])
            return p->x[k] < q->x[k] ? -1 : 1;
    return p->node < q->node ? -1 : p->node > q->node;
}

/* Nodes at exactly one place become the first of them. Not nearly one place: that would be a change of the body. */
static int merge_nodes(struct mesh *mesh, uint32_t *to, size_t *merged, struct failure *why)
{
    size_t n = mesh->node_count;
    struct place *place = malloc((n ? n : 1) * sizeof *place);
    if (!place)
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for %zu nodes", n);
    for (size_t i = 0; i < n; i++) {
        memcpy(place[i].x, mesh->nodes + 3 * i, sizeof place[i].x);
        place[i].node = (uint32_t)i;
    }
    qsort(place, n, sizeof *place, by_place);
    for (size_t i = 0, first = 0; i < n; i++) {
        bool same = i > 0;
        for (int k = 0; k < 3 && same; k++)
            same = place[i].x[k] == place[first].x[k];
        if (!same)
            first = i;
        to[place[i].node] = place[first].node;
        *merged += same;
    }
    free(place);
    for (size_t i = 0; i < 4 * mesh->tetrahedron_count; i++)
        mesh->tetrahedra[i] = to[mesh->tetrahedra[i]];
    return STATUS_OK;
}

/* An element's corners in increasing order, to find it again. */
struct key {
    uint32_t corner[4], element;
};

static int by_number(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

static int by_corners(const void *a, const void *b)
{
    const struct key *x = a, *y = b;
    for (int k = 0; k < 4; k++)
        if (x->corner[k] != y->corner[k])
            return x->corner[k] < y->corner[k] ? -1 : 1;
    return x->element < y->element ? -1 : x->element > y->element;
}

static int remove_doubles(struct mesh *mesh, size_t *removed, struct failure *why)
{
    size_t n = mesh->tetrahedron_count, kept = 0;
    struct key *key = malloc((n ? n : 1) * sizeof *key);
    bool *drop = calloc(n ? n : 1, sizeof *drop);
    if (!key || !drop) {
        free(key);
        free(drop);
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for %zu tetrahedra", n);
    }
    for (size_t e = 0; e < n; e++) {
        memcpy(key[e].corner, mesh->tetrahedra + 4 * e, sizeof key[e].corner);
        key[e].element = (uint32_t)e;
        qsort(key[e].corner, 4, sizeof key[e].corner[0], by_number);
    }
    qsort(key, n, sizeof *key, by_corners);
    for (size_t i = 1; i < n; i++)
        drop[key[i].element] = memcmp(key[i].corner, key[i - 1].corner, sizeof key[i].corner) == 0;
    for (size_t e = 0; e < n; e++) {
        if (drop[e])
            continue;
        memmove(mesh->tetrahedra + 4 * kept, mesh->tetrahedra + 4 * e, 4 * sizeof *mesh->tetrahedra);
        mesh->labels[kept++] = mesh->labels[e];
    }
    *removed = n - kept;
    mesh->tetrahedron_count = kept;
    free(key);
    free(drop);
    return STATUS_OK;
}

/* `to` is scratch of node_count entries. */
static void drop_unused(struct mesh *mesh, uint32_t *to, size_t *dropped)
{
    size_t kept = 0, n = mesh->node_count;
    for (size_t i = 0; i < n; i++)
        to[i] = UINT32_MAX;
    for (size_t i = 0; i < 4 * mesh->tetrahedron_count; i++)
        to[mesh->tetrahedra[i]] = 0;
    for (size_t i = 0; i < n; i++) {
        if (to[i] == UINT32_MAX)
            continue;
        memmove(mesh->nodes + 3 * kept, mesh->nodes + 3 * i, 3 * sizeof *mesh->nodes);
        mesh_data_move(mesh, i, kept);
        to[i] = (uint32_t)kept++;
    }
    for (size_t i = 0; i < 4 * mesh->tetrahedron_count; i++)
        mesh->tetrahedra[i] = to[mesh->tetrahedra[i]];
    *dropped = n - kept;
    mesh->node_count = kept;
    for (size_t i = 0; i < mesh->data_count; i++)
        mesh->data[i].nodes = mesh->data[i].value ? kept : 0;
}

int mesh_repair(struct mesh *mesh, struct mesh_report *report, struct failure *why)
{
    uint32_t *to = malloc((mesh->node_count ? mesh->node_count : 1) * sizeof *to);
    if (!to)
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for %zu nodes", mesh->node_count);
    size_t dropped = 0;
    int status = merge_nodes(mesh, to, &report->duplicate_nodes, why);
    if (status == STATUS_OK)
        status = remove_doubles(mesh, &report->duplicate_elements, why);
    if (status == STATUS_OK) {
        drop_unused(mesh, to, &dropped);
        report->unused_nodes = dropped - report->duplicate_nodes;
        for (size_t e = 0; e < mesh->tetrahedron_count; e++) {
            if (tetrahedron_volume(mesh, e) >= 0)
                continue;
            uint32_t *corner = mesh->tetrahedra + 4 * e, t = corner[2];
            corner[2] = corner[3];
            corner[3] = t;
            report->reoriented++;
        }
    }
    free(to);
    return status;
}
