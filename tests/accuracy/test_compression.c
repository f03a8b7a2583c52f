/* The compression of a tissue cylinder [C97 3.4.2, figures 3.24 to 3.28] and what becomes of a correction off the line that it was fitted
 * to. Everything goes through the controller's tick; the truth is a neo-Hookean body: in closed form between plates, by non-linear
 * finite elements under the very contacts of the tick elsewhere. The table is printed, and drawn in $B/compression.svg.
 *
 *   linear         the bank alone
 *   P/Q            quasi_nonlinear
 *   second order   neo_hookean
 *
 * TROCAR_LONG=1: more sites and depths, and every line. */
#include "cylinder.h"
#include "plot.h"
#include "tick_press.h"

void openblas_set_num_threads(int threads); /* its header and GSL's do not agree */

static const struct cylinder SAMPLE = {
    0.013, 0.015, 4, 3, {1, 5, 10}}; /* Chinzei and Miller's, whom the thesis follows */
static const double E_Pa = 3000, NU = 0.45;

enum { LINEAR, PQ, SECOND_ORDER, WAYS };
static const char *const way_name[WAYS] = {"linear", "P/Q", "second order"};

static char folder[] = "/tmp/trocar-compression-XXXXXX";
static char table_path[100], mesh_path[100], fine_path[100];

/* 30 % of the height, as in figure 3.24. */
static void write_table(void)
{
    struct lame m = lame_from_young(E_Pa, NU);
    FILE *out = fopen(table_path, "w");
    assert_non_null(out);
    fprintf(out, "# a cylinder of %g mm and radius %g mm between plates that let it slip\n", 1e3 * SAMPLE.height_m,
            1e3 * SAMPLE.radius_m);
    fprintf(out, "depth [mm], force [mN], across [mm]\n");
    for (int k = 0; k <= 20; k++) {
        double force, across;
        cylinder_answer(&SAMPLE, m, 1 - 0.015 * k, &force, &across);
        fprintf(out, "%.9g, %.9g, %.9g\n", 15 * SAMPLE.height_m * k, 1e3 * force, 1e3 * across);
    }
    assert_int_equal(fclose(out), 0);
}

static int create(void **state)
{
    (void)state;
    assert_non_null(mkdtemp(folder));
    snprintf(table_path, sizeof table_path, "%s/curve.csv", folder);
    snprintf(mesh_path, sizeof mesh_path, "%s/cylinder.msh", folder);
    snprintf(fine_path, sizeof fine_path, "%s/fine.msh", folder);
    write_table();
    cylinder_write(&SAMPLE, mesh_path);
    struct cylinder fine = SAMPLE;
    fine.layers = 5;
    fine.rings = 4;
    memcpy(fine.on_ring, (int[4]){1, 6, 12, 18}, 4 * sizeof(int));
    cylinder_write(&fine, fine_path);
    return 0;
}

static int destroy(void **state)
{
    (void)state;
    unlink(table_path);
    unlink(mesh_path);
    unlink(fine_path);
    return rmdir(folder);
}

/* ---- what was measured, and where: kept for the drawing ---- */

struct place {
    char name[60];
    double depth, mean[WAYS], worst[WAYS]; /* depth in parts of the body's length; errors of the force */
    size_t within;                         /* lines on which the range of neo_hookean was kept, */
    double worst_within;                   /* and the worst error of second order there */
};
static struct place place[40];
static size_t places;

static void head(void)
{
    print_message("# error of the controller's force in %%, mean/worst; depth in %% of the body's length\n");
    print_message("# %-34s  depth", "");
    for (int way = 0; way < WAYS; way++)
        print_message("  %13s", way_name[way]);
    print_message("\n");
}

static const struct place *say(const char *name, double depth, const double (*error)[WAYS], const bool *good,
                               const bool *within, size_t lines)
{
    assert_true(places < sizeof place / sizeof *place);
    struct place *p = &place[places++];
    size_t counted = 0;
    *p = (struct place){.depth = depth};
    snprintf(p->name, sizeof p->name, "%s", name);
    for (size_t l = 0; l < lines; l++)
        counted += good[l];
    for (size_t l = 0; l < lines; l++)
        for (int way = 0; way < WAYS && good[l]; way++) {
            p->mean[way] += error[l][way] / (double)counted;
            p->worst[way] = fmax(p->worst[way], error[l][way]);
        }
    for (size_t l = 0; l < lines; l++)
        if (good[l] && within[l]) {
            p->within++;
            p->worst_within = fmax(p->worst_within, error[l][SECOND_ORDER]);
        }
    print_message("# %-34s %4.1f %%", name, 100 * depth);
    for (int way = 0; way < WAYS; way++)
        print_message("  %6.2f/%6.2f", 100 * p->mean[way], 100 * p->worst[way]);
    print_message("  (%zu lines, %zu within the range: %.2f)\n", counted, p->within, 100 * p->worst_within);
    return p;
}

