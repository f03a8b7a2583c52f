/* Tools of swept spheres: contact and depth against the distance to the mesh by looking at every triangle in double precision,
 * continuity, no tunnelling, two sheets, jaws that follow the grip, and the force of one sphere against the bank's compliance. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "random.h"
#include "scene_fixture.h"
#include "tick_bench.h"

static const double PI = 3.14159265358979323846;

/* ---- spheres beside the bank, without a controller ---- */

struct world {
    unsigned char *bytes;
    struct bank_view bank;
    struct shape shape;
    struct collide points;
    float apex_m[3];
};

static void world_open(struct world *w, const struct bank_fixture_options *o)
{
    size_t length;
    memset(w, 0, sizeof *w);
    w->bytes = bank_fixture(o, &length);
    assert_int_equal(bank_view_open(&w->bank, w->bytes, length), STATUS_OK);
    w->apex_m[2] = 1;
}

static void world_close(struct world *w)
{
    free(w->bytes);
}

/* A tick in which the only sphere is here. */
static const struct collide_point *move(struct world *w, const double x[3])
{
    float at[1][3] = {{(float)x[0], (float)x[1], (float)x[2]}};
    shape_hide(&w->shape, &w->points);
    w->points.count = w->points.tool[0].count = 1;
    collide_begin(&w->points);
    collide_update(&w->points, &w->bank, 0, w->apex_m, (const float(*)[3])at);
    shape_touch(&w->shape, &w->bank, &w->points);
    return &w->points.point[0];
}

static void forget(struct world *w)
{
    collide_forget(&w->points, 0);
    shape_forget(&w->shape, 0, 0, 16);
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void vertex(const struct bank_view *bank, uint32_t triangle, int k, double x[3])
{
    for (int a = 0; a < 3; a++)
        x[a] = (double)bank->positions[3 * bank->triangles[triangle].vertex[k] + a];
}

static void plane(const struct bank_view *bank, uint32_t triangle, double n[3], double *offset)
{
    double p[3][3];
    for (int k = 0; k < 3; k++)
        vertex(bank, triangle, k, p[k]);
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        n[a] = (p[1][b] - p[0][b]) * (p[2][c] - p[0][c]) - (p[1][c] - p[0][c]) * (p[2][b] - p[0][b]);
    }
    double length = sqrt(dot(n, n));
    for (int a = 0; a < 3; a++)
        n[a] /= length;
    *offset = dot(n, p[0]);
}

/* To a triangle: to its plane where the foot is inside, else to the nearest of its sides. */
static double distance_to(const struct bank_view *bank, uint32_t triangle, const double x[3])
{
    double p[3][3], n[3], offset, nearest = INFINITY;
    bool over = true;
    plane(bank, triangle, n, &offset);
    for (int k = 0; k < 3; k++)
        vertex(bank, triangle, k, p[k]);
    for (int k = 0; k < 3; k++) {
        double side[3], from[3], out[3], along = 0, away2 = 0;
        for (int a = 0; a < 3; a++) {
            side[a] = p[(k + 1) % 3][a] - p[k][a];
            from[a] = x[a] - p[k][a];
        }
        for (int a = 0; a < 3; a++)
            out[a] = side[(a + 1) % 3] * n[(a + 2) % 3] - side[(a + 2) % 3] * n[(a + 1) % 3];
        over = over && dot(out, from) <= 0;
        along = fmin(1, fmax(0, dot(side, from) / dot(side, side)));
        for (int a = 0; a < 3; a++)
            away2 += pow(from[a] - along * side[a], 2);
        nearest = fmin(nearest, sqrt(away2));
    }
    return over ? fabs(dot(n, x) - offset) : nearest;
}

static double distance_to_surface(const struct bank_view *bank, const double x[3])
{
    double d = INFINITY;
    for (uint32_t t = 0; t < bank->triangle_count; t++)
        d = fmin(d, distance_to(bank, t, x));
    return d;
}

/* Above every face's plane it cannot be and be inside; of a convex body. */
static bool outside(const struct bank_view *bank, const double x[3])
{
    for (uint32_t t = 0; t < bank->triangle_count; t++) {
        double n[3], offset;
        plane(bank, t, n, &offset);
        if (dot(n, x) > offset)
            return true;
    }
    return false;
}

static struct bank_shape one_sphere(double radius_m)
{
    return (struct bank_shape){.band_m = (float)radius_m, .sphere[0] = {.radius_m = (float)radius_m}};
}

