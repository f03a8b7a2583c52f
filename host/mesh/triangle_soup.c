#include "triangle_soup.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int no_memory(struct scan *s)
{
    return scan_fail(s, STATUS_MEMORY, "no memory for the surface");
}

int soup_vertex(struct soup *soup, struct scan *s, const double x[3])
{
    if (soup->vertex_count == soup->vertex_room) {
        size_t room = soup->vertex_room ? 2 * soup->vertex_room : 1024;
        double *larger = realloc(soup->vertices, room * 3 * sizeof *larger);
        if (!larger)
            return no_memory(s);
        soup->vertices = larger;
        soup->vertex_room = room;
    }
    if (soup->vertex_count >= UINT32_MAX / 4)
        return scan_fail(s, STATUS_MESH_TOO_LARGE, "more than %u vertices", UINT32_MAX / 4);
    for (int k = 0; k < 3; k++)
        if (!(fabs(x[k]) <= 1e100)) /* products of three stay finite */
            return scan_fail(s, STATUS_MESH_NONFINITE, "a coordinate is %g", x[k]);
    memcpy(soup->vertices + 3 * soup->vertex_count++, x, 3 * sizeof *x);
    return STATUS_OK;
}

int soup_triangle(struct soup *soup, struct scan *s, uint32_t a, uint32_t b, uint32_t c)
{
    if (soup->triangle_count == soup->triangle_room) {
        size_t room = soup->triangle_room ? 2 * soup->triangle_room : 1024;
        uint32_t *larger = realloc(soup->triangles, room * 3 * sizeof *larger);
        if (!larger)
            return no_memory(s);
        soup->triangles = larger;
        soup->triangle_room = room;
    }
    if (soup->triangle_count >= UINT32_MAX / 12)
        return scan_fail(s, STATUS_MESH_TOO_LARGE, "more than %u triangles", UINT32_MAX / 12);
    memcpy(soup->triangles + 3 * soup->triangle_count++, (uint32_t[]){a, b, c}, 3 * sizeof a);
    return STATUS_OK;
}

/* Twice the area of the triangle in the plane of axes u, v; positive if it turns left. */
static double turn(const double *a, const double *b, const double *c, int u, int v)
{
    return (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]);
}

/* The two axes of the coordinate plane in which the polygon is largest, so that it turns left there. */
static void projection(const struct soup *soup, const uint32_t *vertex, size_t count, int *u, int *v)
{
    double normal[3] = {0};
    for (size_t i = 0; i < count; i++) { /* Newell's sum */
        const double *a = soup->vertices + 3 * (size_t)vertex[i];
        const double *b = soup->vertices + 3 * (size_t)vertex[(i + 1) % count];
        for (int k = 0; k < 3; k++)
            normal[k] += (a[(k + 1) % 3] - b[(k + 1) % 3]) * (a[(k + 2) % 3] + b[(k + 2) % 3]);
    }
    int axis = fabs(normal[0]) > fabs(normal[1]) ? 0 : 1;
    if (fabs(normal[2]) > fabs(normal[axis]))
        axis = 2;
    *u = (axis + 1) % 3;
    *v = (axis + 2) % 3;
    if (normal[axis] < 0) {
        int t = *u;
        *u = *v;
        *v = t;
    }
}

static bool is_ear(const struct soup *soup, const uint32_t *left, size_t count, size_t i, int u, int v)
{
    const double *a = soup->vertices + 3 * (size_t)left[(i + count - 1) % count];
    const double *b = soup->vertices + 3 * (size_t)left[i];
    const double *c = soup->vertices + 3 * (size_t)left[(i + 1) % count];
    if (turn(a, b, c, u, v) <= 0)
        return false;
    for (size_t k = 0; k + 3 < count; k++) { /* no other corner within */
        const double *p = soup->vertices + 3 * (size_t)left[(i + 2 + k) % count];
        if (turn(a, b, p, u, v) >= 0 && turn(b, c, p, u, v) >= 0 && turn(c, a, p, u, v) >= 0)
            return false;
    }
    return true;
}

int soup_polygon(struct soup *soup, struct scan *s, const uint32_t *vertex, size_t count)
{
    uint32_t left[SOUP_POLYGON];
    int u, v, status = STATUS_OK;
    if (count < 3 || count > SOUP_POLYGON)
        return scan_fail(s, STATUS_MESH_SYNTAX, "a polygon of %zu corners", count);
    memcpy(left, vertex, count * sizeof *left);
    if (count > 3)
        projection(soup, vertex, count, &u, &v);
    while (count > 3 && status == STATUS_OK) {
        size_t ear = 0;
        while (ear < count && !is_ear(soup, left, count, ear, u, v))
            ear++;
        ear %= count; /* a polygon that crosses itself has none: any cut is as good */
        status = soup_triangle(soup, s, left[(ear + count - 1) % count], left[ear], left[(ear + 1) % count]);
        memmove(left + ear, left + ear + 1, (--count - ear) * sizeof *left);
    }
    return status ? status : soup_triangle(soup, s, left[0], left[1], left[2]);
}

void soup_free(struct soup *soup)
{
    free(soup->vertices);
    free(soup->triangles);
    free(soup->shell);
    free(soup->inside);
    *soup = (struct soup){0};
}