/* ---- scenes ---- */

static const char *effect_of(int way, char *text, size_t size)
{
    if (way == PQ)
        snprintf(text, size, "{quasi_nonlinear: {fit: %s, height: %.9g m, radius: %.9g m}}", table_path,
                 SAMPLE.height_m, SAMPLE.radius_m);
    else
        snprintf(text, size, way == SECOND_ORDER ? "{neo_hookean: {}}" : "{}");
    return text;
}

static void open_way(struct tick_press *p, const char *mesh, const char *fixed, const char *order, int way,
                     double tool_radius_m, unsigned points)
{
    char text[2000], effect[500];
    snprintf(
        text, sizeof text,
        "scene: compression\nbody:\n  mesh: {file: %s%s}\n  materials: [{label: all, E: %.9g Pa, nu: %.9g, rho: 1060 "
        "kg/m3}]\n  fixed:\n%s\ninstruments: [{name: plate, tip: {radius: %.9g m, points: %u}}]\neffects: %s\n",
        mesh, order, E_Pa, NU, fixed, tool_radius_m, points, effect_of(way, effect, sizeof effect));
    tick_press_open(p, text);
}

static const char SLIPS[] = "    - {plane: {at: [0, 0, 0], normal: [0, 0, -1]}, components: [z]}\n"
                            "    - {sphere: {at: [0, 0, 0], radius: 0.1 mm}}\n"
                            "    - {box: {from: [0.001, -0.0001, 0], to: [1, 0.0001, 0]}, components: [y]}";

/* ---- between plates: the line of the fit ---- */

/* The upper plate: a point of the tool on every vertex of the top, whose normals are the plate's. */
static void become_plate(struct tick_press *p)
{
    double xy[200][2];
    struct bank_tool *tool = tick_press_tool(p);
    float *normals = (float *)p->bank.view.normals;
    tool->point_count = (uint32_t)cylinder_disc(&SAMPLE, xy);
    assert_true(tool->point_count <= BANK_MAX_TOOL_POINTS);
    for (uint32_t i = 0; i < tool->point_count; i++) { /* the instrument's axes are the world's y, x, -z */
        tool->point_m[i][0] = (float)(0.9999 * xy[i][1]);
        tool->point_m[i][1] = (float)(0.9999 * xy[i][0]);
        tool->point_m[i][2] = 0;
    }
    for (uint32_t v = 0; v < p->bank.view.vertex_count; v++)
        if ((double)p->bank.view.positions[3 * v + 2] > 0.999 * SAMPLE.height_m)
            memcpy(normals + 3 * v, (float[3]){0, 0, 1}, 3 * sizeof(float));
}

static void the_compression_is_reproduced(void **state)
{
    (void)state;
    enum { DEPTHS = 4 };
    const double share[DEPTHS] = {0.05, 0.1, 0.2, 0.3}, up[3] = {0, 0, SAMPLE.height_m}, down[3] = {0, 0, -1};
    struct lame m = lame_from_young(E_Pa, NU);
    double error[DEPTHS][WAYS], across[DEPTHS][2];
    for (int way = 0; way < WAYS; way++) {
        struct tick_press p;
        double last = -0.02;
        open_way(&p, mesh_path, SLIPS, ", unit: m, order: linear", way, SAMPLE.radius_m, 7);
        become_plate(&p);
        tick_press_begin(&p, up, down);
        for (int k = 0; k < DEPTHS; k++) {
            const struct contact_set *set = tick_press_to(&p, last, share[k] * SAMPLE.height_m);
            double force = (double)set->force_N[0][2], truth, bulge;
            double stretch =
                1 - (p.depth_m - force / (double)p.bank.view.contact->coupling_stiffness_N_m) / SAMPLE.height_m;
            last = share[k] * SAMPLE.height_m;
            assert_int_equal(set->count, 16);
            cylinder_answer(&SAMPLE, m, stretch, &truth, &bulge);
            error[k][way] = fabs(force - truth) / truth;
            if (way == PQ) { /* the bulge half way up, as it is shown */
                across[k][0] =
                    fabs(tick_press_bulge(&p, set, SAMPLE.height_m / 2, false) * SAMPLE.radius_m / bulge - 1);
                across[k][1] = fabs(tick_press_bulge(&p, set, SAMPLE.height_m / 2, true) * SAMPLE.radius_m / bulge - 1);
            }
        }
        tick_press_close(&p);
    }
    head();
    for (int k = 0; k < DEPTHS; k++) {
        say("cylinder between plates", share[k], (const double(*)[WAYS])error[k], &(bool){true}, &(bool){false}, 1);
        print_message("#   growth of its radius: %.2f %% off without P, %.2f %% with it\n", 100 * across[k][0],
                      100 * across[k][1]);
        /* residual of the fit, 0.5 % of the largest value, which is 0.3 / share of this one; epsilon, 1e-3 of the compliance */
        assert_true(error[k][PQ] < 0.005 * 0.3 / share[k] + 0.005);
        assert_true(across[k][1] < 0.005 * 0.3 / share[k] + 0.005);
        assert_true(error[k][PQ] < error[k][LINEAR] && across[k][1] < across[k][0]);
    }
}

