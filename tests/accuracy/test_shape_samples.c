/* How much force the sampling of a capsule costs: a shaft that is laid on the demo's organ, by 2, 4, 8 and 16 spheres, against one sampled so
 * densely that more change nothing, with the contact problem solved in double precision. tests/rig/shape.t reads what this prints. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_linalg.h>

#include "candidate.h"
#include "shape_seeds.h"
#include "tick_bench.h"

enum { DENSE = 161, POSES = 18, TICKS = 80 };
static const double INSERTION_m = 0.17, HIGHEST_rad = 0.06, LOWEST_rad = -0.03;

/* A centre's contact on the surface: anchor by the nearest triangle of all and the walk from there. */
struct place {
    struct collide_point at;
    double depth_m, pull[3];
};

static bool find(const struct bank_view *bank, const double centre[3], double radius_m, struct place *p)
{
    double nearest = INFINITY;
    memset(p, 0, sizeof *p);
    for (uint32_t t = 0; t < bank->triangle_count; t++) {
        double corner[9], foot[3];
        for (int k = 0; k < 9; k++)
            corner[k] = (double)bank->positions[3 * bank->triangles[t].vertex[k / 3] + k % 3];
        double d = shape_nearest(corner, centre, foot);
        if (d < nearest) {
            nearest = d;
            p->at.triangle = t;
        }
    }
    for (int k = 0; k < 3; k++) {
        p->at.weights[k] = 1.0f / 3;
        p->at.position_m[k] = (float)centre[k];
    }
    collide_settle(bank, &p->at);
    collide_settle(bank, &p->at);
    p->depth_m = radius_m + (double)p->at.depth_m;
    return p->depth_m > 0;
}

/* n_c . W_c^t G W_d n_d */
static double response(const struct bank_view *bank, const struct place *c, const struct place *d)
{
    double sum = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            float G[9];
            uint16_t row = bank->row_of[bank->triangles[c->at.triangle].vertex[i]],
                     column = bank->row_of[bank->triangles[d->at.triangle].vertex[j]];
            if (row == BANK_NONE || column == BANK_NONE)
                continue;
            bank_view_compliance(bank, row, column, G);
            for (int e = 0; e < 9; e++)
                sum += (double)c->at.weights[i] * (double)d->at.weights[j] * (double)c->at.normal[e / 3] *
                       (double)G[e] * (double)d->at.normal[e % 3];
        }
    return sum;
}

/* p >= 0, A p >= d, p (A p - d) = 0: the set of Lawson and Hanson, in double. */
static void solve(size_t m, const double *A, const double *d, double *p)
{
    bool *in = calloc(m, sizeof *in);
    double *s = calloc(m, sizeof *s), *a = malloc(m * m * sizeof *a), *b = malloc(m * sizeof *b);
    size_t *index = malloc(m * sizeof *index);
    memset(p, 0, m * sizeof *p);
    for (size_t round = 0; round < 20 * m; round++) {
        size_t n = 0, worst = m;
        double most = 1e-9, part = 1;
        for (size_t i = 0; i < m; i++)
            if (in[i])
                index[n++] = i;
        for (size_t i = 0; i < n; i++) {
            b[i] = d[index[i]];
            for (size_t j = 0; j < n; j++)
                a[n * i + j] = A[m * index[i] + index[j]];
        }
        if (n > 0) {
            gsl_matrix_view matrix = gsl_matrix_view_array(a, n, n);
            gsl_vector_view right = gsl_vector_view_array(b, n), left = gsl_vector_view_array(s, n);
            assert_int_equal(gsl_linalg_cholesky_decomp1(&matrix.matrix), 0);
            gsl_linalg_cholesky_solve(&matrix.matrix, &right.vector, &left.vector);
        }
        for (size_t i = 0; i < n; i++)
            if (s[i] <= 0)
                part = fmin(part, p[index[i]] / (p[index[i]] - s[i]));
        for (size_t i = 0; i < n; i++) {
            p[index[i]] += part * (s[i] - p[index[i]]);
            if (s[i] <= 0 && p[index[i]] <= 1e-14)
                in[index[i]] = false, p[index[i]] = 0;
        }
        if (part < 1)
            continue;
        for (size_t i = 0; i < m; i++) {
            double gap = d[i];
            for (size_t j = 0; j < m; j++)
                gap -= A[m * i + j] * p[j];
            if (!in[i] && gap > most)
                most = gap, worst = i;
        }
        if (worst == m)
            break;
        in[worst] = true;
    }
    free(in), free(s), free(a), free(b), free(index);
}

