#include "projection.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static double triangle_area(const double *nodes, const uint32_t node[3])
{
    double e[2][3], n[3];
    for (int k = 0; k < 2; k++)
        for (int a = 0; a < 3; a++)
            e[k][a] = nodes[3 * (size_t)node[k + 1] + a] - nodes[3 * (size_t)node[0] + a];
    for (int a = 0; a < 3; a++)
        n[a] = e[0][(a + 1) % 3] * e[1][(a + 2) % 3] - e[0][(a + 2) % 3] * e[1][(a + 1) % 3];
    return sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / 2;
}

static bool add(struct projection *R, size_t first, size_t *used, size_t *room, uint32_t node, double weight)
{
    for (size_t k = first; k < *used; k++) /* some 20 nodes around a vertex */
        if (R->node[k] == node) {
            R->weight[k] += weight;
            return true;
        }
    if (*used == *room) {
        size_t larger = 2 * *room + 64;
        uint32_t *nodes = realloc(R->node, larger * sizeof *nodes);
        R->node = nodes ? nodes : R->node;
        double *weights = realloc(R->weight, larger * sizeof *weights);
        R->weight = weights ? weights : R->weight;
        if (!nodes || !weights)
            return false;
        *room = larger;
    }
    R->node[*used] = node;
    R->weight[(*used)++] = weight;
    return true;
}

/* int_T psi_v N over |T| for the nodes N of a quadratic triangle. */
static bool add_triangle(const struct space *space, const uint32_t node[3], int own, double share, struct projection *R,
                         size_t first, size_t *used, size_t *room)
{
    uint32_t v = node[own], p = node[(own + 1) % 3], q = node[(own + 2) % 3];
    return add(R, first, used, room, v, share * 2 / 15) && add(R, first, used, room, p, -share / 15) &&
           add(R, first, used, room, q, -share / 15) &&
           add(R, first, used, room, space_middle(space, v, p), share / 5) &&
           add(R, first, used, room, space_middle(space, v, q), share / 5) &&
           add(R, first, used, room, space_middle(space, p, q), -share / 15);
}

static bool fill(const struct space *space, const struct surface *surface, const size_t *around_start,
                 const uint32_t *around, struct projection *R)
{
    size_t used = 0, room = 0;
    for (size_t v = 0; v < surface->vertex_count; v++) {
        R->start[v] = used;
        size_t first = used;
        if (space->order == ELEMENT_LINEAR) {
            if (!add(R, first, &used, &room, surface->node[v], 1))
                return false;
            continue;
        }
        for (size_t k = around_start[v]; k < around_start[v + 1]; k++) {
            uint32_t node[3];
            int own = 0;
            for (int i = 0; i < 3; i++) {
                uint32_t vertex = surface->triangles[3 * (size_t)around[k] + (size_t)i];
                node[i] = surface->node[vertex];
                own = vertex == v ? i : own;
            }
            double share = triangle_area(space->mesh->nodes, node) / surface->areas[v];
            if (!add_triangle(space, node, own, share, R, first, &used, &room))
                return false;
        }
    }
    R->start[surface->vertex_count] = used;
    return true;
}

int projection_create(const struct space *space, const struct surface *surface, struct projection *R,
                      struct failure *why)
{
    size_t vertices = surface->vertex_count, corners = 3 * surface->triangle_count;
    *R = (struct projection){.start = malloc((vertices + 1) * sizeof *R->start)};
    size_t *around_start = calloc(vertices + 2, sizeof *around_start);
    uint32_t *around = malloc((corners + 1) * sizeof *around);
    bool good = R->start && around_start && around;
    if (good) {
        for (size_t i = 0; i < corners; i++)
            around_start[surface->triangles[i] + 2]++;
        for (size_t v = 2; v <= vertices + 1; v++)
            around_start[v] += around_start[v - 1];
        for (size_t i = 0; i < corners; i++)
            around[around_start[surface->triangles[i] + 1]++] = (uint32_t)(i / 3);
        good = fill(space, surface, around_start, around, R);
    }
    free(around_start);
    free(around);
    if (good)
        return STATUS_OK;
    projection_free(R);
    return failure_set(why, STATUS_MEMORY, space->mesh->path, NULL, "no memory to project %zu surface vertices",
                       vertices);
}

void projection_free(struct projection *R)
{
    free(R->start);
    free(R->node);
    free(R->weight);
    *R = (struct projection){0};
}
