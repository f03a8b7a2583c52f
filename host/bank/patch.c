#include "patch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_PARTS = 512 };         /* per edge of a triangle; a tool smaller than that is a point */
static const double PART = 0.125; /* longest part of an edge, in radii */

struct corners {
    double x[3][3], normal[3], area; /* area: of the triangle; normal: unit */
};

static struct corners corners_of(const struct mesh *mesh, const struct surface *surface, uint32_t triangle)
{
    struct corners c;
    double n[3];
    for (int k = 0; k < 3; k++)
        memcpy(c.x[k], mesh->nodes + 3 * (size_t)surface->node[surface->triangles[3 * (size_t)triangle + (size_t)k]],
               sizeof c.x[k]);
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, d = (a + 2) % 3;
        n[a] = (c.x[1][b] - c.x[0][b]) * (c.x[2][d] - c.x[0][d]) - (c.x[1][d] - c.x[0][d]) * (c.x[2][b] - c.x[0][b]);
    }
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int a = 0; a < 3; a++)
        c.normal[a] = n[a] / length;
    c.area = length / 2;
    return c;
}

static double distance(const double x[3], const double y[3])
{
    return sqrt((x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1]) + (x[2] - y[2]) * (x[2] - y[2]));
}

static double longest_edge(const struct corners *c)
{
    double longest = 0;
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, distance(c->x[k], c->x[(k + 1) % 3]));
    return longest;
}

/* int k phi dA for the three corners; returns how much lies inside the ball. */
static double integrate(const struct corners *c, const double centre[3], double radius, double share[3])
{
    static const double middle[3][3] = {{0.5, 0.5, 0}, {0, 0.5, 0.5}, {0.5, 0, 0.5}};
    double sum = 0, wanted = ceil(longest_edge(c) / (PART * radius));
    memset(share, 0, 3 * sizeof *share);
    int parts = wanted < MAX_PARTS ? (int)wanted : MAX_PARTS;
    for (int i = 0; i < parts; i++)
        for (int j = 0; j < 2 * (parts - i) - 1; j++) /* a strip: upright and inverted parts in turn */
            for (int m = 0; m < 3; m++) {
                bool upright = j % 2 == 0;
                double p = (i + (upright ? middle[m][1] : 1 - middle[m][1])) / parts;
                double q = (j / 2 + (upright ? middle[m][2] : 1 - middle[m][2])) / parts;
                double phi[3] = {1 - p - q, p, q}, x[3];
                for (int a = 0; a < 3; a++)
                    x[a] = phi[0] * c->x[0][a] + phi[1] * c->x[1][a] + phi[2] * c->x[2][a];
                double r = distance(x, centre) / radius;
                if (r >= 1)
                    continue;
                double k = (1 - r * r) * c->area / (3.0 * parts * parts);
                for (int v = 0; v < 3; v++)
                    share[v] += k * phi[v];
                sum += k;
            }
    return sum;
}

struct flood {
    uint32_t *queue;
    bool *seen;
    double *weight; /* per vertex */
};

/* From triangle to triangle while they reach into the ball and face the same way. */
static double spread(const struct mesh *mesh, const struct surface *surface, uint32_t start, double radius,
                     struct patch *patch, struct flood *flood)
{
    double total = 0, own[3];
    size_t count = 0;
    memcpy(own, corners_of(mesh, surface, start).normal, sizeof own);
    flood->queue[count++] = start;
    flood->seen[start] = true;
    for (size_t k = 0; k < count; k++) { /* each triangle enters once */
        uint32_t t = flood->queue[k];
        struct corners c = corners_of(mesh, surface, t);
        double share[3], part;
        if (c.normal[0] * own[0] + c.normal[1] * own[1] + c.normal[2] * own[2] <= 0)
            continue;
        part = integrate(&c, patch->centre_m, radius, share);
        if (!(part > 0) && t != start)
            continue;
        total += part;
        for (int i = 0; i < 3; i++) {
            flood->weight[surface->triangles[3 * (size_t)t + (size_t)i]] += share[i];
            patch->normal[i] += part * c.normal[i];
            uint32_t next = surface->neighbours[3 * (size_t)t + (size_t)i];
            if (next < surface->triangle_count && !flood->seen[next]) {
                flood->seen[next] = true;
                flood->queue[count++] = next;
            }
        }
    }
    return total;
}

static bool collect(const struct mesh *mesh, const struct surface *surface, uint32_t triangle, const double at[3],
                    double radius, struct patch *patch, struct flood *flood)
{
    const uint32_t *vertex = surface->triangles + 3 * (size_t)triangle;
    struct corners c = corners_of(mesh, surface, triangle);
    for (int a = 0; a < 3; a++)
        patch->centre_m[a] = at[0] * c.x[0][a] + at[1] * c.x[1][a] + at[2] * c.x[2][a];
    double total = 0, length = 0;
    if (longest_edge(&c) <= MAX_PARTS * PART * radius)
        total = spread(mesh, surface, triangle, radius, patch, flood);
    else { /* a point */
        for (int k = 0; k < 3; k++) {
            flood->weight[vertex[k]] = at[k];
            patch->normal[k] = c.normal[k];
        }
        total = 1;
    }
    for (size_t v = 0; v < surface->vertex_count; v++)
        patch->count += flood->weight[v] > 0;
    patch->vertex = malloc((patch->count + 1) * sizeof *patch->vertex);
    patch->weight = malloc((patch->count + 1) * sizeof *patch->weight);
    if (!patch->vertex || !patch->weight)
        return false;
    patch->count = 0;
    for (size_t v = 0; v < surface->vertex_count; v++)
        if (flood->weight[v] > 0) {
            patch->vertex[patch->count] = (uint32_t)v;
            patch->weight[patch->count++] = flood->weight[v] / total;
        }
    for (int a = 0; a < 3; a++)
        length += patch->normal[a] * patch->normal[a];
    for (int a = 0; a < 3; a++)
        patch->normal[a] /= sqrt(length);
    return true;
}

int patch_create(const struct mesh *mesh, const struct surface *surface, uint32_t triangle, const double at[3],
                 double radius_m, struct patch *patch, struct failure *why)
{
    *patch = (struct patch){0};
    struct flood flood = {.queue = malloc((surface->triangle_count + 1) * sizeof *flood.queue),
                          .seen = calloc(surface->triangle_count + 1, sizeof *flood.seen),
                          .weight = calloc(surface->vertex_count + 1, sizeof *flood.weight)};
    bool good =
        flood.queue && flood.seen && flood.weight && collect(mesh, surface, triangle, at, radius_m, patch, &flood);
    free(flood.queue);
    free(flood.seen);
    free(flood.weight);
    if (good)
        return STATUS_OK;
    patch_free(patch);
    return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for a tool on %zu surface vertices",
                       surface->vertex_count);
}

void patch_free(struct patch *patch)
{
    free(patch->vertex);
    free(patch->weight);
    *patch = (struct patch){0};
}