static struct bank_fixture_options body(const struct bank_shape *shape, double flatten)
{
    struct bank_fixture_options o = bank_fixture_default;
    o.subdivisions = 3;
    o.tip_points = 1;
    o.shape = shape;
    o.flatten = flatten;
    return o;
}

/* With a the anchor, t = |centre - a| and phi the angle between the interpolated normal and the face's: the distance is at most t, as
 * a is on the surface, and of a centre outside a convex body at least t cos phi, as the body lies below the face's plane. */
static void spheres_touch_by_the_distance_to_the_mesh(void **state)
{
    (void)state;
    random_seed("distance", 51);
    for (int round = 0; round < 2; round++) {
        const double radius_m = round ? 0.0025 : 0.006;
        struct bank_shape shape = one_sphere(radius_m);
        struct bank_fixture_options o = body(&shape, round ? 0.3 : 0);
        struct world w;
        world_open(&w, &o);
        int touched = 0, beside = 0;
        double worst = 0, least = 1;
        for (uint32_t t = 0; t < w.bank.triangle_count; t++)
            for (int k = 0; k < 3; k++) {
                double n[3], offset, across = 0;
                plane(&w.bank, t, n, &offset);
                for (int a = 0; a < 3; a++)
                    across += n[a] * (double)w.bank.normals[3 * w.bank.triangles[t].vertex[k] + a];
                least = fmin(least, across); /* between its corners a face's normal is nearer to the interpolated one */
            }
        for (int n = 0; n < 4000; n++) {
            double x[3], d, size = 0, high_m = random_range(-0.5, 2) * radius_m;
            if (n % 4 == 0) { /* somewhere new; the rest of the time a step of at most 2 mm */
                forget(&w);
                for (int a = 0; a < 3; a++)
                    x[a] = random_range(-1, 1), size += x[a] * x[a];
                for (int a = 0; a < 3; a++)
                    x[a] *= (o.radius_m + high_m) / sqrt(size) * (a == 2 && o.flatten > 0 ? o.flatten : 1);
                for (int a = 0; a < 3; a++) /* behind it: a shaft through the body would keep it in contact */
                    w.apex_m[a] = (float)(10 * x[a]);
            } else
                for (int a = 0; a < 3; a++)
                    x[a] = (double)w.points.point[0].position_m[a] + random_range(-1.1e-3, 1.1e-3);
            const struct collide_point *p = move(&w, x);
            for (int a = 0; a < 3; a++)
                x[a] = (double)p->position_m[a];
            d = distance_to_surface(&w.bank, x);
            if (!outside(&w.bank, x)) {
                assert_true(p->touching);
                assert_true((double)p->depth_m >= radius_m + d - 1e-7);
                continue;
            }
            double face[3], offset, m[3], cosine;
            plane(&w.bank, p->triangle, face, &offset);
            for (int a = 0; a < 3; a++)
                m[a] = (double)p->normal[a];
            cosine = dot(face, m);
            if (p->touching) {
                touched++;
                double t = radius_m - (double)p->depth_m, away2 = 0;
                for (int a = 0; a < 3; a++)
                    away2 += pow(x[a] - (double)p->anchor_m[a], 2);
                assert_true(d <= sqrt(away2) + 2e-8); /* positions are rounded to 2^-24 of 0.1 m */
                double off =
                    sqrt(fmax(0, away2 - t * t)); /* beside the normal: what it may add to a plane's distance */
                assert_true(d >= t * cosine - off * sqrt(1 - cosine * cosine) - 1e-7);
                assert_true(sqrt(away2) < hypot(t, 0.25 * radius_m) + 2e-8); /* what shape.c takes for an anchor */
                assert_true(cosine > least);
                worst = fmax(worst, t - d);
            } else {
                beside++;
                if (d < least * radius_m)
                    fail_msg("a sphere of %g m at %g m from the surface does not touch", radius_m, d);
            }
        }
        printf("# radius %.4f m: cos phi above %.3f, %d touch, %d do not; depth differs from the distance by at most "
               "%.1e m\n",
               radius_m, least, touched, beside, worst);
        assert_true(touched > 200 && beside > 200);
        world_close(&w);
    }
}

