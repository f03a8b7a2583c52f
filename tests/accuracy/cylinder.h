/* A cylinder of tissue on a plate along which it slips, its axis z, as a mesh file; and what a neo-Hookean bar answers to compression. */
#ifndef TROCAR_CYLINDER_H
#define TROCAR_CYLINDER_H

#include <math.h>

#include "element.h"
#include "specimen.h"

enum { CYLINDER_RINGS_MAX = 6 };

struct cylinder {
    double height_m, radius_m;
    int layers, rings, on_ring[CYLINDER_RINGS_MAX]; /* vertices on the rings, from the middle: 1, 5, 10, ... */
};

/* Vertices of one layer, of its regular polygons; the outermost has the area of the circle. */
static inline size_t cylinder_disc(const struct cylinder *c, double (*xy)[2])
{
    const double pi = acos(-1);
    size_t count = 0;
    int rim = c->on_ring[c->rings - 1];
    double rim_m = c->radius_m * sqrt(2 * pi / (rim * sin(2 * pi / rim)));
    for (int r = 0; r < c->rings; r++)
        for (int k = 0; k < c->on_ring[r]; k++, count++) {
            double angle = 2 * pi * k / c->on_ring[r], at = rim_m * r / (c->rings - 1);
            xy[count][0] = at * cos(angle);
            xy[count][1] = at * sin(angle);
        }
    return count;
}

/* The triangles between two rings: the one whose next vertex comes first in angle goes on. */
static inline size_t cylinder_triangles(const struct cylinder *c, uint32_t (*triangle)[3])
{
    size_t count = 0;
    uint32_t inner = 0;
    for (int r = 1; r < c->rings; r++) {
        int n = c->on_ring[r - 1], m = c->on_ring[r], i = 0, j = 0;
        uint32_t outer = inner + (uint32_t)n;
        while (i < (n > 1 ? n : 0) || j < m) {
            bool out = i >= n || n == 1 || (j < m && (j + 0.5) * n < (i + 0.5) * m);
            uint32_t a = inner + (uint32_t)(i % n), b = outer + (uint32_t)(j % m);
            uint32_t next = out ? outer + (uint32_t)((j + 1) % m) : inner + (uint32_t)((i + 1) % n);
            memcpy(triangle[count++], (uint32_t[3]){a, b, next}, sizeof triangle[0]);
            *(out ? &j : &i) += 1;
        }
        inner = outer;
    }
    return count;
}

static inline void cylinder_write(const struct cylinder *c, const char *path)
{
    double xy[200][2];
    uint32_t triangle[400][3];
    size_t disc = cylinder_disc(c, xy), count = cylinder_triangles(c, triangle), n = 0, t = 0,
           layers = (size_t)c->layers;
    struct mesh mesh;
    struct failure why;
    mesh_room(&mesh, disc * (layers + 1), 3 * count * layers);
    for (size_t k = 0; k <= layers; k++)
        for (size_t i = 0; i < disc; i++, n++) {
            memcpy(mesh.nodes + 3 * n, xy[i], sizeof xy[i]);
            mesh.nodes[3 * n + 2] = c->height_m * (double)k / (double)layers;
        }
    for (size_t k = 0; k < layers; k++)
        for (size_t i = 0; i < count; i++) {
            uint32_t low[3], up = (uint32_t)disc; /* diagonals from the lower number up: neighbours agree */
            for (int v = 0; v < 3; v++)
                low[v] = triangle[i][v] + (uint32_t)(k * disc);
            for (int a = 0; a < 2; a++)
                for (int b = 0; b < 2 - a; b++)
                    if (low[b] > low[b + 1]) {
                        uint32_t swap = low[b];
                        low[b] = low[b + 1];
                        low[b + 1] = swap;
                    }
            const uint32_t cut[3][4] = {{low[0], low[1], low[2], low[2] + up},
                                        {low[0], low[1], low[1] + up, low[2] + up},
                                        {low[0], low[0] + up, low[1] + up, low[2] + up}};
            memcpy(mesh.tetrahedra + 4 * t, cut, sizeof cut);
            t += 3;
        }
    must(mesh_write_msh(&mesh, path, &why), &why);
    mesh_free(&mesh);
}

/* Lateral stretch of a bar at stretch s whose sides are free: mu (b^2 - 1) + lambda ln(s b^2) = 0. */
static inline double cylinder_lateral(struct lame m, double s)
{
    double low = 0.3, high = 3;
    for (int k = 0; k < 200; k++) {
        double b = (low + high) / 2;
        *(m.mu_Pa * (b * b - 1) + m.lambda_Pa * log(s * b * b) > 0 ? &high : &low) = b;
    }
    return low;
}

/* Force on the plates and growth of the radius at the stretch s < 1 of the height. */
static inline void cylinder_answer(const struct cylinder *c, struct lame m, double s, double *force_N, double *across_m)
{
    double b = cylinder_lateral(m, s), area = acos(-1) * c->radius_m * c->radius_m;
    *force_N = -area * (m.mu_Pa * (s - 1 / s) + m.lambda_Pa * log(s * b * b) / s);
    *across_m = c->radius_m * (b - 1);
}

#endif
