/* Random contact sets at the coarsest rounding that the builder offers: no system loses its definiteness, no force is not
 * finite, and single precision gives the forces of double. 1 .. 20 points of one or two tools, among them points that share
 * a triangle, that coincide, and that are 1e-6 of a triangle apart. The bank's blocks are the float numbers that the
 * controller reads; what follows them in double is the truth. Each set is solved twice:
 *
 *   pressed   along the normals, by the firmware's own contact_update, each tool with its points: within 1e-3.
 *   sticking  in three dimensions, (Wt G W + epsilon_c I) f = d for any d, with the epsilon_c of contact.h and without the
 *             virtual coupling, which only helps: within 1e-3. In float, rounding A alone moves f by up to 2^-24 trace(A) /
 *             epsilon of itself; with the bank's one epsilon that would be percents between points that coincide on a body
 *             held at one end, whose far points move by 100 times the median.
 *
 * Short form: the bank of a kernel on a sphere, at three roundings. TROCAR_LONG=1: 100 000 sets on each of the demo's organ, a
 * liver and a cylinder, quadratic, as `trocar build` makes them. */
#include <lapacke.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "bank.h"
#include "contact.h"
#include "factor_fixture.h"
#include "random.h"

enum { MAX_POINTS = 20, MAX_SIDE = 3 * MAX_POINTS, EIGENVALUES_EVERY = 20 };

struct bench {
    const struct bank_view *view;
    float *block; /* G_ij at 9 (i rows + j) */
};

struct point {
    unsigned tool;
    uint32_t triangle;
    float weight[3]; /* on the triangle's vertices, also on those that cannot move */
};

struct set {
    unsigned count, tools;
    struct point point[MAX_POINTS];
};

struct worst {
    double eigenvalue, sticking, pressing; /* smallest over epsilon; float against double, relative */
    double force_N;
};

static void bench_open(struct bench *b, const struct bank_view *view)
{
    size_t n = view->row_count;
    b->view = view;
    b->block = malloc(9 * n * n * sizeof *b->block);
    assert_non_null(b->block);
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t j = 0; j < n; j++)
            bank_view_compliance(view, i, j, b->block + 9 * (n * i + j));
}

static struct point on_triangle(uint32_t t, unsigned tool)
{
    double a = random_unit(), b = random_unit();
    if (a + b > 1) {
        a = 1 - a;
        b = 1 - b;
    }
    if (random_below(8) == 0) /* a corner, an edge */
        a = random_below(2) ? 0 : 1 - b;
    return (struct point){tool, t, {(float)(1 - a - b), (float)a, (float)b}};
}

/* Each tool wanders over the surface; a step of 0 stays in the triangle. Tools may meet. */
static struct set draw(const struct bank_view *view)
{
    struct set s = {.count = 1 + random_below(MAX_POINTS), .tools = 1 + random_below(2)};
    unsigned spread = 1 + random_below(4), used[2] = {0, 0};
    if (s.tools == 1 && s.count > CONTACT_MAX)
        s.count = CONTACT_MAX;
    uint32_t at[2] = {random_below(view->triangle_count), random_below(view->triangle_count)};
    if (random_below(4) == 0)
        at[1] = at[0];
    for (unsigned c = 0; c < s.count; c++) {
        unsigned tool = s.tools == 2 ? random_below(2) : 0;
        tool = used[tool] == CONTACT_MAX ? 1 - tool : tool;
        used[tool]++;
        uint32_t *t = &at[tool];
        for (unsigned step = random_below(spread); step > 0; step--)
            *t = view->triangles[*t].neighbour[random_below(3)];
        s.point[c] = on_triangle(*t, tool);
        unsigned kind = c > 0 ? random_below(6) : 5;
        if (kind < 2) {
            s.point[c] = s.point[random_below(c)];
            s.point[c].tool = tool;
        }
        if (kind == 1) {
            s.point[c].weight[0] -= 1e-6f;
            s.point[c].weight[1] += 1e-6f;
        }
    }
    return s;
}

/* Displacement of point c under a force at point d, in double from the bank's floats. */
static void compliance(const struct bench *b, const struct point *c, const struct point *d, double g[9])
{
    memset(g, 0, 9 * sizeof *g);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            size_t row = b->view->row_of[b->view->triangles[c->triangle].vertex[i]];
            size_t column = b->view->row_of[b->view->triangles[d->triangle].vertex[j]];
            if (row == BANK_NONE || column == BANK_NONE)
                continue;
            const float *block = b->block + 9 * (b->view->row_count * row + column);
            for (int k = 0; k < 9; k++)
                g[k] += (double)c->weight[i] * (double)d->weight[j] * (double)block[k];
        }
}

