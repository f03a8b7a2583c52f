#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh_topology.h"
#include "triangle_soup.h"

enum { MOST_SHELLS = 256 };

static const double pi = 3.14159265358979323846;

static int no_memory(const char *path, struct failure *why)
{
    return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the surface");
}

struct place {
    double x[3];
    uint32_t vertex;
};

static int by_place(const void *a, const void *b)
{
    const struct place *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p->x[k] != q->x[k])
            return p->x[k] < q->x[k] ? -1 : 1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

/* Vertices in one cell of a grid of this size become one (0: at exactly one place); then triangles with a corner twice go,
 * and vertices without a triangle. */
static int weld(struct soup *soup, double cell, const char *path, struct failure *why)
{
    size_t n = soup->vertex_count, kept = 0;
    struct place *place = malloc((n ? n : 1) * sizeof *place);
    uint32_t *to = malloc((n ? n : 1) * sizeof *to);
    if (!place || !to) {
        free(place);
        free(to);
        return no_memory(path, why);
    }
    for (size_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++)
            place[i].x[k] = cell > 0 ? rint(soup->vertices[3 * i + k] / cell) : soup->vertices[3 * i + k];
        place[i].vertex = (uint32_t)i;
    }
    qsort(place, n, sizeof *place, by_place);
    for (size_t i = 0, first = 0; i < n; i++) {
        for (int k = 0; k < 3; k++)
            if (place[i].x[k] != place[first].x[k])
                first = i;
        to[place[i].vertex] = place[first].vertex;
    }
    for (size_t t = 0; t < soup->triangle_count; t++) {
        const uint32_t *v = soup->triangles + 3 * t;
        uint32_t w[3] = {to[v[0]], to[v[1]], to[v[2]]};
        if (w[0] != w[1] && w[1] != w[2] && w[2] != w[0])
            memcpy(soup->triangles + 3 * kept++, w, sizeof w);
    }
    soup->triangle_count = kept;
    for (size_t i = 0; i < n; i++)
        to[i] = UINT32_MAX;
    for (size_t i = 0; i < 3 * kept; i++)
        to[soup->triangles[i]] = 0;
    soup->vertex_count = 0;
    for (size_t i = 0; i < n; i++) {
        if (to[i] == UINT32_MAX)
            continue;
        memmove(soup->vertices + 3 * soup->vertex_count, soup->vertices + 3 * i, 3 * sizeof *soup->vertices);
        to[i] = (uint32_t)soup->vertex_count++;
    }
    for (size_t i = 0; i < 3 * kept; i++)
        soup->triangles[i] = to[soup->triangles[i]];
    free(place);
    free(to);
    return STATUS_OK;
}

/* Across every edge: `pair[3 t + k]` is the side of the neighbour, 3 x triangle + corner. */
static int pair_sides(const struct soup *soup, uint32_t *pair, const char *path, struct failure *why)
{
    struct side *side;
    int status = triangle_sides(soup->triangles, soup->triangle_count, path, &side, why);
    if (status)
        return status;
    for (size_t i = 0; i + 1 < 3 * soup->triangle_count; i += 2) {
        uint32_t a = 3 * side[i].triangle + side[i].opposite, b = 3 * side[i + 1].triangle + side[i + 1].opposite;
        pair[a] = b;
        pair[b] = a;
    }
    free(side);
    return STATUS_OK;
}

static void flip(uint32_t *v)
{
    uint32_t t = v[1];
    v[1] = v[2];
    v[2] = t;
}

