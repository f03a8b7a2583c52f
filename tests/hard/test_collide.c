/* Swept collision against brute force over all triangles, and no tunnelling: a point that is inside the body has touched
 * it, at any speed. Meshes: the synthetic sphere, and third-party meshes when they are there. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "bank_fixture.h"
#include "collide.h"
#include "grid.h"
#include "mesh.h"
#include "random.h"

#ifdef __SANITIZE_ADDRESS__
enum { SEGMENTS = 20000, STEPS = 2000 };
#else
enum { SEGMENTS = 260000, STEPS = 30000 }; /* four bodies: more than a million segments */
#endif

/* Only what collision reads of a bank: no compliance is needed here. */
struct body {
    struct bank_view bank;
    float *positions, *normals;
    struct bank_triangle *triangles;
    struct grid grid;
    double low[3], high[3], size;
};

static void body_finish(struct body *b, size_t vertices, size_t count, const uint32_t *triangles)
{
    struct failure why;
    assert_int_equal(grid_build(vertices, b->positions, count, triangles, &b->grid, &why), STATUS_OK);
    b->bank = (struct bank_view){.vertex_count = (uint32_t)vertices,
                                 .triangle_count = (uint32_t)count,
                                 .positions = b->positions,
                                 .normals = b->normals,
                                 .triangles = b->triangles,
                                 .grid = &b->grid.header,
                                 .cell_base = b->grid.base,
                                 .cell_start = b->grid.start,
                                 .cell_triangle = b->grid.entry};
    for (int k = 0; k < 3; k++) {
        b->low[k] = INFINITY, b->high[k] = -INFINITY;
        for (size_t v = 0; v < vertices; v++) {
            b->low[k] = fmin(b->low[k], b->positions[3 * v + k]);
            b->high[k] = fmax(b->high[k], b->positions[3 * v + k]);
        }
        b->size = fmax(b->size, b->high[k] - b->low[k]);
    }
}

/* False when the file is not there. */
static bool body_read(struct body *b, const char *name)
{
    char path[1000];
    const char *folder = getenv("TROCAR_DATA");
    snprintf(path, sizeof path, "%s/%s", folder ? folder : "../shared/data", name);
    FILE *there = fopen(path, "rb");
    if (!there)
        return false;
    fclose(there);
    struct mesh mesh;
    struct surface s;
    struct mesh_report report;
    struct failure why = {0};
    memset(b, 0, sizeof *b);
    int status = mesh_read(path, 0, &mesh, &why);
    if (!status)
        status = mesh_check(&mesh, true, &report, &why);
    if (!status)
        status = mesh_scale(&mesh, 0.214, MESH_UNIT_NONE, &why);
    if (!status)
        status = mesh_surface(&mesh, &s, &why);
    if (status)
        fail_msg("%s: %s", name, why.cause);
    b->positions = malloc(s.vertex_count * 12);
    b->normals = malloc(s.vertex_count * 12);
    b->triangles = calloc(s.triangle_count, sizeof *b->triangles);
    for (size_t v = 0; v < s.vertex_count; v++)
        for (int k = 0; k < 3; k++) {
            b->positions[3 * v + k] = (float)mesh.nodes[3 * s.node[v] + k];
            b->normals[3 * v + k] = (float)s.normals[3 * v + k];
        }
    for (size_t t = 0; t < s.triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            b->triangles[t].vertex[k] = (uint16_t)s.triangles[3 * t + k];
            b->triangles[t].neighbour[k] = (uint16_t)s.neighbours[3 * t + k];
        }
    body_finish(b, s.vertex_count, s.triangle_count, s.triangles);
    surface_free(&s);
    mesh_free(&mesh);
    return true;
}

static void body_sphere(struct body *b)
{
    struct bank_fixture_options o = bank_fixture_default;
    o.subdivisions = 3;
    size_t length;
    unsigned char *bytes = bank_fixture(&o, &length);
    struct bank_view v;
    memset(b, 0, sizeof *b);
    assert_int_equal(bank_view_open(&v, bytes, length), STATUS_OK);
    b->positions = malloc(v.vertex_count * 12);
    b->normals = malloc(v.vertex_count * 12);
    b->triangles = malloc(v.triangle_count * sizeof *b->triangles);
    memcpy(b->positions, v.positions, v.vertex_count * 12);
    memcpy(b->normals, v.normals, v.vertex_count * 12);
    memcpy(b->triangles, v.triangles, v.triangle_count * sizeof *b->triangles);
    uint32_t *t = malloc(v.triangle_count * 12);
    for (uint32_t i = 0; i < 3 * v.triangle_count; i++)
        t[i] = v.triangles[i / 3].vertex[i % 3];
    body_finish(b, v.vertex_count, v.triangle_count, t);
    free(t);
    free(bytes);
}