/* The force at the tip of a shaft of `count` spheres; and of all pushes how many. */
static unsigned reference(const struct bank_view *bank, const struct kinematics *k, const struct scene_capsule *shaft,
                          unsigned count, double force_N[3])
{
    struct place *place = malloc(count * sizeof *place);
    unsigned m = 0, pushing = 0;
    for (unsigned i = 0; i < count; i++) {
        float at[3] = {0, 0, (float)(-shaft->radius_m - shaft->length_m * i / (count - 1))}, x[3];
        kinematics_point(k, at, x);
        double centre[3] = {(double)x[0], (double)x[1], (double)x[2]};
        struct place *p = &place[m];
        if (!find(bank, centre, shaft->radius_m, p))
            continue;
        float touch[3], pull[3];
        for (int a = 0; a < 3; a++)
            touch[a] = x[a] - (float)shaft->radius_m * p->at.normal[a];
        kinematics_pull(k, touch, p->at.normal, pull); /* checked against differences in tests/unit/test_shape.c */
        for (int a = 0; a < 3; a++)
            p->pull[a] = (double)pull[a];
        m++;
    }
    double *A = malloc(sizeof *A * (m * m + 1)), *d = malloc(sizeof *d * (m + 1)), *p = malloc(sizeof *p * (m + 1));
    for (unsigned c = 0; c < m; c++) {
        d[c] = place[c].depth_m;
        for (unsigned e = 0; e <= c; e++) {
            double a = response(bank, &place[c], &place[e]);
            for (int b = 0; b < 3; b++)
                a += place[c].pull[b] * place[e].pull[b] / (double)bank->contact->coupling_stiffness_N_m;
            A[m * c + e] = A[m * e + c] = a;
        }
        A[m * c + c] +=
            (double)bank->contact->regularisation_m_N * 1e-3; /* more spheres, no softer: none of it is felt */
    }
    solve(m, A, d, p);
    memset(force_N, 0, 3 * sizeof *force_N);
    for (unsigned c = 0; c < m; c++) {
        pushing += p[c] > 0;
        for (int b = 0; b < 3; b++)
            force_N[b] += p[c] * place[c].pull[b];
    }
    free(place), free(A), free(d), free(p);
    return pushing;
}

static double distance(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

struct error {
    double mean, worst;
    unsigned contacts;
};

/* The controller's forces along the way, against the reference's; `truth` is filled in the first time. */
static struct error along(struct candidate *c, const struct scene_capsule *shaft, double truth[POSES][3], bool first)
{
    const double none[3] = {0};
    struct error e = {0};
    struct bench b = {.bank = c->view};
    double peak = 0;
    assert_int_equal(node_start(&b.node, &b.bank, 1, NULL, 0), STATUS_OK);
    const struct controller *own = &b.node.controller;
    bench_start(&b, 0, HIGHEST_rad, INSERTION_m);
    for (int n = 0; n < POSES; n++) {
        for (int i = 1; i <= TICKS; i++)
            bench_tick(&b, 0, HIGHEST_rad + (LOWEST_rad - HIGHEST_rad) * (n + (double)i / TICKS) / POSES, INSERTION_m);
        if (first) {
            unsigned pushing = reference(&b.bank, &own->instrument[0].kinematics, shaft, DENSE, truth[n]);
            double coarser[3];
            reference(&b.bank, &own->instrument[0].kinematics, shaft, DENSE / 2 + 1, coarser);
            print_message("# %.4f rad: %.4f N, %u push; half as many spheres: %.1e of it\n",
                          (double)own->instrument[0].kinematics.joint[1], distance(truth[n], none), pushing,
                          distance(truth[n], coarser) / (distance(truth[n], none) + 1e-12));
        }
        double f[3], off;
        for (int a = 0; a < 3; a++)
            f[a] = (double)own->contact.force_N[0][a];
        off = distance(f, truth[n]);
        peak = fmax(peak, distance(truth[n], none));
        e.mean += off / POSES;
        e.worst = fmax(e.worst, off);
        e.contacts = own->contact.count > e.contacts ? own->contact.count : e.contacts;
    }
    e.mean /= peak;
    e.worst /= peak;
    return e;
}

static void more_samples_are_nearer_to_the_capsule(void **state)
{
    (void)state;
    static const unsigned samples[] = {2, 4, 8, 16};
    struct scene *scene = malloc(sizeof *scene);
    struct failure why;
    char mesher[300], folder[] = "/tmp/trocar-samples-XXXXXX";
    snprintf(mesher, sizeof mesher, "%s/trocar-mesher", getenv("B") ? getenv("B") : "build");
    setenv("TROCAR_MESHER", mesher, 0);
    assert_non_null(mkdtemp(folder));
    assert_int_equal(scene_read("host/scenes/demo/shape.yaml", scene, &why), STATUS_OK);
    scene->effects.shape.jaws = false;
    struct setting setting = knob_scene(scene);
    setting.value[KNOB_STEP] = 0;
    setting.value[KNOB_POINTS] = 16;
    struct discretisation d;
    struct candidate c;
    if (discretise(scene, &setting, true, &d, &why) || candidate_make(&d, &setting, folder, 0, 1, true, &c, &why))
        fail_msg("%s", why.cause);
    double truth[POSES][3];
    struct error before = {0};
    for (size_t i = sizeof samples / sizeof *samples; i-- > 0;) {
        setting.value[KNOB_POINTS] = samples[i];
        assert_int_equal(candidate_retool(&c, &d.body, &setting, &why), STATUS_OK);
        struct error e = along(&c, &scene->effects.shape.shaft, truth, samples[i] == 16);
        print_message("# samples %u: force error mean %.2f %%, worst %.2f %%, %u touch\n", samples[i], 100 * e.mean,
                      100 * e.worst, e.contacts);
        assert_true(e.mean > before.mean && e.worst > before.worst);
        before = e;
    }
    candidate_free(&c);
    discretisation_free(&d);
    rmdir(folder);
    free(scene);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(more_samples_are_nearer_to_the_capsule),
    };
    return cmocka_run_group_tests_name("samples of a shape", tests, NULL, NULL);
}