/* Across edges, out of the body and in again, by steps that are small beside a jump. */
static void depth_and_normal_are_continuous(void **state)
{
    (void)state;
    const double radius_m = 0.004, step_m = 2e-5;
    struct bank_shape shape = one_sphere(radius_m);
    struct bank_fixture_options o = body(&shape, 0);
    struct world w;
    world_open(&w, &o);
    double depth_before = 0, normal_before[3] = {0}, most_depth = 0, most_turn = 0;
    int crossings = 0, triangles = 0;
    uint32_t triangle = UINT32_MAX;
    bool in = false;
    for (int i = 0; i < 6000; i++) {
        /* around the body, 2 mm inside to 2 mm outside */
        double angle = i * step_m / o.radius_m, height = o.radius_m + 0.002 * sin(0.01 * i);
        double x[3] = {height * sin(angle), 0.3 * height * sin(2 * angle), height * cos(angle)}, size = sqrt(dot(x, x));
        for (int a = 0; a < 3; a++)
            x[a] *= height / size;
        const struct collide_point *p = move(&w, x);
        assert_true(p->touching);
        double depth = (double)p->depth_m, turn = 0;
        for (int a = 0; a < 3; a++)
            turn += pow((double)p->normal[a] - normal_before[a], 2);
        if (i > 0) {
            most_depth = fmax(most_depth, fabs(depth - depth_before));
            most_turn = fmax(most_turn, sqrt(turn));
        }
        triangles += p->triangle != triangle;
        crossings += in != !(w.shape.outside & 1u);
        in = !(w.shape.outside & 1u);
        triangle = p->triangle;
        depth_before = depth;
        for (int a = 0; a < 3; a++)
            normal_before[a] = (double)p->normal[a];
    }
    printf("# %d triangles, %d times through the surface: depth changes by at most %.1e m, normal by %.1e in a step\n",
           triangles, crossings, most_depth, most_turn);
    assert_true(triangles > 20 && crossings > 10);
    /* a step is up to 2.4e-5 m along and 2e-5 m across; with normals up to 11 degrees off the face it moves the depth by
     * the sum over cos 11 deg, and turns the normal by the step over the radius, a third more near a vertex */
    assert_true(most_depth < 4.8e-5);
    assert_true(most_turn < 3 * step_m * 1.6 / o.radius_m);
    world_close(&w);
}

static void no_speed_tunnels_through_a_sheet(void **state)
{
    (void)state;
    const double radius_m = 0.002;
    struct bank_shape shape = one_sphere(radius_m);
    struct bank_fixture_options o = body(&shape, 0.04); /* 4 mm thick */
    struct world w;
    world_open(&w, &o);
    random_seed("sheet", 52);
    for (int n = 0; n < 500; n++) {
        double above[3] = {random_range(-0.02, 0.02), random_range(-0.02, 0.02), random_range(0.005, 0.1)};
        double below[3] = {above[0] + random_range(-0.01, 0.01), above[1] + random_range(-0.01, 0.01),
                           -random_range(0.003, 0.006)};
        forget(&w);
        assert_false(move(&w, above)->touching);
        const struct collide_point *p = move(&w, below);
        assert_true(p->touching);
        assert_true(p->normal[2] > 0.9f); /* it is pushed back to where it came from */
        assert_true((double)p->depth_m > radius_m - below[2]);
    }
    world_close(&w);
}

static void both_sheets_of_a_cell_are_found(void **state)
{
    (void)state;
    const double radius_m = 0.002;
    struct bank_shape shape = one_sphere(radius_m);
    struct bank_fixture_options o = body(&shape, 0.04);
    struct world w;
    world_open(&w, &o);
    random_seed("two sheets", 53);
    for (int n = 0; n < 1000; n++) {
        int side = n % 2 ? 1 : -1;
        double x[3] = {random_range(-0.02, 0.02), random_range(-0.02, 0.02), 0}, r2 = x[0] * x[0] + x[1] * x[1];
        x[2] = side * (0.04 * sqrt(o.radius_m * o.radius_m - r2) + 0.5 * radius_m);
        forget(&w);
        w.apex_m[2] = (float)side;
        const struct collide_point *p = move(&w, x);
        assert_true(p->touching);
        assert_true(p->normal[2] * (float)side > 0.9f);
    }
    world_close(&w);
}

/* ---- where the samples are ---- */