static void body_free(struct body *b)
{
    grid_free(&b->grid);
    free(b->positions);
    free(b->normals);
    free(b->triangles);
}

static const char *const mesh_name[] = {"", "liver_smooth_1665_6691.msh", "torus_low_res.msh",
                                        "Armadillo_Tetra_4406.vtu"};

static bool open_body(struct body *b, unsigned which)
{
    if (which > 0)
        return body_read(b, mesh_name[which]);
    body_sphere(b);
    return true;
}

static void random_point(const struct body *b, double around, float p[3])
{
    for (int k = 0; k < 3; k++)
        p[k] = (float)random_range(b->low[k] - around * b->size, b->high[k] + around * b->size);
}

static void sweeps_agree_with_brute_force(void **state)
{
    (void)state;
    random_seed("segments", 20);
    for (unsigned which = 0; which < 4; which++) {
        struct body b;
        if (!open_body(&b, which)) {
            printf("# %s is not here: skipped\n", mesh_name[which]);
            continue;
        }
        unsigned hits = 0;
        for (int n = 0; n < SEGMENTS; n++) {
            float from[3], to[3];
            random_point(&b, 0.2, from);
            unsigned kind = random_below(8);
            if (kind == 0) { /* across the whole scene */
                random_point(&b, 0.2, to);
            } else { /* a tick of 0.1 mm to 30 mm, of which some along an axis or from one vertex to another */
                double reach = pow(10, random_range(-4, -1.5));
                for (int k = 0; k < 3; k++)
                    to[k] = from[k] + (float)(kind == 1 && k != n % 3 ? 0 : reach * random_range(-1, 1));
            }
            if (kind == 2 || kind == 3) { /* start near a vertex, where edges meet */
                const float *v = &b.positions[3 * random_below(b.bank.vertex_count)];
                for (int k = 0; k < 3; k++) {
                    float lift =
                        (float)(kind == 2 ? 0.01 * random_range(-1, 1) : 0.01 * b.normals[v - b.positions + k]);
                    from[k] = v[k] + lift;
                    to[k] = v[k] - lift;
                }
            }
            struct collide_hit swept = {.triangle = 0}, brute = {.triangle = 0};
            bool a = collide_sweep(&b.bank, from, to, &swept), c = collide_brute(&b.bank, from, to, &brute);
            assert_int_equal(a, c);
            if (!a)
                continue;
            hits++;
            assert_int_equal(swept.triangle, brute.triangle);
            assert_memory_equal(&swept.fraction, &brute.fraction, sizeof swept.fraction);
            assert_memory_equal(swept.weights, brute.weights, sizeof swept.weights);
        }
        printf("# %s: %u triangles, %d segments, %u hits, no difference\n", which ? mesh_name[which] : "sphere",
               b.bank.triangle_count, SEGMENTS, hits);
        assert_true(hits > SEGMENTS / 50);
        body_free(&b);
    }
}

/* Winding number by solid angles [Van Oosterom and Strackee 1983], double precision: 1 inside, 0 outside. */
static double winding(const struct body *b, const float p[3])
{
    double sum = 0;
    for (uint32_t t = 0; t < b->bank.triangle_count; t++) {
        double v[3][3], l[3];
        for (int k = 0; k < 3; k++) {
            for (int i = 0; i < 3; i++)
                v[k][i] = (double)b->positions[3 * b->triangles[t].vertex[k] + i] - p[i];
            l[k] = sqrt(v[k][0] * v[k][0] + v[k][1] * v[k][1] + v[k][2] * v[k][2]);
        }
        double det = v[0][0] * (v[1][1] * v[2][2] - v[1][2] * v[2][1]) -
                     v[0][1] * (v[1][0] * v[2][2] - v[1][2] * v[2][0]) +
                     v[0][2] * (v[1][0] * v[2][1] - v[1][1] * v[2][0]);
        double dot01 = 0, dot12 = 0, dot20 = 0;
        for (int i = 0; i < 3; i++) {
            dot01 += v[0][i] * v[1][i];
            dot12 += v[1][i] * v[2][i];
            dot20 += v[2][i] * v[0][i];
        }
        sum += 2 * atan2(det, l[0] * l[1] * l[2] + dot01 * l[2] + dot12 * l[0] + dot20 * l[1]);
    }
    return sum / (4 * 3.14159265358979);
}

