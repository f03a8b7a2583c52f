#include "effects/convex.h"

#include "real.h"

#define CONVEX_EQUAL 1e-6f /* of distances that differ by rounding */
enum { CONVEX_IDLE = 2 };  /* steps in a row that may bring no nearer */

/* Vertices of the difference A - B, and the point of their simplex that is nearest to the origin. */
struct simplex {
    struct convex_feature feature;
    float vertex[4][3];
    float nearest[3], length2;
};

static uint32_t support(struct convex hull, const float direction[3], float sign, float *most)
{
    uint32_t best = 0;
    for (uint32_t i = 0; i < hull.count; i++) { /* bound: CONVEX_POINTS */
        float reach = sign * real_dot(hull.point_m[i], direction);
        if (i == 0 || reach > *most) {
            *most = reach;
            best = i;
        }
    }
    return best;
}

float convex_gap(struct convex a, struct convex b, const float normal[3])
{
    float near = 0.0f, far = 0.0f;
    support(a, normal, -1.0f, &near);
    support(b, normal, 1.0f, &far);
    return -near - far;
}

void convex_points(const struct convex_feature *feature, struct convex a, struct convex b, float on_a_m[3],
                   float on_b_m[3])
{
    for (int k = 0; k < 3; k++) /* bound: 3 */
        on_a_m[k] = on_b_m[k] = 0.0f;
    for (uint32_t i = 0; i < feature->count; i++) /* bound: 4 */
        for (int k = 0; k < 3; k++) {             /* bound: 3 */
            on_a_m[k] += feature->weight[i] * a.point_m[feature->a[i]][k];
            on_b_m[k] += feature->weight[i] * b.point_m[feature->b[i]][k];
        }
}

/* The point of the line through p and q that is nearest to the origin, and q's weight in it. */
static bool nearest_on_line(const float p[3], const float q[3], float nearest[3], float *weight)
{
    float edge[3];
    real_subtract(q, p, edge);
    float length2 = real_dot(edge, edge);
    if (!(length2 > 0.0f))
        return false;
    *weight = 0.0f;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        nearest[k] = p[k];
    for (int round = 0; round < 2; round++) { /* bound: 2; the second takes out the rounding of the first */
        float step = -real_dot(nearest, edge) / length2;
        *weight += step;
        for (int k = 0; k < 3; k++) /* bound: 3 */
            nearest[k] += step * edge[k];
    }
    return true;
}

/* The point of the plane through p, q and r that is nearest to the origin, and their weights in it. The normal is that of the two
 * shorter sides: of a thin triangle it errs about the long side only, across which there is no way to go. */
static bool nearest_on_plane(const float *corner[3], float nearest[3], float weight[3])
{
    float side[3][3], length2[3], normal[3];
    for (int i = 0; i < 3; i++) { /* bound: 3; opposite corner i */
        real_subtract(corner[(i + 2) % 3], corner[(i + 1) % 3], side[i]);
        length2[i] = real_dot(side[i], side[i]);
    }
    int longest = length2[0] > length2[1] ? 0 : 1;
    longest = length2[2] > length2[longest] ? 2 : longest;
    int one = (longest + 1) % 3, two = (longest + 2) % 3;
    real_cross(side[one], side[two], normal);
    float area2 = real_dot(normal, normal);
    if (!(area2 > 1e-10f * length2[one] * length2[two]))
        return false;
    float share = real_dot(corner[longest], normal) / area2;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        nearest[k] = share * normal[k];
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        float to[2][3], across[3];
        real_subtract(corner[(i + 1) % 3], nearest, to[0]);
        real_subtract(corner[(i + 2) % 3], nearest, to[1]);
        real_cross(to[0], to[1], across);
        weight[i] = real_dot(across, normal) / area2;
    }
    return true;
}

/* Try the vertices of `pick` (n of them, 1 to 3) as the ones that the nearest point lies between. */
static void try_face(const struct simplex *s, const uint8_t *pick, uint32_t n, struct simplex *best)
{
    float nearest[3], weight[3] = {1.0f, 0.0f, 0.0f};
    const float *corner[3] = {s->vertex[pick[0]], s->vertex[pick[n > 1]], s->vertex[pick[n - 1]]};
    for (int k = 0; k < 3; k++) /* bound: 3 */
        nearest[k] = corner[0][k];
    if (n == 2) {
        if (!nearest_on_line(corner[0], corner[1], nearest, &weight[1]))
            return;
        weight[0] = 1.0f - weight[1];
    } else if (n == 3 && !nearest_on_plane(corner, nearest, weight)) {
        return;
    }
    for (uint32_t i = 0; i < n; i++) /* bound: 3 */
        if (!(weight[i] > 0.0f))
            return;
    float length2 = real_dot(nearest, nearest);
    if (!(length2 < best->length2))
        return;
    best->length2 = length2;
    best->feature.count = n;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        best->nearest[k] = nearest[k];
    for (uint32_t i = 0; i < n; i++) { /* bound: 3 */
        best->feature.weight[i] = weight[i];
        best->feature.a[i] = s->feature.a[pick[i]];
        best->feature.b[i] = s->feature.b[pick[i]];
        for (int k = 0; k < 3; k++) /* bound: 3 */
            best->vertex[i][k] = s->vertex[pick[i]][k];
    }
}