static struct bank_shape scene_spheres(const char *effect, struct scene *scene)
{
    char key[300];
    struct failure why;
    snprintf(key, sizeof key, "effects: {shape: %s}", effect);
    char *text = changed(scene_full, "effects: {}", key);
    char *one = changed(text, "  - {name: left}\n", "");
    int status = parse(one, "", scene, &why);
    if (status)
        fail_msg("%s: %s", effect, why.cause);
    free(text), free(one);
    struct bank_shape shape = {0};
    scene_shape_spheres(scene, &shape);
    return shape;
}

static void jaws_follow_the_grip_and_the_roll(void **state)
{
    (void)state;
    struct scene *scene = malloc(sizeof *scene);
    struct bank_shape spheres =
        scene_spheres("{shaft: {radius: 2.5 mm, length: 50 mm, samples: 3}, jaws: {radius: 1.5 mm, length: 18 mm, "
                      "opening: 80 deg, samples: 2}}",
                      scene);
    struct bank_view bank = {.shape = &spheres};
    struct kinematics k = {.frame = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    assert_int_equal(scene->instrument[0].tip_points, 7);
    for (unsigned grip = 0; grip <= 63; grip += 7)
        for (unsigned roll = 0; roll < 1024; roll += 93) {
            struct shape s = {0};
            float x[7][3];
            shape_sense(&s, 0, 512, 63 - (uint16_t)grip); /* from elsewhere: it follows with 10 ms */
            for (int i = 0; i < 300; i++)
                shape_sense(&s, 0, (uint16_t)roll, (uint16_t)grip);
            shape_move(&s, &bank, 0, 0, 7, &k, x);
            double theta = 40 * PI / 180 * (1 - grip / 63.0), turn = 2 * PI * (roll - 512.0) / 1024;
            for (int i = 0; i < 7; i++) {
                double along = i < 4 ? i % 2 ? 0.009 : 0.018 : 0, side = i < 2 ? -1 : i < 4 ? 1 : 0;
                double across = side * (0.0015 + along * sin(theta));
                double want[3] = {across * cos(turn), across * sin(turn), -0.0195 + along * cos(theta)};
                if (i >= 4)
                    want[2] -= 0.025 * (i - 4);
                for (int a = 0; a < 3; a++) /* 1e-13 of the way is left, floats are rounded at 0.07 m */
                    assert_true(fabs((double)x[i][a] - want[a]) < 2e-8);
            }
            double apart2 = 0;
            for (int a = 0; a < 3; a++)
                apart2 += pow((double)x[0][a] - (double)x[2][a], 2);
            if (grip == 63) /* the closed jaws touch each other */
                assert_true(fabs(sqrt(apart2) - 2 * 0.0015) < 4e-8);
        }
    free(scene);
}

static void the_smoothed_grip_never_jumps(void **state)
{
    (void)state;
    struct shape s = {0};
    shape_sense(&s, 0, 512, 0);
    float before = s.tool[0].grip;
    for (int i = 0; i < 50; i++) {
        shape_sense(&s, 0, 512, 63);
        assert_true(s.tool[0].grip > before && s.tool[0].grip - before <= 6.31f);
        before = s.tool[0].grip;
    }
    assert_true(fabs(63 - (double)before - 63 * pow(0.9, 50)) < 1e-4);
}

static void samples_are_shared_out_by_length_over_radius(void **state)
{
    (void)state;
    struct scene *scene = malloc(sizeof *scene);
    scene_spheres("{jaws: {}}", scene);
    struct scene_shape shape = scene->effects.shape;
    for (unsigned n = 1; n <= 16; n++) {
        scene_shape_spread(&shape, n);
        assert_int_equal(scene_shape_samples(&shape), n);
        assert_true(n < 3 || (shape.shaft.samples >= 1 && shape.jaw.samples >= 1));
    }
    assert_true(shape.jaw.samples > 2 && shape.shaft.samples > 2);
    shape.jaws = false;
    scene_shape_spread(&shape, 5);
    assert_int_equal(shape.shaft.samples, 5);
    free(scene);
}

/* ---- the scene ---- */

static void a_scene_with_a_shape_reads_back(void **state)
{
    (void)state;
    static const char *const effects[] = {
        "{}",
        "{shaft: {samples: 7}}",
        "{jaws: {}}",
        "{shaft: {radius: 4 mm, length: 30 mm, samples: 2}, jaws: {radius: 1 mm, length: 12 mm, opening: 1.1 rad, "
        "samples: 5}}",
        "{jaws: {opening: 35 deg}, instrument: right}",
    };
    struct scene *scene = malloc(sizeof *scene), *back = malloc(sizeof *back);
    for (size_t i = 0; i < sizeof effects / sizeof *effects; i++) {
        struct bank_shape shape = scene_spheres(effects[i], scene);
        struct failure why;
        char *text = scene_print(scene);
        assert_int_equal(parse(text, "", back, &why), STATUS_OK);
        assert_memory_equal(&scene->effects, &back->effects, sizeof scene->effects);
        assert_int_equal(scene->instrument[0].tip_points, back->instrument[0].tip_points);
        struct bank_shape again = {0};
        scene_shape_spheres(back, &again);
        assert_memory_equal(&shape, &again, sizeof shape);
        free(text);
    }
    free(scene), free(back);
}

/* The limits of the keys are those of the bank. */
static void the_widest_jaws_make_a_bank_that_opens(void **state)
{
    (void)state;
    struct scene *scene = malloc(sizeof *scene);
    struct bank_shape shape = scene_spheres("{jaws: {opening: 180 deg, samples: 6}}", scene);
    struct bank_fixture_options o = body(&shape, 0);
    struct bench b;
    o.tip_points = 16;
    bench_open(&b, &o); /* ends the program when the bank is refused */
    assert_true(b.bank.shape->opening_rad[0] > 1.57f);
    bench_close(&b);
    free(scene);
}

static void what_no_instrument_can_be_is_refused(void **state)
{
    (void)state;
    static const struct {
        const char *effect;
        int status;
        const char *cause;
    } cases[] = {
        {"{shaft: {samples: 17}}", STATUS_SCENE_VALUE, "samples = 17"},
        {"{shaft: {samples: 1.5}}", STATUS_SCENE_VALUE, "samples = 1.5"},
        {"{shaft: {radius: 0 mm}}", STATUS_SCENE_VALUE, "radius"},
        {"{shaft: {radius: 3}}", STATUS_SCENE_UNIT, "radius"},
        {"{shaft: {length: 118 mm}}", STATUS_SCENE_VALUE, "stand out behind"},
        {"{jaws: {opening: 200 deg}}", STATUS_SCENE_VALUE, "opening"},
        {"{jaws: {samples: 8}}", STATUS_SCENE_VALUE, "20 samples and points"},
        {"{instrument: middle}", STATUS_SCENE_VALUE, "no instrument is named 'middle'"},
        {"{}, friction: {mu: 0.2}", STATUS_SCENE_VALUE, "do not go together"},
        {"{handle: {}}", STATUS_SCENE_KEY, "handle"},
    };
    struct scene *scene = malloc(sizeof *scene);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char key[200];
        struct failure why;
        snprintf(key, sizeof key, "effects: {shape: %s}", cases[i].effect);
        char *text = changed(scene_full, "effects: {}", key), *one = changed(text, "  - {name: left}\n", "");
        int status = parse(one, "s.yaml", scene, &why);
        if (status != cases[i].status)
            fail_msg("%s: status %d", cases[i].effect, status);
        if (!strstr(why.cause, cases[i].cause) || strcmp(why.place, "s.yaml:28") != 0)
            fail_msg("%s: %s: %s", cases[i].effect, why.place, why.cause);
        free(text), free(one);
    }
    free(scene);
}

