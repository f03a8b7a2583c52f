/* make bench: how long the compliance takes, on one thread and on two, beside the two obvious ways in the same run:
 *   solves  factor K with CHOLMOD, then a solve for each of the 3 N columns, one after the other
 *   CG      conjugate gradients for each column, preconditioned with the diagonal, until the residual is 1e-6 of the load
 *           [the thesis' way, 3.5 hours for its liver]
 * A column costs the same wherever it is: of these, some are timed (solves 48, CG 3) and their mean is taken times 3 N.
 * Each mesh and order is a process of its own, whose most memory is read before the other ways begin. The cylinder has the
 * size of the thesis' liver (1528 nodes, 7342 tetrahedra). TROCAR_LONG=1 adds the liver of 29596 tetrahedra. */
#include <cblas.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>

#include <unistd.h>

#include "../accuracy/specimen.h"
#include "model_state.h"

static void find_column(struct specimen *s, const struct compliance *c, size_t number, size_t count, uint32_t *vertex,
                        int *component)
{
    size_t row = (2 * number + 1) * c->rows / (2 * count);
    *component = (int)(number % 3);
    for (uint32_t v = 0; v < s->surface.vertex_count; v++)
        if (c->row_of[v] == row)
            *vertex = v;
}

/* K u = f from u = 0; returns the number of steps. */
static size_t conjugate_gradients(struct specimen *s, const double *diagonal, const double *f, double *u)
{
    size_t n = model_unknowns(s->model), steps = 0;
    double *r = room(n * sizeof *r), *z = room(n * sizeof *z), *d = room(n * sizeof *d), *Kd = room(n * sizeof *Kd);
    double load = cblas_dnrm2((int)n, f, 1), rz = 0;
    memset(u, 0, n * sizeof *u);
    memcpy(r, f, n * sizeof *r);
    for (size_t i = 0; i < n; i++)
        z[i] = d[i] = r[i] / diagonal[i];
    rz = cblas_ddot((int)n, r, 1, z, 1);
    while (cblas_dnrm2((int)n, r, 1) > 1e-6 * load && steps < 20 * n) {
        model_multiply(s->model, d, Kd);
        double step = rz / cblas_ddot((int)n, d, 1, Kd, 1), before = rz;
        cblas_daxpy((int)n, step, d, 1, u, 1);
        cblas_daxpy((int)n, -step, Kd, 1, r, 1);
        for (size_t i = 0; i < n; i++)
            z[i] = r[i] / diagonal[i];
        rz = cblas_ddot((int)n, r, 1, z, 1);
        for (size_t i = 0; i < n; i++)
            d[i] = z[i] + rz / before * d[i];
        steps++;
    }
    free(r);
    free(z);
    free(d);
    free(Kd);
    return steps;
}

/* Largest difference between a column of G and a displacement, of the largest entry. */
static double difference(struct specimen *s, const struct compliance *c, uint32_t vertex, int component,
                         const double *u)
{
    double worst = 0, top = 0;
    size_t ld = 3 * c->rows, j = 3 * c->row_of[vertex] + (size_t)component;
    for (uint32_t v = 0; v < s->surface.vertex_count; v++)
        for (int a = 0; a < 3 && c->row_of[v] != UINT32_MAX; a++) {
            size_t i = 3 * c->row_of[v] + (size_t)a;
            double solved = model_displacement(s->model, v, a, u), built = i > j ? c->G[i + j * ld] : c->G[j + i * ld];
            worst = fmax(worst, fabs(solved - built));
            top = fmax(top, fabs(solved));
        }
    return worst / top;
}

