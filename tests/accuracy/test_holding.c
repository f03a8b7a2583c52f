/* Nodes that are fixed along an oblique direction and slide across it, against closed forms and against the same body turned so that
 * the direction is a component.
 *
 * What holds is a spring HOLDING_SLIDE_STIFFNESS times as stiff as the tissue around a node, so it gives way by a ten-millionth of
 * what the tissue would move under the same force, which is at most what the body moves times the few nodes that share its load:
 * WITHIN. */
#include "holding.h"
#include "model_state.h"
#include "specimen.h"

static const double WITHIN = 10 / HOLDING_SLIDE_STIFFNESS;
static const double E_Pa = 4000, NU = 0.3, LENGTH_m = 0.3, WIDTH_m = 0.1;

/* Rows: the directions in the world of the bar's own axes. */
static const double oblique[3][3] = {
    {0.48, 0.6, 0.64}, {-0.8, 0.6, 0}, {-0.384, -0.512, 0.768}}; /* the last is made square to the others below */

static void axes(double a[3][3])
{
    memcpy(a, oblique, sizeof oblique);
    for (int i = 0; i < 3; i++) /* Gram-Schmidt */
        for (int j = 0; j <= i; j++) {
            double dot = 0;
            for (int k = 0; k < 3; k++)
                dot += a[i][k] * a[j][k];
            for (int k = 0; k < 3; k++)
                a[i][k] = j == i ? a[i][k] / sqrt(dot) : a[i][k] - dot * a[j][k];
        }
}

static void turn(double a[3][3], const double local[3], double world[3])
{
    for (int k = 0; k < 3; k++)
        world[k] = local[0] * a[0][k] + local[1] * a[1][k] + local[2] * a[2][k];
}

static void block(struct specimen *s, enum element_order order, double a[3][3])
{
    uint64_t seed = 7;
    specimen_block(s, 6, 2, 2, LENGTH_m, WIDTH_m, WIDTH_m);
    specimen_shake(s, 0.2, 0.05, &seed);
    for (size_t n = 0; n < s->mesh.node_count; n++) {
        double local[3];
        memcpy(local, s->mesh.nodes + 3 * n, sizeof local);
        turn(a, local, s->mesh.nodes + 3 * n);
    }
    specimen_material(s, "all", E_Pa, NU);
    s->scene.order = order;
}

/* Where the bar's own coordinate `axis` is at least (`side` 1) or at most (-1) `value`. */
static struct scene_fixed *fix(struct specimen *s, double a[3][3], int axis, double side, double value)
{
    struct scene_fixed *fixed = &s->scene.fixed[s->scene.fixed_count++];
    fixed->where.kind = SELECT_PLANE;
    for (int k = 0; k < 3; k++) {
        fixed->where.a[k] = value * a[axis][k];
        fixed->where.b[k] = side * a[axis][k];
    }
    return fixed;
}

static void let_slide(struct scene_fixed *fixed, const double along[3])
{
    fixed->slides = true;
    memcpy(fixed->along, along, sizeof fixed->along);
}

static double node_position(const struct specimen *s, size_t node, int c)
{
    uint32_t ends[2];
    space_ends(&s->model->space, node, ends);
    return (s->mesh.nodes[3 * ends[0] + (uint32_t)c] + s->mesh.nodes[3 * ends[1] + (uint32_t)c]) / 2;
}

/* Forces of a uniform traction on the surface triangles whose own coordinate 0 is LENGTH_m: on a linear triangle a third to
 * each corner, on a quadratic one a third to each middle. */
static void pull(const struct specimen *s, double a[3][3], const double traction_Pa[3], double *f)
{
    for (size_t t = 0; t < s->surface.triangle_count; t++) {
        uint32_t node[3];
        double x[3][3], cross[3];
        bool on = true;
        for (size_t k = 0; k < 3; k++) {
            node[k] = s->surface.node[s->surface.triangles[3 * t + k]];
            memcpy(x[k], s->mesh.nodes + 3 * (size_t)node[k], sizeof x[k]);
            on = on && fabs(x[k][0] * a[0][0] + x[k][1] * a[0][1] + x[k][2] * a[0][2] - LENGTH_m) < 1e-9;
        }
        for (int c = 0; c < 3; c++) {
            int p = (c + 1) % 3, q = (c + 2) % 3;
            cross[c] = (x[1][p] - x[0][p]) * (x[2][q] - x[0][q]) - (x[1][q] - x[0][q]) * (x[2][p] - x[0][p]);
        }
        double area = sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]) / 2;
        for (int k = 0; k < 3 && on; k++) {
            size_t at =
                s->scene.order == ELEMENT_LINEAR ? node[k] : space_middle(&s->model->space, node[k], node[(k + 1) % 3]);
            for (int c = 0; c < 3; c++) {
                int32_t unknown = model_unknown(s->model, at, c);
                if (unknown >= 0)
                    f[unknown] += traction_Pa[c] * area / 3;
            }
        }
    }
}

