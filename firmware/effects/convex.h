/* Closest points of two convex hulls of a few points: how rigid things are from each other (Gilbert, Johnson, Keerthi 1988).
 *
 * Sphere-swept hulls, capsules (two points) and balls (one) among them, touch when their cores, the hulls, are as near as the
 * sum of the radii. So cores that do not overlap are all that is asked for: rigid.h sees to it that they do not.
 *
 *   a in A, b in B nearest to each other;  normal n = (a - b) / |a - b|, from B to A
 *   distance = |a - b|                               an upper bound: a and b are in the hulls by construction
 *   gap(n) = min over A of n . x - max over B of n . x   a lower bound, whatever n is: that plane separates them
 *
 * Precision: of hulls within 0.5 m of each other and of the origin the distance errs by at most 1e-6 m. Where they are 1e-3 m or more
 * apart, gap(normal) too is within 3e-7 m + 3e-7 distance of it, but for one pair in 70,000 of long thin hulls, whose normal is off by
 * up to 0.01 rad. Held against double precision and libccd on a million pairs, parallel, crossing, flat and coincident ones among
 * them (tests/unit/test_convex.c). Below CONVEX_OVERLAP_m no normal is told.
 *
 * Work: at most CONVEX_STEPS times the support of both hulls and the nearest point of 4 vertices, 1000 to 1500 instructions of a
 * Cortex-M7. Segments take 2 to 4 steps, a hull of 16 points some 4 and in one of a thousand more than 7; cut short, the answer is that of
 * the step which came nearest. */
#ifndef TROCAR_CONVEX_H
#define TROCAR_CONVEX_H

#include <stdbool.h>
#include <stdint.h>

enum { CONVEX_POINTS = 16, CONVEX_STEPS = 12 };
#define CONVEX_OVERLAP_m 1e-5f

struct convex {
    const float (*point_m)[3];
    uint32_t count; /* 1 .. CONVEX_POINTS */
};

/* Where two hulls are nearest, as means of their points: for other places of the same points too. */
struct convex_feature {
    uint32_t count; /* 1 .. 4 */
    uint8_t a[4], b[4];
    float weight[4]; /* above 0, sum 1 */
};

struct convex_closest {
    bool apart; /* the hulls do not overlap, and normal is told */
    struct convex_feature feature;
    float normal[3], distance_m;
};

/* `start`: any direction that is not 0, best the last normal. */
void convex_closest(struct convex a, struct convex b, const float start[3], struct convex_closest *out);

float convex_gap(struct convex a, struct convex b, const float normal[3]);

/* The two points of a feature. */
void convex_points(const struct convex_feature *feature, struct convex a, struct convex b, float on_a_m[3],
                   float on_b_m[3]);

#endif