static float volume(const float a[3], const float b[3], const float c[3])
{
    float across[3];
    real_cross(b, c, across);
    return real_dot(a, across);
}

/* The origin is inside the tetrahedron: seen from it, each vertex lies on the other side of the opposite face. */
static bool encloses(const struct simplex *s)
{
    const float *v[4] = {s->vertex[0], s->vertex[1], s->vertex[2], s->vertex[3]};
    float e[3][3];
    for (int i = 0; i < 3; i++) /* bound: 3 */
        real_subtract(v[i + 1], v[0], e[i]);
    float whole = volume(e[0], e[1], e[2]);
    if (whole * whole <= 1e-12f * real_dot(e[0], e[0]) * real_dot(e[1], e[1]) * real_dot(e[2], e[2]))
        return false; /* flat to rounding: its faces are all that there is */
    float part[4] = {volume(v[1], v[2], v[3]), -volume(v[0], v[2], v[3]), volume(v[0], v[1], v[3]),
                     -volume(v[0], v[1], v[2])};
    for (int i = 0; i < 4; i++) /* bound: 4 */
        if (!(part[i] * whole > 0.0f))
            return false;
    return true;
}

/* Reduce the simplex to the face of it that is nearest to the origin; the last vertex is part of it, since it was found beyond
 * the face of the others. False when the origin is inside. */
static bool reduce(struct simplex *s)
{
    struct simplex best = {.length2 = 3e38f};
    uint32_t n = s->feature.count;
    uint8_t last = (uint8_t)(n - 1);
    if (n == 4 && encloses(s))
        return false;
    try_face(s, (const uint8_t[]){last}, 1, &best);
    for (uint8_t i = 0; i < last; i++) { /* bound: 3 */
        try_face(s, (const uint8_t[]){i, last}, 2, &best);
        for (uint8_t j = 0; j < i; j++) /* bound: 2 */
            try_face(s, (const uint8_t[]){j, i, last}, 3, &best);
    }
    *s = best;
    return true;
}

/* The vertex of A - B that lies furthest against the direction: false when the simplex has it already. `reach`: how far along the
 * direction, which is all of A - B. */
static bool add_vertex(struct simplex *s, struct convex a, struct convex b, const float direction[3], float *reach)
{
    float most, vertex[3];
    struct convex_feature *f = &s->feature;
    uint8_t on_a = (uint8_t)support(a, direction, -1.0f, &most), on_b = (uint8_t)support(b, direction, 1.0f, &most);
    real_subtract(a.point_m[on_a], b.point_m[on_b], vertex);
    *reach = real_dot(vertex, direction);
    for (uint32_t i = 0; i < f->count; i++) /* bound: 3 */
        if (f->a[i] == on_a && f->b[i] == on_b)
            return false;
    f->a[f->count] = on_a;
    f->b[f->count] = on_b;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        s->vertex[f->count][k] = vertex[k];
    f->count++;
    return true;
}

void convex_closest(struct convex a, struct convex b, const float start[3], struct convex_closest *out)
{
    struct simplex s = {.feature.count = 0};
    float reach, gap = -3e38f;
    int idle = 0;
    *out = (struct convex_closest){.apart = false};
    add_vertex(&s, a, b, start, &reach);
    reduce(&s);
    for (int step = 0; step < CONVEX_STEPS; step++) { /* bound: CONVEX_STEPS */
        float length2 = s.length2, length = real_sqrt(length2);
        struct convex_closest now = {.apart = length > CONVEX_OVERLAP_m, .feature = s.feature, .distance_m = length};
        for (int k = 0; k < 3 && now.apart; k++) /* bound: 3 */
            now.normal[k] = s.nearest[k] / length;
        bool more = now.apart && add_vertex(&s, a, b, s.nearest, &reach);
        /* Beside an edge the distance hardly changes where the normal still does: of equal ones the largest gap is right. */
        bool nearer = length < out->distance_m * (1.0f - CONVEX_EQUAL),
             equal = length < out->distance_m * (1.0f + CONVEX_EQUAL);
        if (step == 0 || !now.apart || nearer || (equal && reach > gap * length)) {
            *out = now;
            gap = now.apart ? reach / length : 0.0f;
        }
        if (!more || length - reach / length <= CONVEX_EQUAL * length)
            return;
        if (!reduce(&s)) {
            out->apart = false;
            out->distance_m = 0.0f;
            return;
        }
        idle = s.length2 < length2 ? 0 : idle + 1;
        if (idle > CONVEX_IDLE || !(s.length2 < length2 * (1.0f + CONVEX_EQUAL))) /* only by rounding */
            return;
    }
}