/* ---- off the line ---- */

static bool off_line(struct tick_press *p, double *linear, double *corrected)
{
    const struct contact_set *set = &p->controller.contact;
    double truth[3], e = 0, f = 0;
    const float *now = set->force_N[0];
    const float *before =
        p->bank.view.neo_hookean ? p->controller.neo_hookean.linear_N[0] : p->controller.quasi_nonlinear.linear_N[0];
    for (int k = 0; k < 2; k++) {
        double *error = k ? linear : corrected;
        const float *force = k ? before : now;
        if (!error)
            continue;
        if (set->count == 0 || !tick_press_truth(p, set, force, truth))
            return false;
        e = f = 0;
        for (int a = 0; a < 3; a++) {
            e += pow((double)force[a] - truth[a], 2);
            f += truth[a] * truth[a];
        }
        *error = sqrt(e / f);
    }
    return true;
}

struct line {
    double site_m[3], direction[3];
};

/* A line counts where the truth has an equilibrium under the same contacts for all ways. */
static void press_lines(const char *name, const char *mesh, const char *fixed, const char *order, double tool_radius_m,
                        const struct line *line, size_t lines, double length_m, const double *share, size_t depths,
                        const struct place **said)
{
    static double error[3][64][WAYS];
    static bool good[3][64], within[3][64];
    assert_true(depths <= 3 && lines <= 64);
    memset(good, 1, sizeof good);
    for (int way = PQ; way < WAYS; way++) {
        struct tick_press p;
        open_way(&p, mesh, fixed, order, way, tool_radius_m, 16);
        for (size_t l = 0; l < lines; l++) {
            double last = -0.02;
            tick_press_begin(&p, line[l].site_m, line[l].direction);
            for (size_t k = 0; k < depths; k++) {
                tick_press_to(&p, last, share[k] * length_m);
                last = share[k] * length_m;
                good[k][l] =
                    good[k][l] && off_line(&p, way == SECOND_ORDER ? &error[k][l][LINEAR] : NULL, &error[k][l][way]);
                within[k][l] = way == SECOND_ORDER && p.controller.neo_hookean.beyond == 0;
            }
            if (way == SECOND_ORDER && getenv("TROCAR_LONG"))
                print_message("#   line %zu: %s linear %.2f %%, P/Q %.2f %%, second order %.2f %%, %u ticks beyond\n",
                              l, good[depths - 1][l] ? "" : "not counted", 100 * error[depths - 1][l][LINEAR],
                              100 * error[depths - 1][l][PQ], 100 * error[depths - 1][l][SECOND_ORDER],
                              p.controller.neo_hookean.beyond);
        }
        tick_press_close(&p);
    }
    for (size_t k = 0; k < depths; k++)
        said[k] = say(name, share[k], (const double(*)[WAYS])error[k], good[k], within[k], lines);
}

/* Around the normal n: straight in, and 30 degrees to four sides. */
static void lines_around(const double site_m[3], const double normal[3], struct line *line)
{
    double x[3], y[3], size = 0;
    int least = fabs(normal[0]) < fabs(normal[1]) ? (fabs(normal[0]) < fabs(normal[2]) ? 0 : 2)
                                                  : (fabs(normal[1]) < fabs(normal[2]) ? 1 : 2);
    for (int a = 0; a < 3; a++)
        x[a] = (a == least) - normal[least] * normal[a];
    for (int a = 0; a < 3; a++)
        size += x[a] * x[a];
    for (int a = 0; a < 3; a++)
        x[a] /= sqrt(size);
    for (int a = 0; a < 3; a++)
        y[a] = normal[(a + 1) % 3] * x[(a + 2) % 3] - normal[(a + 2) % 3] * x[(a + 1) % 3];
    for (int k = 0; k < 5; k++)
        for (int a = 0; a < 3; a++) {
            double turn = k == 0 ? 0 : acos(-1) / 6, side = k < 3 ? (k == 1 ? x[a] : -x[a]) : (k == 3 ? y[a] : -y[a]);
            line[k].site_m[a] = site_m[a];
            line[k].direction[a] = -cos(turn) * normal[a] + sin(turn) * side;
        }
}

