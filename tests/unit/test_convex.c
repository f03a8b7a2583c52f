/* The controller's distance between convex hulls of a few points: against bounds from above and below in double precision, and
 * against libccd on a million pairs of capsules. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <ccd/ccd.h>
#include <cmocka.h>

#include "effects/convex.h"
#include "random.h"

enum { PAIRS = 1000000, HULL_PAIRS = 200000 };

/* Rounding of differences of coordinates (1.5e-8 m each) and of the normal (6e-8 times hulls of up to 0.5 m, a few times); and of the
 * distance itself. A normal is worth as much less as the distance is small against the hulls: it is looked at from here on. */
static const double ROUNDING_m = 3e-7, ROUNDING = 3e-7, NEAR_m = 1e-3;

struct body {
    float point[CONVEX_POINTS][3];
    unsigned count;
    double radius;
};

static struct convex hull(const struct body *b)
{
    return (struct convex){(const float(*)[3])b->point, b->count};
}

static void random_point(float p[3], double size)
{
    for (int k = 0; k < 3; k++)
        p[k] = (float)random_range(-size, size);
}

static void random_axis(double n[3])
{
    double length = 0;
    while (length < 0.1 || length > 1) {
        length = 0;
        for (int k = 0; k < 3; k++) {
            n[k] = random_range(-1, 1);
            length += n[k] * n[k];
        }
    }
    for (int k = 0; k < 3; k++)
        n[k] /= sqrt(length);
}

/* Two segments as instruments meet: anyhow; parallel; crossing at a given distance; short or of no length; touching end to end. */
static void random_segments(struct body *a, struct body *b)
{
    a->count = b->count = 2;
    unsigned kind = random_below(6);
    random_point(a->point[0], 0.15);
    random_point(a->point[1], 0.15);
    random_point(b->point[0], 0.15);
    random_point(b->point[1], 0.15);
    double n[3], along[3], away = random_unit() < 0.5 ? random_range(0, 0.02) : random_range(0, 1e-3);
    random_axis(n);
    random_axis(along);
    for (int k = 0; k < 3; k++) {
        double low = (double)a->point[0][k], high = (double)a->point[1][k];
        if (kind == 1) { /* parallel, or nearly */
            double turn = random_unit() < 0.5 ? 0 : random_range(0, 1e-5);
            b->point[0][k] = (float)(low + away * n[k]);
            b->point[1][k] = (float)(high + away * n[k] + turn * along[k]);
        } else if (kind == 2) { /* crossing */
            b->point[0][k] = (float)((low + high) / 2 + away * n[k] - 0.1 * along[k]);
            b->point[1][k] = (float)((low + high) / 2 + away * n[k] + 0.1 * along[k]);
        } else if (kind == 3) { /* tiny */
            b->point[1][k] = (float)((double)b->point[0][k] + 1e-5 * along[k]);
        } else if (kind == 4) { /* points */
            b->point[1][k] = b->point[0][k];
            if (random_state & 1)
                a->point[1][k] = a->point[0][k];
        } else if (kind == 5) { /* an end near the other */
            b->point[0][k] = (float)(low + away * n[k]);
        }
    }
}

static void difference_in_double(const struct body *a, const struct body *b, const struct convex_feature *f,
                                 double v[3])
{
    double sum = 0;
    v[0] = v[1] = v[2] = 0;
    for (unsigned i = 0; i < f->count; i++)
        sum += (double)f->weight[i];
    for (unsigned i = 0; i < f->count; i++)
        for (int k = 0; k < 3; k++)
            v[k] += (double)f->weight[i] / sum * ((double)a->point[f->a[i]][k] - (double)b->point[f->b[i]][k]);
}

static double gap_in_double(const struct body *a, const struct body *b, const float normal[3])
{
    double near = INFINITY, far = -INFINITY, length = 0;
    for (int k = 0; k < 3; k++)
        length += (double)normal[k] * (double)normal[k];
    for (unsigned i = 0; i < a->count; i++) {
        double x = 0;
        for (int k = 0; k < 3; k++)
            x += (double)normal[k] * (double)a->point[i][k];
        near = fmin(near, x);
    }
    for (unsigned i = 0; i < b->count; i++) {
        double x = 0;
        for (int k = 0; k < 3; k++)
            x += (double)normal[k] * (double)b->point[i][k];
        far = fmax(far, x);
    }
    return (near - far) / sqrt(length);
}

/* How far the bounds were from each other, in parts of what is allowed. */
struct worst {
    double first, second;
    unsigned beyond_first;
};

/* The true distance is at most that of the two points told (high), and at least the gap along the normal told (low). Returns the
 * distance told. Where two faces of long thin hulls are equally far to rounding, either may be told, and its normal is off by the
 * angle t with d t^2 / 2 = rounding: the second limit, for hulls of up to 0.5 m. */
static double check(const struct body *a, const struct body *b, struct worst *worst)
{
    struct convex_closest c;
    double start[3], v[3];
    random_axis(start);
    convex_closest(hull(a), hull(b), (const float[3]){(float)start[0], (float)start[1], (float)start[2]}, &c);
    assert_true(c.feature.count >= 1 && c.feature.count <= 4);
    difference_in_double(a, b, &c.feature, v);
    double high = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), told = (double)c.distance_m;
    assert_true(c.apart == (c.distance_m > CONVEX_OVERLAP_m));
    if (told > NEAR_m) {
        double low = gap_in_double(a, b, c.normal), first = ROUNDING_m + ROUNDING * told;
        double second = first + 0.5 * sqrt(2 * first / told), off = fmax(high - low, fabs(told - high));
        worst->beyond_first += off > first;
        if (off <= first)
            worst->first = fmax(worst->first, off / first);
        worst->second = fmax(worst->second, off / second);
        worst->second = fmax(worst->second, fabs((double)convex_gap(hull(a), hull(b), c.normal) - low) / first);
    }
    return told;
}