/* Number the shells and turn the triangles of each to agree with its first; false if one cannot be oriented. */
static bool spread(struct soup *soup, uint32_t *pair, uint32_t *stack)
{
    for (size_t t = 0; t < soup->triangle_count; t++)
        soup->shell[t] = UINT32_MAX;
    for (size_t start = 0; start < soup->triangle_count; start++) {
        if (soup->shell[start] != UINT32_MAX)
            continue;
        size_t waiting = 0;
        soup->shell[start] = (uint32_t)soup->shell_count++;
        stack[waiting++] = (uint32_t)start;
        while (waiting > 0) {
            uint32_t t = stack[--waiting];
            for (uint32_t k = 0; k < 3; k++) {
                const uint32_t *v = soup->triangles + 3 * (size_t)t;
                uint32_t side = pair[3 * t + k], n = side / 3, opposite = side % 3;
                uint32_t *w = soup->triangles + 3 * (size_t)n;
                bool agrees = w[(opposite + 1) % 3] == v[(k + 2) % 3];
                if (soup->shell[n] != UINT32_MAX) {
                    if (!agrees)
                        return false;
                    continue;
                }
                if (!agrees) { /* corners 1 and 2 change places, and with them the sides opposite */
                    flip(w);
                    flip(pair + 3 * (size_t)n);
                    for (uint32_t j = 1; j < 3; j++)
                        pair[pair[3 * n + j]] = 3 * n + j;
                }
                soup->shell[n] = soup->shell[start];
                stack[waiting++] = n;
            }
        }
    }
    return true;
}

/* How often the shell winds around p: its solid angle / 4 pi (Van Oosterom and Strackee 1983). */
static double winding(const struct soup *soup, uint32_t shell, const double *p)
{
    double sum = 0;
    for (size_t t = 0; t < soup->triangle_count; t++) {
        if (soup->shell[t] != shell)
            continue;
        double r[3][3], length[3], determinant = 0;
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++)
                r[i][k] = soup->vertices[3 * (size_t)soup->triangles[3 * t + i] + k] - p[k];
            length[i] = hypot(hypot(r[i][0], r[i][1]), r[i][2]);
        }
        for (int k = 0; k < 3; k++)
            determinant += r[0][k] * (r[1][(k + 1) % 3] * r[2][(k + 2) % 3] - r[1][(k + 2) % 3] * r[2][(k + 1) % 3]);
        double below = length[0] * length[1] * length[2];
        for (int i = 0; i < 3; i++) {
            const double *a = r[(i + 1) % 3], *b = r[(i + 2) % 3];
            below += length[i] * (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
        }
        sum += 2 * atan2(determinant, below);
    }
    return sum / (4 * pi);
}