static void the_same_cylinder_under_a_tool(void **state)
{
    (void)state;
    const double share[1] = {0.1}, up[3] = {0, 0, 1}, site[3] = {0.004, 0.002, 0.013};
    struct line line[5];
    const struct place *said[1];
    lines_around(site, up, line);
    press_lines("cylinder under a ball of 5 mm", fine_path, "    - {plane: {at: [0, 0, 0], normal: [0, 0, -1]}}",
                ", unit: m", 0.005, line, 5, SAMPLE.height_m, share, 1, said);
    assert_true(said[0]->mean[PQ] > said[0]->mean[LINEAR]); /* a curve knows nothing of another tool */
    assert_true(said[0]->mean[SECOND_ORDER] < said[0]->mean[LINEAR]);
}

static void an_organ_pressed_from_all_sides(void **state)
{
    (void)state;
    enum { SITES = 2, SITES_LONG = 8 };
    const double share[2] = {0.02, 0.05}, radius = 0.01;
    const char *data = getenv("TROCAR_DATA");
    char path[1000], *real;
    snprintf(path, sizeof path, "%s/liver_smooth_412_1336.msh", data ? data : "../shared/data");
    if (!(real = realpath(path, NULL))) {
        print_message("# %s is not there: not measured\n", path);
        skip();
    }
    static const char fixed[] = "    - {patch: {near: [-1, 0, 0], share: 6 %}}";
    struct tick_press p;
    struct line line[5 * SITES_LONG];
    uint64_t seed = 7;
    size_t sites = getenv("TROCAR_LONG") ? SITES_LONG : SITES, found = 0;
    open_way(&p, real, fixed, ", extent: 0.13 m", LINEAR, radius, 16);
    while (found < sites) {
        uint32_t t = (uint32_t)(draw(&seed) * (double)p.body.surface.triangle_count);
        double at[3] = {0}, normal[3] = {0}, size = 0;
        for (int k = 0; k < 9; k++) {
            uint32_t v = p.body.surface.triangles[3 * t + (uint32_t)(k / 3)];
            at[k % 3] += p.body.mesh.nodes[3 * (size_t)p.body.surface.node[v] + (size_t)(k % 3)] / 3;
            normal[k % 3] += p.body.surface.normals[3 * (size_t)v + (size_t)(k % 3)];
        }
        if (at[0] < -0.03) /* not at the clamp */
            continue;
        for (int a = 0; a < 3; a++)
            size += normal[a] * normal[a];
        for (int a = 0; a < 3; a++)
            normal[a] /= sqrt(size);
        lines_around(at, normal, line + 5 * found);
        found++;
    }
    tick_press_close(&p);
    const struct place *said[2];
    size_t depths = getenv("TROCAR_LONG") ? 2 : 1;
    press_lines("organ of 0.13 m under a ball of 10 mm", real, fixed, ", extent: 0.13 m", radius, line, 5 * sites, 0.13,
                share + 2 - depths, depths, said);
    free(real);
    for (size_t k = 0; k < depths; k++) {
        assert_true(said[k]->mean[SECOND_ORDER] < said[k]->mean[LINEAR] / 2);
        assert_true(said[k]->within >= 5 && said[k]->worst_within < 0.02); /* the aim, in any direction */
    }
}

/* ---- the drawing ---- */

static void the_errors_are_drawn(void **state)
{
    (void)state;
    struct plot_mark *marks = room(places * WAYS * sizeof *marks);
    char path[300];
    const char *build = getenv("B");
    size_t count = 0;
    for (int way = 0; way < WAYS; way++)
        for (size_t k = 0; k < places; k++) {
            struct plot_mark *m = &marks[count++];
            m->x = place[k].depth;
            m->y = place[k].mean[way];
            m->series = 1 + way;
            snprintf(m->title, sizeof m->title, "%.60s, %.20s: %.2f %%", place[k].name, way_name[way], 100 * m->y);
        }
    struct plot plot = {.title = "error of the controller's force against a neo-Hookean body",
                        .x = {.label = "depth, in parts of the body's length", .unit = PLOT_PERCENT},
                        .y = {.label = "mean error of the force", .unit = PLOT_PERCENT},
                        .count = count,
                        .mark = marks};
    for (int way = 0; way < WAYS; way++)
        plot.series[1 + way] = way_name[way];
    snprintf(path, sizeof path, "%.250s/compression.svg", build ? build : "build");
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    assert_true(plot_scale(&plot));
    plot_svg(out, &plot, true);
    assert_int_equal(fclose(out), 0);
    print_message("# drawn in %s\n", path);
    free(marks);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    openblas_set_num_threads(1); /* small factors: threads would wait for each other */
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_compression_is_reproduced),
        cmocka_unit_test(the_same_cylinder_under_a_tool),
        cmocka_unit_test(an_organ_pressed_from_all_sides),
        cmocka_unit_test(the_errors_are_drawn),
    };
    return cmocka_run_group_tests(tests, create, destroy);
}