/* ---- the bank ---- */

static struct bank_shape *section(unsigned char *bytes)
{
    return (struct bank_shape *)(bytes + bank_fixture_section(bytes, BANK_SHAP)->offset);
}

#define REFUSED(status_, change)                                                                                       \
    do {                                                                                                               \
        size_t length;                                                                                                 \
        struct bank_view view;                                                                                         \
        unsigned char *bytes = bank_fixture(&o, &length);                                                              \
        struct bank_shape *s = section(bytes);                                                                         \
        uint16_t *seed = (uint16_t *)(s + 1);                                                                          \
        (void)seed;                                                                                                    \
        change;                                                                                                        \
        bank_fixture_seal(bytes, length);                                                                              \
        assert_int_equal(bank_view_open(&view, bytes, length), status_);                                               \
        assert_int_equal(view.fault_tag, BANK_SHAP);                                                                   \
        assert_null(view.shape);                                                                                       \
        free(bytes);                                                                                                   \
    } while (0)

static void a_damaged_section_is_refused(void **state)
{
    (void)state;
    struct bank_shape shape = one_sphere(0.003);
    struct bank_fixture_options o = body(&shape, 0);
    o.subdivisions = 1;
    REFUSED(STATUS_BANK_INDEX, s->cells[0] = 0);
    REFUSED(STATUS_BANK_INDEX, s->cells[1] = BANK_MAX_GRID_AXIS + 1);
    REFUSED(STATUS_BANK_INDEX, s->cells[0] = s->cells[1] = s->cells[2] = 1000);
    REFUSED(STATUS_BANK_LENGTH, s->cells[0]++);
    REFUSED(STATUS_BANK_LENGTH, bank_fixture_section(bytes, BANK_SHAP)->count++);
    REFUSED(STATUS_BANK_INDEX, seed[3] = 80);
    REFUSED(STATUS_BANK_NONFINITE, s->band_m = 0);
    REFUSED(STATUS_BANK_NONFINITE, s->band_m = NAN);
    REFUSED(STATUS_BANK_NONFINITE, s->cell_m = -1);
    REFUSED(STATUS_BANK_NONFINITE, s->origin_m[2] = INFINITY);
    REFUSED(STATUS_BANK_NONFINITE, s->reserved = 1);
    REFUSED(STATUS_BANK_NONFINITE, s->zero[1] = 1);
    REFUSED(STATUS_BANK_NONFINITE, s->opening_rad[1] = 2);
    REFUSED(STATUS_BANK_NONFINITE, s->sphere[15].radius_m = 0.1f);
    REFUSED(STATUS_BANK_NONFINITE, s->sphere[0].along_m = -0.1f);
    REFUSED(STATUS_BANK_NONFINITE, s->sphere[2].side = 0.5f);
    REFUSED(STATUS_BANK_NONFINITE, s->sphere[3].centre_m[1] = NAN);
    REFUSED(STATUS_BANK_NONFINITE, s->sphere[3].reserved[1] = 7);
}