/* Displacements, 3 per node of the space. */
static double *solve(struct specimen *s, double a[3][3], const double traction_Pa[3])
{
    size_t n = model_unknowns(s->model), nodes = s->model->space.node_count;
    double *f = room(n * sizeof *f), *u = room(n * sizeof *u), *displacement = room(3 * nodes * sizeof *u);
    struct failure why;
    pull(s, a, traction_Pa, f);
    must(model_solve(s->model, 1, f, u, &why), &why);
    for (size_t i = 0; i < 3 * nodes; i++) {
        int32_t unknown = model_unknown(s->model, i / 3, (int)(i % 3));
        displacement[i] = unknown >= 0 ? u[unknown] : 0;
    }
    free(f);
    free(u);
    return displacement;
}

/* Three faces on rollers square to each other, all oblique, and a pull along the bar: s/E of stretch along it, -nu of that across. */
static void a_bar_on_oblique_rollers_stretches_as_by_hooke(void **state)
{
    (void)state;
    for (int order = 0; order < 2; order++) {
        struct specimen s;
        double a[3][3], traction_Pa[3], worst = 0;
        const double stress_Pa = 100, strain = stress_Pa / E_Pa;
        axes(a);
        block(&s, order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR, a);
        for (int axis = 0; axis < 3; axis++)
            let_slide(fix(&s, a, axis, -1, 0), a[axis]);
        specimen_model(&s);
        turn(a, (double[3]){stress_Pa, 0, 0}, traction_Pa);
        double *u = solve(&s, a, traction_Pa);
        for (size_t n = 0; n < s.model->space.node_count; n++) {
            double local[3] = {0}, expected[3];
            for (int i = 0; i < 3; i++)
                for (int c = 0; c < 3; c++)
                    local[i] += (i ? -NU : 1) * strain * a[i][c] * node_position(&s, n, c);
            turn(a, local, expected);
            for (size_t c = 0; c < 3; c++)
                worst = fmax(worst, fabs(u[3 * n + c] - expected[c]));
        }
        printf("# %s: off by %.1e of the bar's stretch\n", order ? "P2" : "P1", worst / (strain * LENGTH_m));
        assert_true(worst < WITHIN * strain * LENGTH_m);
        free(u);
        specimen_free(&s);
    }
}

/* One end held, the other on a plane across (1, 1, 0)/sqrt 2 of the bar's own axes, pulled sideways. */
static void an_oblique_plane_is_a_component_of_the_turned_body(void **state)
{
    (void)state;
    const double r = sqrt(0.5), straight[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                 turned[3][3] = {{r, -r, 0}, {r, r, 0}, {0, 0, 1}};
    for (int order = 0; order < 2; order++) {
        struct specimen s[2];
        double *u[2], worst = 0, top = 0;
        for (int which = 0; which < 2; which++) {
            double a[3][3], traction_Pa[3];
            memcpy(a, which ? turned : straight, sizeof a);
            block(&s[which], order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR, a);
            struct scene_fixed *held = fix(&s[which], a, 0, -1, 0), *plane = fix(&s[which], a, 0, 1, LENGTH_m);
            memset(held->component, true, sizeof held->component);
            if (which) /* there (1, 1, 0)/sqrt 2 is x */
                plane->component[0] = true;
            else
                let_slide(plane, (double[3]){r, r, 0});
            specimen_model(&s[which]);
            turn(a, (double[3]){30, 50, -20}, traction_Pa);
            u[which] = solve(&s[which], a, traction_Pa);
        }
        double a[3][3];
        memcpy(a, turned, sizeof a);
        for (size_t n = 0; n < s[0].model->space.node_count; n++) {
            double expected[3];
            turn(a, u[0] + 3 * n, expected);
            for (size_t c = 0; c < 3; c++) {
                worst = fmax(worst, fabs(u[1][3 * n + c] - expected[c]));
                top = fmax(top, fabs(expected[c]));
            }
        }
        printf("# %s: off by %.1e of the largest displacement\n", order ? "P2" : "P1", worst / top);
        assert_true(worst < WITHIN * top);
        for (int which = 0; which < 2; which++) {
            free(u[which]);
            specimen_free(&s[which]);
        }
    }
}

/* Only what is along the plane's normal is held: the free motions are named. */
static void a_body_that_can_slide_away_is_refused(void **state)
{
    (void)state;
    struct specimen s;
    struct failure why;
    double a[3][3];
    axes(a);
    block(&s, ELEMENT_LINEAR, a);
    let_slide(fix(&s, a, 0, -1, 0), a[0]);
    assert_int_equal(specimen_try(&s, &why), STATUS_MODEL_FREE_MOTION);
    specimen_free(&s);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bar_on_oblique_rollers_stretches_as_by_hooke),
        cmocka_unit_test(an_oblique_plane_is_a_component_of_the_turned_body),
        cmocka_unit_test(a_body_that_can_slide_away_is_refused),
    };
    return cmocka_run_group_tests_name("holding", tests, NULL, NULL);
}
