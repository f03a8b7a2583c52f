/* Where to put an instrument that the scene does not place. */
#include "scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_CANDIDATES = 1024 };

static const double APPROACH_m = 0.030, DEPTH_m = 0.040;
static const double CLEAR_OF_FIXED = 0.25; /* of the extent */
static const double APART = 0.15;          /* two instruments, of the extent */
static const double AROUND = 0.06;         /* radius over which the normal is averaged, of the extent */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double distance(const double a[3], const double b[3])
{
    double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return sqrt(dot(d, d));
}

static const double *position(const struct mesh *mesh, const struct surface *surface, uint32_t vertex)
{
    return &mesh->nodes[3 * (size_t)surface->node[vertex]];
}

/* The nearest crossing at a distance above `beyond` in which the ray passes the surface inwards (sign +1) or outwards
 * (-1) [Moeller and Trumbore 1997]. */
static double crossing(const struct mesh *mesh, const struct surface *surface, const double origin[3],
                       const double direction[3], double beyond, int sign, uint32_t *triangle)
{
    double nearest = INFINITY;
    for (size_t t = 0; t < surface->triangle_count; t++) {
        const uint32_t *v = &surface->triangles[3 * t];
        const double *A = position(mesh, surface, v[0]), *B = position(mesh, surface, v[1]),
                     *C = position(mesh, surface, v[2]);
        double e1[3], e2[3], s[3], p[3], q[3];
        for (int i = 0; i < 3; i++) {
            e1[i] = B[i] - A[i];
            e2[i] = C[i] - A[i];
            s[i] = origin[i] - A[i];
        }
        for (int i = 0, j = 1, k = 2; i < 3; i++, j = (j + 1) % 3, k = (k + 1) % 3) {
            p[i] = direction[j] * e2[k] - direction[k] * e2[j];
            q[i] = s[j] * e1[k] - s[k] * e1[j];
        }
        double determinant = dot(e1, p); /* > 0: against the outward normal */
        if (sign * determinant <= 0)
            continue;
        double u = dot(s, p) / determinant, w = dot(direction, q) / determinant, at = dot(e2, q) / determinant;
        if (u < 0 || w < 0 || u + w > 1 || at <= beyond || at >= nearest)
            continue;
        nearest = at;
        *triangle = (uint32_t)t;
    }
    return nearest;
}

double scene_ray(const struct mesh *mesh, const struct surface *surface, const double origin[3],
                 const double direction[3], uint32_t *triangle)
{
    return crossing(mesh, surface, origin, direction, 0, 1, triangle);
}

struct site {
    double point[3], inward[3];
    double score;
    uint32_t triangle;
    bool clear; /* of fixed vertices */
};

struct placement {
    const struct mesh *mesh;
    const struct surface *surface;
    const bool *fixed;
    double low[3], high[3], middle[3], extent, shortest_extent;
    int shortest;
    size_t taken_count;
    double taken[BANK_MAX_INSTRUMENTS][3]; /* touch points of placed instruments */
};

static void measure(struct placement *p)
{
    for (int i = 0; i < 3; i++) {
        p->low[i] = INFINITY;
        p->high[i] = -INFINITY;
    }
    for (size_t v = 0; v < p->surface->vertex_count; v++)
        for (int i = 0; i < 3; i++) {
            double x = position(p->mesh, p->surface, (uint32_t)v)[i];
            p->low[i] = fmin(p->low[i], x);
            p->high[i] = fmax(p->high[i], x);
        }
    p->extent = 0;
    p->shortest_extent = INFINITY;
    for (int i = 0; i < 3; i++) {
        double side = p->high[i] - p->low[i];
        p->middle[i] = 0.5 * (p->low[i] + p->high[i]);
        p->extent = fmax(p->extent, side);
        if (side < p->shortest_extent) {
            p->shortest_extent = side;
            p->shortest = i;
        }
    }
}

/* Score of a touch point: clear of fixed vertices, flat around, square to the shortest axis, near the
 * middle: each 0..1, being clear counts twice; and half a point for coming from above rather than below. */
static void judge(const struct placement *p, struct site *site)
{
    const uint32_t *corner = &p->surface->triangles[3 * (size_t)site->triangle];
    memset(site->point, 0, sizeof site->point);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            site->point[i] += position(p->mesh, p->surface, corner[k])[i] / 3;
    double normal[3] = {0}, area = 0, nearest_fixed = INFINITY;
    for (size_t v = 0; v < p->surface->vertex_count; v++) {
        double away = distance(position(p->mesh, p->surface, (uint32_t)v), site->point);
        if (p->fixed[v])
            nearest_fixed = fmin(nearest_fixed, away);
        bool corner_of = v == corner[0] || v == corner[1] || v == corner[2];
        if (away > AROUND * p->extent && !corner_of)
            continue;
        area += p->surface->areas[v];
        for (int i = 0; i < 3; i++)
            normal[i] += p->surface->areas[v] * p->surface->normals[3 * v + i];
    }
    double length = sqrt(dot(normal, normal));
    double flat = area > 0 ? length / area : 0;
    for (int i = 0; i < 3; i++)
        site->inward[i] = length > 0 ? -normal[i] / length : -(i == p->shortest);
    site->clear = nearest_fixed >= CLEAR_OF_FIXED * p->extent;
    double clear = fmin(nearest_fixed / (CLEAR_OF_FIXED * p->extent), 1);
    double up = -site->inward[p->shortest];
    double central = 1 - distance(site->point, p->middle) / p->extent;
    site->score = 2 * clear + flat + fabs(up) + 0.5 * up + central;
}