/* Six times the volume, with the first vertex as origin so that far-away bodies keep their digits. */
static double signed_volume(const struct soup *soup, uint32_t shell)
{
    double sum = 0;
    const double *o = soup->vertices;
    for (size_t t = 0; t < soup->triangle_count; t++) {
        if (soup->shell[t] != shell)
            continue;
        double r[3][3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                r[i][k] = soup->vertices[3 * (size_t)soup->triangles[3 * t + i] + k] - o[k];
        for (int k = 0; k < 3; k++)
            sum += r[0][k] * (r[1][(k + 1) % 3] * r[2][(k + 2) % 3] - r[1][(k + 2) % 3] * r[2][(k + 1) % 3]);
    }
    return sum;
}

/* Which shell lies in which: at even depth it bounds a body, at odd depth a cavity of the shell one less deep. */
static void nest(struct soup *soup)
{
    bool within[MOST_SHELLS][MOST_SHELLS] = {{false}};
    int depth[MOST_SHELLS] = {0};
    size_t n = soup->shell_count;
    for (size_t a = 0; a < n && n > 1; a++) {
        size_t t = 0;
        while (soup->shell[t] != a)
            t++;
        const double *p = soup->vertices + 3 * (size_t)soup->triangles[3 * t];
        for (size_t b = 0; b < n; b++) {
            within[a][b] = a != b && fabs(winding(soup, (uint32_t)b, p)) > 0.5;
            depth[a] += within[a][b];
        }
    }
    for (size_t a = 0; a < n; a++) {
        soup->inside[a] = -1;
        for (size_t b = 0; b < n && depth[a] % 2; b++)
            if (within[a][b] && depth[b] == depth[a] - 1)
                soup->inside[a] = (int32_t)b;
        if ((signed_volume(soup, (uint32_t)a) > 0) == (depth[a] % 2 == 0))
            continue;
        for (size_t t = 0; t < soup->triangle_count; t++)
            if (soup->shell[t] == a)
                flip(soup->triangles + 3 * t);
    }
}

static int orient(struct soup *soup, const char *path, struct failure *why)
{
    size_t n = soup->triangle_count;
    uint32_t *pair = malloc(3 * n * sizeof *pair), *stack = malloc(n * sizeof *stack);
    soup->shell = malloc(n * sizeof *soup->shell);
    int status = pair && stack && soup->shell ? pair_sides(soup, pair, path, why) : no_memory(path, why);
    if (status == STATUS_OK && !spread(soup, pair, stack))
        status = failure_set(why, STATUS_MESH_NONMANIFOLD, path, "repair the surface so that it has an inside",
                             "the surface has one side only, like a Klein bottle");
    free(pair);
    free(stack);
    if (status == STATUS_OK && soup->shell_count > MOST_SHELLS)
        status = failure_set(why, STATUS_MESH_COMPONENTS, path, NULL, "the surface has %zu separate shells",
                             soup->shell_count);
    if (status)
        return status;
    soup->inside = malloc(soup->shell_count * sizeof *soup->inside);
    if (!soup->inside)
        return no_memory(path, why);
    nest(soup);
    return STATUS_OK;
}

static double diagonal(const struct soup *soup)
{
    double low[3], high[3];
    for (int k = 0; k < 3; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
        for (size_t i = 0; i < soup->vertex_count; i++) {
            low[k] = fmin(low[k], soup->vertices[3 * i + k]);
            high[k] = fmax(high[k], soup->vertices[3 * i + k]);
        }
    }
    return hypot(hypot(high[0] - low[0], high[1] - low[1]), high[2] - low[2]);
}

int soup_close(struct soup *soup, const char *path, struct failure *why)
{
    struct manifold m;
    for (size_t i = 0; i < 3 * soup->triangle_count; i++)
        if (soup->triangles[i] >= soup->vertex_count)
            return failure_set(why, STATUS_MESH_INDEX, path, NULL, "triangle %zu names vertex %u of %zu", i / 3 + 1,
                               soup->triangles[i], soup->vertex_count);
    int status = weld(soup, 0, path, why);
    if (status == STATUS_OK)
        status = manifold_of(soup->triangles, soup->triangle_count, soup->vertex_count, path, &m, why);
    if (status == STATUS_OK && m.open_edges) {
        /* single precision and printed decimals move one corner of neighbouring triangles apart: try 1e-6 of the size */
        status = weld(soup, 1e-6 * diagonal(soup), path, why);
        if (status == STATUS_OK)
            status = manifold_of(soup->triangles, soup->triangle_count, soup->vertex_count, path, &m, why);
    }
    if (status)
        return status;
    if (soup->triangle_count == 0)
        return failure_set(why, STATUS_MESH_EMPTY, path, NULL, "the file has no triangle");
    if (m.open_edges) {
        const double *x = soup->vertices + 3 * (size_t)m.open_at;
        return failure_set(why, STATUS_MESH_OPEN, path, NULL,
                           "%zu edge%s of the surface ha%s one triangle only, the first at (%g, %g, %g)", m.open_edges,
                           m.open_edges == 1 ? "" : "s", m.open_edges == 1 ? "s" : "ve", x[0] + 0.0, x[1] + 0.0,
                           x[2] + 0.0); /* + 0.0: there is one zero, not -0 */
    }
    if (m.crowded_edges) {
        const double *x = soup->vertices + 3 * (size_t)m.crowded_at;
        return failure_set(why, STATUS_MESH_NONMANIFOLD, path, NULL,
                           "%zu edge%s of the surface ha%s more than two triangles, the first at (%g, %g, %g)",
                           m.crowded_edges, m.crowded_edges == 1 ? "" : "s", m.crowded_edges == 1 ? "s" : "ve",
                           x[0] + 0.0, x[1] + 0.0, x[2] + 0.0);
    }
    return orient(soup, path, why);
}