/* ---- the controller ---- */

/* One sphere at the tip, pressed straight down on the pole: p = d / (n . B n + 1/k + epsilon_c), B from the bank's blocks. */
static void the_force_of_a_sphere_is_its_depth_by_the_compliance(void **state)
{
    (void)state;
    const double radius_m = 0.005;
    struct bank_shape shape = one_sphere(radius_m);
    struct bank_fixture_options o = body(&shape, 0);
    struct bench b;
    bench_open(&b, &o);
    bench_start(&b, 0, 0, 0.10);
    const struct controller *c = &b.node.controller;
    const double touch_m = 0.12 - radius_m; /* the trocar is 0.12 m above the pole, the centre is the tip */
    int touching = 0;
    for (int i = 0; i < 200; i++) {
        double insertion = 0.113 + 5e-5 * i;
        bench_tick(&b, 0, 0, insertion);
        const struct contact_set *s = &c->contact;
        if (fabs(insertion - touch_m) < 3e-5) /* counts are 2.3e-5 m */
            continue;
        assert_int_equal(s->count, insertion > touch_m);
        if (s->count == 0)
            continue;
        const struct contact *at = &s->contact[0];
        double tip = (double)c->instrument[0].kinematics.joint[2], B = 0;
        /* the pole is a vertex or lies on an edge: the anchor is at the sphere's own radius or a sagitta below */
        assert_true(fabs((double)at->depth_m - (tip - touch_m)) < 1e-6 + 0.0006);
        for (int i0 = 0; i0 < 3; i0++)
            for (int j0 = 0; j0 < 3; j0++) {
                float G[9];
                const uint16_t *v = b.bank.triangles[at->triangle].vertex;
                bank_view_compliance(&b.bank, b.bank.row_of[v[i0]], b.bank.row_of[v[j0]], G);
                for (int e = 0; e < 9; e++)
                    B += (double)(at->weights[i0] * at->weights[j0] * at->normal[e / 3] * G[e] * at->normal[e % 3]);
            }
        double pad =
            (double)b.bank.contact->regularisation_m_N * fmax(1, B / (double)b.bank.contact->typical_compliance_m_N);
        double p = (double)at->depth_m / (B + 1 / (double)b.bank.contact->coupling_stiffness_N_m + pad);
        assert_true(fabs(p - (double)at->pressure_N) < 1e-5 * p);
        touching++;
    }
    assert_true(touching > 50);
    bench_close(&b);
}