static void no_speed_tunnels(void **state)
{
    (void)state;
    random_seed("flight", 21);
    static const double speed_m_s[] = {0.1, 1, 10, 100};
    for (unsigned which = 0; which < 4; which++) {
        struct body b;
        if (!open_body(&b, which))
            continue;
        unsigned inside = 0, entries = 0, lost = 0;
        for (unsigned s = 0; s < 4; s++) {
            struct collide c = {.count = 1, .tool = {{.count = 1}}};
            float p[1][3];
            double direction[3] = {1, 0, 0};
            do
                random_point(&b, 0.2, p[0]);
            while (winding(&b, p[0]) > 0.5);
            collide_begin(&c);
            collide_update(&c, &b.bank, 0, p[0], (const float(*)[3])p);
            bool was_inside = false;
            for (int n = 0; n < STEPS / 4; n++) {
                double length = 0;
                for (int k = 0; k < 3; k++) { /* a flight that turns, and is drawn back to the body */
                    double centre = 0.5 * (b.low[k] + b.high[k]);
                    direction[k] += 0.5 * random_range(-1, 1) + 0.1 * (centre - p[0][k]) / b.size;
                    length += direction[k] * direction[k];
                }
                for (int k = 0; k < 3; k++) {
                    direction[k] /= sqrt(length);
                    p[0][k] += (float)(1e-3 * speed_m_s[s] * direction[k]);
                }
                collide_begin(&c);
                collide_update(&c, &b.bank, 0, p[0], (const float(*)[3])p);
                double w = winding(&b, p[0]);
                bool now = w > 0.5;
                entries += now && !was_inside;
                inside += now;
                if (now && !c.point[0].touching)
                    lost++;
                was_inside = now;
            }
        }
        printf("# %s: %u entries, %u ticks inside, %u of them not touching\n", which ? mesh_name[which] : "sphere",
               entries, inside, lost);
        assert_true(entries > STEPS / 1500); /* 20 in the full form */
        assert_int_equal(lost, 0);
        body_free(&b);
    }
}

/* However deep the tool was driven, and whichever way it wandered inside: back outside where it came from, it touches
 * nothing. Motions of a hand, up to 1 m/s, to any depth. (A tool that went around and comes back through the body from
 * behind does touch: it pushes the tissue before it. Such trips are not judged.) */
static void contacts_end_when_the_tool_is_back_outside(void **state)
{
    (void)state;
    random_seed("deep", 22);
    for (unsigned which = 0; which < 4; which++) {
        struct body b;
        if (!open_body(&b, which))
            continue;
        unsigned stuck = 0, judged = 0, deep = 0;
        uint32_t cut = 0;
        for (int trip = 0; trip < STEPS / 200; trip++) {
            struct collide c = {.count = 1, .tool = {{.count = 1}}};
            float start[3], p[1][3];
            double length = 0, out[3];
            for (int k = 0; k < 3; k++) { /* from well outside, in any direction */
                out[k] = random_range(-1, 1);
                length += out[k] * out[k];
            }
            for (int k = 0; k < 3; k++)
                start[k] = p[0][k] = (float)(0.5 * (b.low[k] + b.high[k]) + b.size * out[k] / sqrt(length));
            collide_begin(&c);
            collide_update(&c, &b.bank, 0, start, (const float(*)[3])p);
            unsigned legs = 2 + random_below(4), entries = 0;
            for (unsigned leg = 0; leg <= legs; leg++) {
                float to[3];
                do
                    random_point(&b, 0, to);
                while (winding(&b, to) < 0.5);
                if (leg == legs)
                    memcpy(to, start, sizeof to);
                double distance = 0;
                for (int k = 0; k < 3; k++)
                    distance += (to[k] - p[0][k]) * (to[k] - p[0][k]);
                int steps = (int)(sqrt(distance) / (1e-3 * random_range(0.1, 1))) + 1;
                float from[3] = {p[0][0], p[0][1], p[0][2]};
                for (int n = 1; n <= steps; n++) {
                    for (int k = 0; k < 3; k++)
                        p[0][k] = from[k] + (to[k] - from[k]) * (float)n / (float)steps;
                    bool before = c.point[0].touching;
                    collide_begin(&c);
                    collide_update(&c, &b.bank, 0, start, (const float(*)[3])p);
                    entries += !before && c.point[0].touching;
                    deep += c.point[0].touching && c.point[0].depth_m > 0.03;
                }
            }
            judged += entries == 1;
            stuck += entries == 1 && c.point[0].touching;
            cut += c.walks_cut;
        }
        printf("# %s: %u of %u trips judged, %u ticks deeper than 30 mm, %u anchors cut, %u stuck\n",
               which ? mesh_name[which] : "sphere", judged, STEPS / 200, deep, cut, stuck);
        assert_true(judged > STEPS / 3000);
        assert_int_equal(stuck, 0);
        body_free(&b);
    }
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sweeps_agree_with_brute_force),
        cmocka_unit_test(no_speed_tunnels),
        cmocka_unit_test(contacts_end_when_the_tool_is_back_outside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