static int by_score(const void *a, const void *b)
{
    const struct site *s = a, *t = b;
    if (s->score != t->score)
        return s->score > t->score ? -1 : 1;
    return (s->triangle > t->triangle) - (s->triangle < t->triangle);
}

static bool free_triangle(const struct placement *p, uint32_t triangle)
{
    const uint32_t *v = &p->surface->triangles[3 * (size_t)triangle];
    return !p->fixed[v[0]] && !p->fixed[v[1]] && !p->fixed[v[2]];
}

static double stand_back(const struct scene_instrument *instrument)
{
    double range = instrument->length_max_m - instrument->length_min_m, wanted = APPROACH_m + DEPTH_m;
    if (range < wanted)
        return instrument->length_min_m + range * APPROACH_m / wanted;
    return instrument->length_min_m + APPROACH_m + (range - wanted) / 2;
}

/* How good a site is on sight: 3 when the axis meets free tissue there, clear of fixed vertices, with room below and
 * apart from other instruments; 2 without room or clearance; 1 when it at least meets free tissue first; 0 not at all.
 */
static int quality(const struct placement *p, const struct site *site, double back)
{
    double origin[3], entry[3];
    for (int i = 0; i < 3; i++)
        origin[i] = site->point[i] - back * site->inward[i];
    uint32_t hit = 0, out = 0;
    double at = scene_ray(p->mesh, p->surface, origin, site->inward, &hit);
    if (!(at < INFINITY) || !free_triangle(p, hit) || fabs(at - back) > 1e-6 * p->extent)
        return 0;
    for (size_t k = 0; k < p->taken_count; k++)
        if (distance(site->point, p->taken[k]) < APART * p->extent)
            return 1;
    for (int i = 0; i < 3; i++)
        entry[i] = origin[i] + at * site->inward[i];
    double thickness = crossing(p->mesh, p->surface, entry, site->inward, 0, -1, &out);
    return site->clear && thickness >= 0.4 * p->shortest_extent ? 3 : 2;
}

static void place(struct scene_instrument *instrument, const struct site *site, double back)
{
    for (int i = 0; i < 3; i++) {
        instrument->axis[i] = site->inward[i] + 0.0; /* + 0.0: there is one zero, not -0 */
        instrument->trocar_m[i] = site->point[i] - back * site->inward[i];
    }
    instrument->placed = true;
}

void scene_place_instruments(struct scene *scene, const struct mesh *mesh, const struct surface *surface,
                             const bool *fixed_vertex)
{
    struct placement p = {.mesh = mesh, .surface = surface, .fixed = fixed_vertex};
    size_t unplaced = 0;
    for (size_t k = 0; k < scene->instrument_count; k++) {
        const struct scene_instrument *instrument = &scene->instrument[k];
        uint32_t hit;
        double at = instrument->placed ? scene_ray(mesh, surface, instrument->trocar_m, instrument->axis, &hit) : 0;
        unplaced += !instrument->placed;
        if (!instrument->placed || !(at < INFINITY))
            continue;
        for (int i = 0; i < 3; i++)
            p.taken[p.taken_count][i] = instrument->trocar_m[i] + at * instrument->axis[i];
        p.taken_count++;
    }
    if (!unplaced || !surface->triangle_count)
        return;
    measure(&p);
    /* Every stride-th triangle; free ones only, unless there are none (the model refuses such a body anyway). */
    struct site site[MAX_CANDIDATES];
    size_t count = 0, stride = surface->triangle_count / MAX_CANDIDATES + 1;
    for (int only_free = 1; only_free >= 0 && !count; only_free--)
        for (size_t t = 0; t < surface->triangle_count; t += stride)
            if (!only_free || free_triangle(&p, (uint32_t)t)) {
                site[count].triangle = (uint32_t)t;
                judge(&p, &site[count++]);
            }
    qsort(site, count, sizeof *site, by_score);
    for (size_t k = 0; k < scene->instrument_count; k++) {
        struct scene_instrument *instrument = &scene->instrument[k];
        if (instrument->placed)
            continue;
        double back = stand_back(instrument);
        size_t best = 0;
        int best_quality = -1;
        for (size_t c = 0; c < count && best_quality < 3; c++) {
            int q = quality(&p, &site[c], back);
            if (q > best_quality) {
                best_quality = q;
                best = c;
            }
        }
        place(instrument, &site[best], back);
        if (p.taken_count < BANK_MAX_INSTRUMENTS)
            memcpy(p.taken[p.taken_count++], site[best].point, sizeof site[best].point);
    }
}