/* The instrument as it is documented (kinematics.h, scene.h), in double: the tip, and a place that is fixed to it. */
static void pose(const struct bank_tool *tool, const double q[3], const double offset[3], double x[3])
{
    double s[3] = {sin(q[0]), sin(q[1]), sqrt(1 - pow(sin(q[0]), 2) - pow(sin(q[1]), 2))}, X[3], Y[3], size = 0;
    for (int a = 0; a < 3; a++)
        X[a] = (a == 0) - s[0] * s[a], size += X[a] * X[a];
    for (int a = 0; a < 3; a++)
        X[a] /= sqrt(size);
    for (int a = 0; a < 3; a++)
        Y[a] = s[(a + 1) % 3] * X[(a + 2) % 3] - s[(a + 2) % 3] * X[(a + 1) % 3];
    for (int a = 0; a < 3; a++) {
        x[a] = (double)tool->trocar_m[a];
        for (int b = 0; b < 3; b++)
            x[a] +=
                (double)tool->rotation[3 * a + b] * (offset[0] * X[b] + offset[1] * Y[b] + (q[2] + offset[2]) * s[b]);
    }
}

static void differences(const struct bank_tool *tool, const double q[3], const double offset[3], double J[3][3])
{
    for (int j = 0; j < 3; j++) {
        double h = 1e-6, up[3], down[3], x[3], y[3];
        memcpy(up, q, sizeof up), memcpy(down, q, sizeof down);
        up[j] += h, down[j] -= h;
        pose(tool, up, offset, x);
        pose(tool, down, offset, y);
        for (int a = 0; a < 3; a++)
            J[a][j] = (x[a] - y[a]) / (2 * h);
    }
}

/* A push moves the joints by n . dx/dq at the place where the sphere touches, the force at the tip by F . dtip/dq: the same. */
static void has_its_lever(bool grasps)
{
    struct scene *scene = malloc(sizeof *scene);
    struct bank_shape shape = scene_spheres("{shaft: {radius: 4 mm, length: 40 mm, samples: 4}, jaws: {radius: 3 mm, "
                                            "length: 25 mm, samples: 3}}",
                                            scene);
    struct bank_fixture_options o = body(&shape, 0);
    o.tip_points = 10;
    o.grasp_slip_N = grasps ? 100 : 0;
    struct bench b;
    bench_open(&b, &o);
    bench_start(&b, 0, 0, 0.10);
    const struct controller *c = &b.node.controller;
    random_seed("lever", 54);
    unsigned held = 0;
    double worst = 0, shortest = 1;
    int checked = 0;
    for (int n = 0; n < 60; n++) {
        double to[3] = {random_range(-0.35, 0.35), random_range(-0.35, 0.35), random_range(0.13, 0.19)};
        unsigned roll = random_below(1024), grip = random_below(64);
        for (int i = 0; i < 60; i++) {
            const float *at = c->instrument[0].kinematics.joint;
            struct can_frame_t frame;
            node_begin_tick(&b.node);
            while (node_transmit(&b.node, &frame)) {
            }
            struct wire_encoders sample = bench_counts(&b, (double)at[0] + (to[0] - (double)at[0]) / (60 - i),
                                                       (double)at[1] + (to[1] - (double)at[1]) / (60 - i),
                                                       (double)at[2] + (to[2] - (double)at[2]) / (60 - i));
            sample.grip = (uint8_t)grip;
            sample.roll = (uint16_t)roll;
            bench_send_sample(&b, sample);
            bench_finish(&b);
        }
        double q[3], force[3] = {0}, J_tip[3][3], work[3] = {0}, none[3] = {0}, size = 0, off = 0;
        for (int j = 0; j < 3; j++)
            q[j] = (double)c->instrument[0].kinematics.joint[j];
        differences(&b.bank.tools[0], q, none, J_tip);
        for (unsigned k = 0; k < c->contact.count; k++) {
            const struct contact *at = &c->contact.contact[k];
            const float *frame = c->instrument[0].kinematics.frame;
            double offset[3] = {0}, J[3][3];
            for (int a = 0; a < 3; a++)
                for (int e = 0; e < 3; e++)
                    offset[a] += (double)frame[3 * e + a] *
                                 ((double)c->collide.point[at->point].position_m[e] -
                                  (double)b.bank.shape->sphere[at->point].radius_m * (double)at->normal[e] -
                                  (double)c->instrument[0].kinematics.tip_m[e]);
            differences(&b.bank.tools[0], q, offset, J);
            for (int j = 0; j < 3; j++)
                for (int a = 0; a < 3; a++)
                    work[j] +=
                        (grasps ? (double)at->force_N[a] : (double)at->pressure_N * (double)at->normal[a]) * J[a][j];
            held += grasps && c->grasp.point[at->point].held;
            shortest = fmin(shortest, (q[2] + offset[2]) / q[2]);
        }
        if (c->contact.count == 0)
            continue;
        for (int a = 0; a < 3; a++)
            force[a] = (double)c->contact.force_N[0][a];
        for (int j = 0; j < 3; j++) {
            double at_tip = J_tip[0][j] * force[0] + J_tip[1][j] * force[1] + J_tip[2][j] * force[2];
            double scale = j < 2 ? q[2] : 1;
            off += pow((at_tip - work[j]) / scale, 2);
            size += pow(work[j] / scale, 2);
        }
        checked++;
        worst = fmax(worst, sqrt(off / size));
    }
    printf("# %d poses, nearest to the trocar at %.2f of the insertion: work differs by at most %.1e of it\n", checked,
           shortest, worst);
    assert_true(checked > 20 && shortest < 0.8);
    /* sums of some ten products in single precision, of pushes that may cancel to a fifth; differences leave 1e-10 */
    assert_true(worst < 1e-5);
    assert_true(!grasps || held > 20);
    bench_close(&b);
    free(scene);
}