/* The smallest eigenvalue of C + epsilon I is epsilon, less what rounding its blocks to float32 may take: 2^-23 of the
 * largest one, at most of the trace. A Cholesky factor of what is left must exist; at times the eigenvalue itself. */
static void check_definite(const double *A, int n, double epsilon, double trace, struct worst *worst)
{
    double B[MAX_SIDE * MAX_SIDE], w[MAX_SIDE];
    memcpy(B, A, (size_t)(n * n) * sizeof *B);
    double allowed = epsilon * (1 - 1e-6) - 0x1p-23 * trace;
    for (int i = 0; i < n; i++)
        B[(n + 1) * i] -= allowed;
    assert_int_equal(LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', n, B, n), 0);
    if (random_below(EIGENVALUES_EVERY) != 0)
        return;
    memcpy(B, A, (size_t)(n * n) * sizeof *B);
    assert_int_equal(LAPACKE_dsyev(LAPACK_ROW_MAJOR, 'N', 'L', n, B, n, w), 0);
    worst->eigenvalue = fmin(worst->eigenvalue, w[0] / epsilon);
}

static double apart(int n, const float *x, const double *truth)
{
    double difference = 0, size = 0;
    for (int i = 0; i < n; i++) {
        assert_true(isfinite(x[i]));
        difference += pow((double)x[i] - truth[i], 2);
        size += truth[i] * truth[i];
    }
    return size > 0 ? sqrt(difference / size) : difference > 0 ? INFINITY : 0;
}

static void stick(const struct bench *b, const struct set *s, struct worst *worst)
{
    int n = (int)(3 * s->count);
    double A[MAX_SIDE * MAX_SIDE], d[MAX_SIDE], epsilon = (double)b->view->contact->regularisation_m_N, trace = 0;
    float a[MAX_SIDE * MAX_SIDE], x[MAX_SIDE];
    for (unsigned c = 0; c < s->count; c++)
        for (unsigned e = 0; e < s->count; e++) {
            double g[9];
            compliance(b, &s->point[c], &s->point[e], g);
            for (unsigned k = 0; k < 9; k++)
                A[(unsigned)n * (3 * c + k / 3) + 3 * e + k % 3] = g[k];
        }
    for (int c = 0; c < n; c += 3) {
        double own = 0;
        for (int i = c; i < c + 3; i++)
            own += A[(n + 1) * i] / 3;
        for (int i = c; i < c + 3; i++)
            A[(n + 1) * i] += epsilon * fmax(1, own / (double)b->view->contact->typical_compliance_m_N);
    }
    for (int i = 0; i < n; i++) {
        d[i] = random_range(-0.01, 0.01);
        x[i] = (float)d[i];
    }
    for (int i = 0; i < n * n; i++)
        a[i] = (float)A[i];
    for (int i = 0; i < n; i++)
        trace += A[(n + 1) * i];
    check_definite(A, n, epsilon, trace, worst);
    assert_int_equal(LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', n, 1, A, n, d, 1), 0);
    assert_int_equal(LAPACKE_sposv(LAPACK_ROW_MAJOR, 'L', n, 1, a, n, x, 1), 0);
    worst->sticking = fmax(worst->sticking, apart(n, x, d));
}

/* A p - d >= 0, p >= 0, p (A p - d) = 0 in double, by least-index pivoting [Murty 1974], which ends for any positive
 * definite A, from any first set: not the firmware's method. */
static void complementarity(const double *A, const double *d, int m, uint32_t active, double *p)
{
    for (unsigned turn = 0;; turn++) {
        double B[CONTACT_MAX * CONTACT_MAX], q[CONTACT_MAX], largest = 0;
        int index[CONTACT_MAX], n = 0, wrong = m;
        assert_true(turn < 1u << 16);
        for (int i = 0; i < m; i++) {
            p[i] = 0;
            largest = fmax(largest, fabs(d[i]));
            if (active >> i & 1)
                index[n++] = i;
        }
        for (int i = 0; i < n; i++) {
            q[i] = d[index[i]];
            for (int j = 0; j < n; j++)
                B[n * i + j] = A[m * index[i] + index[j]];
        }
        if (n)
            assert_int_equal(LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', n, 1, B, n, q, 1), 0);
        for (int i = 0; i < n; i++)
            p[index[i]] = q[i];
        for (int i = m - 1; i >= 0; i--) {
            double gap = -d[i];
            for (int j = 0; j < m; j++)
                gap += A[m * i + j] * p[j];
            if ((active >> i & 1) ? p[i] < 0 : gap < -1e-13 * largest) /* rounding of the sum: 16 terms of 2^-53 */
                wrong = i;
        }
        if (wrong == m)
            return;
        active ^= 1u << wrong;
    }
}

/* The firmware with one tool's points in contact, by hand instead of by collision. */
static void press(const struct bench *b, const struct set *s, unsigned tool, struct worst *worst)
{
    static struct contact_set contacts;
    struct collide points = {0};
    struct row_cache in_place = {0}; /* blocks are read from the view, whose rows are decoded */
    contacts = (struct contact_set){0};
    double depth = random_range(0.001, 0.02);
    for (unsigned c = 0; c < s->count; c++) {
        const struct point *p = &s->point[c];
        if (p->tool != tool)
            continue;
        struct collide_point *at = &points.point[points.count++];
        at->touching = true;
        at->triangle = p->triangle;
        at->depth_m = (float)(depth * random_range(0.5, 1));
        float n[3] = {0, 0, 0}, size = 0;
        for (int k = 0; k < 3; k++) {
            at->weights[k] = p->weight[k];
            for (int a = 0; a < 3; a++)
                n[a] += p->weight[k] * b->view->normals[3 * b->view->triangles[p->triangle].vertex[k] + a];
        }
        for (int a = 0; a < 3; a++)
            size += n[a] * n[a];
        for (int a = 0; a < 3; a++)
            at->normal[a] = n[a] / sqrtf(size);
    }
    if (points.count == 0)
        return;
    contact_update(&contacts, &in_place, b->view, &points);
    int m = (int)contacts.count;
    assert_int_equal(m, points.count);
    assert_int_equal(contacts.cut, 0);
    double A[CONTACT_MAX * CONTACT_MAX], d[CONTACT_MAX], p[CONTACT_MAX];
    float pressure[CONTACT_MAX];
    for (int c = 0; c < m; c++) {
        const struct contact *at = &contacts.contact[c];
        struct point here = {0, at->triangle, {at->weights[0], at->weights[1], at->weights[2]}};
        d[c] = (double)at->depth_m;
        pressure[c] = at->pressure_N;
        assert_true(at->pressure_N >= 0);
        for (int e = 0; e < m; e++) {
            const struct contact *from = &contacts.contact[e];
            struct point there = {0, from->triangle, {from->weights[0], from->weights[1], from->weights[2]}};
            double g[9], sum = 0;
            compliance(b, &here, &there, g);
            for (int k = 0; k < 9; k++)
                sum += (double)at->normal[k / 3] * g[k] * (double)from->normal[k % 3];
            if (c == e)
                sum += (double)b->view->contact->regularisation_m_N *
                       fmax(1, sum / (double)b->view->contact->typical_compliance_m_N);
            for (int a = 0; a < 3; a++)
                sum +=
                    (double)at->normal[a] * (double)from->normal[a] / (double)b->view->contact->coupling_stiffness_N_m;
            A[m * c + e] = sum;
        }
    }
    for (int a = 0; a < 3; a++) {
        assert_true(isfinite(contacts.force_N[0][a]));
        for (int c = 0; c < m; c++)
            assert_true(isfinite(contacts.contact[c].displacement_m[a]));
        worst->force_N = fmax(worst->force_N, fabs((double)contacts.force_N[0][a]));
    }
    complementarity(A, d, m, contacts.active, p);
    worst->pressing = fmax(worst->pressing, apart(m, pressure, p));
}

static void try_sets(const struct bank_view *view, const char *name, unsigned sets)
{
    struct bench b;
    struct worst worst = {.eigenvalue = INFINITY};
    bench_open(&b, view);
    for (unsigned k = 0; k < sets; k++) {
        struct set s = draw(view);
        stick(&b, &s, &worst);
        for (unsigned tool = 0; tool < s.tools; tool++)
            press(&b, &s, tool, &worst);
        if (worst.pressing >= 1e-3 || worst.sticking >= 1e-3)
            fail_msg("%s: set %u of %u points: float and double differ by %.1e pressed, %.1e sticking", name, k,
                     s.count, worst.pressing, worst.sticking);
    }
    print_message("# %s: %u sets of 1 .. %d points, smallest eigenvalue %.6f epsilon, float against double %.1e "
                  "pressed (largest force %.0f N), %.1e sticking\n",
                  name, sets, MAX_POINTS, worst.eigenvalue, worst.pressing, worst.force_N, worst.sticking);
    free(b.block);
}

static void on_a_sphere(void **state)
{
    (void)state;
    random_seed("contact sets on a sphere", 3);
    static const double step[] = {COMPRESSION_STEP_MAX, 1e-2, COMPRESSION_STEP};
    for (int k = 0; k < 3; k++) {
        struct factor_fixture f;
        struct rows_in_memory rows;
        struct failure why;
        char name[40];
        struct bank_fixture_options o = {.subdivisions = 2,
                                         .radius_m = 0.05,
                                         .fixed_share = 0.15,
                                         .young_Pa = 4000,
                                         .grain_m = 0.006,
                                         .shear = 0.05,
                                         .instruments = 1,
                                         .tip_points = 7,
                                         .tip_radius_m = 0.005};
        assert_int_equal(factor_fixture(&o, step[k], &f), STATUS_OK);
        assert_int_equal(rows_in_memory(&f.view, &rows, &why), STATUS_OK);
        snprintf(name, sizeof name, "sphere, step %g", step[k]);
        try_sets(&f.view, name, 700);
        rows_in_memory_free(&rows);
        factor_fixture_free(&f);
    }
}

/* As `trocar build` makes it, quadratic, at the coarsest step. False when its file is not here. */
static bool on_a_body(const char *path, const char *name)
{
    char out[] = "/tmp/trocar-sets-XXXXXX", mesher[300];
    if (access(path, R_OK) != 0) {
        print_message("# %s is not here: this case is skipped\n", path);
        return false;
    }
    snprintf(mesher, sizeof mesher, "%s/trocar-mesher", getenv("B") ? getenv("B") : "build");
    setenv("TROCAR_MESHER", mesher, 0);
    int file = mkstemp(out);
    assert_true(file >= 0);
    close(file);
    struct scene *scene = calloc(1, sizeof *scene);
    struct bank_file bank;
    struct build_result result;
    struct failure why;
    struct compression coarsest = {.step = COMPRESSION_STEP_MAX};
    size_t length = strlen(path);
    int status = STATUS_OK;
    if (length > 5 && strcmp(path + length - 5, ".yaml") == 0)
        status = scene_read(path, scene, &why);
    else
        scene_assume(path, 0.214, MESH_UNIT_NONE, scene);
    scene->order = ELEMENT_QUADRATIC;
    scene->budget_force_error = 0; /* the scene asks for a finer one */
    if (!status)
        status = bank_build(scene, out, &coarsest, INFINITY, true, &result, &why);
    if (!status)
        status = bank_load(out, &bank, &why);
    if (status)
        failure_print(stderr, &why);
    unlink(out);
    assert_int_equal(status, STATUS_OK);
    print_message("# %s: %s, %zu surface vertices, step %g, %zu bytes, patch error %.1f %%\n", name,
                  result.discretisation, result.surface_nodes, result.step, result.bytes, 100 * result.force_error_p95);
    try_sets(&bank.view, name, 100000);
    bank_unload(&bank);
    free(scene);
    return true;
}

static void on_three_bodies(void **state)
{
    (void)state;
    if (!getenv("TROCAR_LONG"))
        skip();
    random_seed("contact sets on bodies", 8);
    const char *folder = getenv("TROCAR_DATA");
    char path[2][600];
    snprintf(path[0], sizeof path[0], "%s/liver_smooth_1665_6691.msh", folder ? folder : "../shared/data");
    snprintf(path[1], sizeof path[1], "%s/cylinder_8x30x6.msh", folder ? folder : "../shared/data");
    assert_true(on_a_body("host/scenes/demo/demo.yaml", "demo organ"));
    on_a_body(path[0], "liver_smooth_1665_6691");
    on_a_body(path[1], "cylinder_8x30x6");
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(on_a_sphere),
        cmocka_unit_test(on_three_bodies),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