static double processor_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void others(struct specimen *s, const struct compliance *c, double ours_s)
{
    enum { SOLVES = 48, ITERATED = 3 };
    struct failure why;
    size_t n = model_unknowns(s->model), steps = 0;
    double *f = room(n * sizeof *f), *u = room(n * sizeof *u), *diagonal = room(n * sizeof *diagonal);
    double begin = processor_s(), worst_solve = 0, worst_cg = 0, solve_s = 0, cg_s = 0;
    must(model_solve(s->model, 1, f, u, &why), &why); /* a load of nothing: the factor */
    double factor_s = processor_s() - begin;
    for (size_t k = 0; k < SOLVES; k++) {
        uint32_t vertex = 0;
        int component;
        find_column(s, c, k, SOLVES, &vertex, &component);
        memset(f, 0, n * sizeof *f);
        model_load(s->model, vertex, component, 1, f);
        begin = processor_s();
        must(model_solve(s->model, 1, f, u, &why), &why);
        solve_s += (processor_s() - begin) / SOLVES;
        worst_solve = fmax(worst_solve, difference(s, c, vertex, component, u));
    }
    for (size_t i = 0; i < n; i++)
        diagonal[i] = ((const double *)s->model->K->x)[((const int32_t *)s->model->K->p)[i]]; /* it leads its column */
    for (size_t k = 0; k < ITERATED; k++) {
        uint32_t vertex = 0;
        int component;
        find_column(s, c, k, ITERATED, &vertex, &component);
        memset(f, 0, n * sizeof *f);
        model_load(s->model, vertex, component, 1, f);
        begin = processor_s();
        steps += conjugate_gradients(s, diagonal, f, u) / ITERATED;
        cg_s += (processor_s() - begin) / ITERATED;
        worst_cg = fmax(worst_cg, difference(s, c, vertex, component, u));
    }
    double columns = 3 * (double)c->rows, loop = factor_s + columns * solve_s, iterated = columns * cg_s;
    printf("    solves  %8.1f s  %6.1f times as long (factor %.2f s, column %.1f ms; differs by %.0e)\n", loop,
           loop / ours_s, factor_s, 1e3 * solve_s, worst_solve);
    printf("    CG      %8.1f s  %6.1f times as long (%zu steps, column %.1f ms; differs by %.0e)\n", iterated,
           iterated / ours_s, steps, 1e3 * cg_s, worst_cg);
    free(f);
    free(u);
    free(diagonal);
}

static void bench(const char *name, enum element_order order)
{
    struct failure why;
    struct specimen s;
    struct compliance c = {0};
    if (!specimen_data(&s, name, 0.45))
        return;
    s.scene.order = order;
    must(mesh_surface(&s.mesh, &s.surface, &why), &why);
    double wall[2], processor[2];
    for (int threads = 2; threads >= 1; threads--) {
        openblas_set_num_threads(threads);
        compliance_free(&c);
        model_free(s.model);
        s.model = NULL;
        double begin = seconds_now(), begin_processor = processor_s();
        must(model_create(&s.scene, &s.mesh, &s.surface, &s.model, &why), &why);
        must(compliance_build(s.model, true, &c, &why), &why);
        wall[threads - 1] = seconds_now() - begin;
        processor[threads - 1] = processor_s() - begin_processor;
    }
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    printf("%s, %s: %zu unknowns, %zu columns\n    ours    %8.2f s on one thread; on two %.2f s by the clock, %.2f s "
           "of processor; %.0f MB at most\n",
           name, model_discretisation(s.model), model_unknowns(s.model), 3 * c.rows, processor[0], wall[1],
           processor[1], (double)used.ru_maxrss / 1024);
    fflush(stdout);
    others(&s, &c, processor[0]);
    compliance_free(&c);
    specimen_free(&s);
}

static void bench_apart(const char *name, enum element_order order)
{
    fflush(stdout);
    pid_t child = fork();
    if (child == 0) {
        bench(name, order);
        fflush(stdout);
        _exit(0);
    }
    int status;
    if (child < 0 || waitpid(child, &status, 0) != child || status != 0)
        printf("%s: the bench did not end well\n", name);
}

int main(void)
{
    static const char *const names[] = {"cylinder_8x30x6.msh", "liver_smooth_1665_6691.msh",
                                        "liver_smooth_6267_29596.msh"};
    cmocka_set_message_output(CM_OUTPUT_TAP);
    puts("Compliance of the surface from the mesh: assembly, order, elimination. Processor time of one\n"
         "thread, so that a busy machine does not count.");
    for (size_t k = 0; k < (getenv("TROCAR_LONG") ? 3 : 2); k++)
        for (int order = 0; order < 2; order++)
            bench_apart(names[k], order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR);
    return 0;
}