static void a_push_beside_the_tip_has_its_lever(void **state)
{
    (void)state;
    has_its_lever(false);
}

static void so_has_what_the_jaws_hold(void **state)
{
    (void)state;
    has_its_lever(true);
}

/* Two instruments: the second one's samples are its own. */
static void each_instrument_has_its_own_spheres(void **state)
{
    (void)state;
    struct bank_shape shape = {.band_m = 0.01f};
    for (int i = 0; i < 5; i++)
        shape.sphere[i] =
            (struct bank_sphere){.radius_m = i < 2 ? 0.002f : 0.006f, .centre_m = {0, 0, -0.01f * (float)i}};
    struct bank_view bank = {.shape = &shape};
    struct kinematics k[2] = {{.frame = {1, 0, 0, 0, 1, 0, 0, 0, 1}}, {.frame = {1, 0, 0, 0, 1, 0, 0, 0, 1}}};
    k[1].tip_m[0] = 1;
    struct shape s = {0};
    float x[5][3];
    shape_sense(&s, 0, 512, 0);
    shape_sense(&s, 1, 512, 63);
    shape_move(&s, &bank, 0, 0, 2, &k[0], x);
    shape_move(&s, &bank, 1, 2, 3, &k[1], x);
    for (int i = 0; i < 5; i++) {
        assert_true(x[i][0] == (i < 2 ? 0.0f : 1.0f));
        assert_true(x[i][2] == -0.01f * (float)i);
    }
    s.near = s.outside = 31;
    shape_forget(&s, 1, 2, 3);
    assert_int_equal(s.near, 3);
    assert_int_equal(s.outside, 3);
    assert_true(s.tool[0].started && !s.tool[1].started);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spheres_touch_by_the_distance_to_the_mesh),
        cmocka_unit_test(depth_and_normal_are_continuous),
        cmocka_unit_test(no_speed_tunnels_through_a_sheet),
        cmocka_unit_test(both_sheets_of_a_cell_are_found),
        cmocka_unit_test(jaws_follow_the_grip_and_the_roll),
        cmocka_unit_test(the_smoothed_grip_never_jumps),
        cmocka_unit_test(samples_are_shared_out_by_length_over_radius),
        cmocka_unit_test(a_scene_with_a_shape_reads_back),
        cmocka_unit_test(the_widest_jaws_make_a_bank_that_opens),
        cmocka_unit_test(what_no_instrument_can_be_is_refused),
        cmocka_unit_test(a_damaged_section_is_refused),
        cmocka_unit_test(a_push_beside_the_tip_has_its_lever),
        cmocka_unit_test(so_has_what_the_jaws_hold),
        cmocka_unit_test(each_instrument_has_its_own_spheres),
        cmocka_unit_test(the_force_of_a_sphere_is_its_depth_by_the_compliance),
    };
    return cmocka_run_group_tests_name("shape", tests, NULL, NULL);
}