static void assert_bounds(const struct worst *worst, unsigned pairs)
{
    printf("# bounds differ by at most %.2f of what rounding explains, but for %u pairs, of which by %.2f of the "
           "second limit\n",
           worst->first, worst->beyond_first, worst->second);
    assert_true(worst->second < 1);
    assert_true(worst->beyond_first < pairs / 20000);
}

static void the_distance_of_hulls_is_bounded_from_both_sides(void **state)
{
    (void)state;
    random_seed("hulls", 50);
    struct worst worst = {0};
    unsigned apart = 0;
    for (int n = 0; n < HULL_PAIRS; n++) {
        struct body a = {.count = 1 + random_below(2)}, b = {.count = 1 + random_below(CONVEX_POINTS)};
        double size = random_unit() < 0.2 ? 1e-3 : random_range(0.005, 0.1), flat[3];
        bool is_flat = random_below(4) == 0;
        unsigned twin = random_below(4);
        random_axis(flat);
        for (unsigned i = 0; i < b.count; i++) {
            random_point(b.point[i], size);
            double off = 0;
            for (int k = 0; k < 3; k++)
                off += (double)b.point[i][k] * flat[k];
            for (int k = 0; k < 3 && is_flat; k++)
                b.point[i][k] = (float)((double)b.point[i][k] - off * flat[k]);
            if (i && twin == 0)
                memcpy(b.point[i], b.point[random_below(i)], sizeof b.point[i]);
        }
        random_point(a.point[0], 0.15);
        random_point(a.point[1], 0.15);
        apart += check(&a, &b, &worst) > NEAR_m;
    }
    printf("# %u of %d pairs apart\n", apart, HULL_PAIRS);
    assert_true(apart > HULL_PAIRS / 4);
    assert_bounds(&worst, HULL_PAIRS);
}

static void support(const void *object, const ccd_vec3_t *direction, ccd_vec3_t *out)
{
    const struct body *b = object;
    double best = -INFINITY, length = sqrt(ccdVec3Len2(direction));
    for (unsigned i = 0; i < b->count; i++) {
        ccd_vec3_t p;
        ccdVec3Set(&p, (double)b->point[i][0], (double)b->point[i][1], (double)b->point[i][2]);
        double reach = ccdVec3Dot(&p, direction);
        if (reach > best) {
            best = reach;
            ccdVec3Copy(out, &p);
        }
    }
    ccd_vec3_t round;
    ccdVec3Copy(&round, direction);
    ccdVec3Scale(&round, b->radius / length);
    ccdVec3Add(out, &round);
}

static void centre(const void *object, ccd_vec3_t *out)
{
    const struct body *b = object;
    ccdVec3Set(out, 0, 0, 0);
    for (unsigned i = 0; i < b->count; i++) {
        ccd_vec3_t p;
        ccdVec3Set(&p, (double)b->point[i][0], (double)b->point[i][1], (double)b->point[i][2]);
        ccdVec3Scale(&p, 1.0 / b->count);
        ccdVec3Add(out, &p);
    }
}

static void a_million_capsules_touch_where_libccd_says_so(void **state)
{
    (void)state;
    ccd_t ccd;
    CCD_INIT(&ccd);
    ccd.support1 = ccd.support2 = support;
    ccd.center1 = ccd.center2 = centre;
    ccd.max_iterations = 1000;
    ccd.mpr_tolerance = 1e-9;
    random_seed("capsules", 51);
    struct worst worst = {0};
    unsigned touching = 0, disagree = 0, near = 0;
    for (int n = 0; n < PAIRS; n++) {
        struct body a = {.radius = random_range(0.001, 0.006)}, b = {.radius = random_range(0.001, 0.006)};
        random_segments(&a, &b);
        double distance = check(&a, &b, &worst);
        /* Half of the pairs are put so that they just touch, or just do not. */
        double sum = a.radius + b.radius;
        if (distance > NEAR_m && random_unit() < 0.5) {
            double wanted = distance + random_range(-1e-5, 1e-5);
            a.radius *= wanted / sum;
            b.radius *= wanted / sum;
            sum = wanted;
            near++;
        }
        bool touch = distance < sum;
        touching += touch;
        if (fabs(distance - sum) < 1e-6)
            continue;
        disagree += ccdMPRIntersect(&a, &b, &ccd) != touch;
    }
    printf("# %d pairs, %u put within 1e-5 m of touching, %u touch: %u disagree beyond 1e-6 m\n", PAIRS, near, touching,
           disagree);
    assert_int_equal(disagree, 0);
    assert_bounds(&worst, PAIRS);
    assert_true(touching > PAIRS / 5 && touching < PAIRS * 4 / 5);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_distance_of_hulls_is_bounded_from_both_sides),
        cmocka_unit_test(a_million_capsules_touch_where_libccd_says_so),
    };
    return cmocka_run_group_tests_name("convex", tests, NULL, NULL);
}
