/* The judgement of a trade on synthetic points: fronts against their definition, picks against a search by hand, plans and
 * refinement against counting. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "knob.h"
#include "pareto.h"
#include "plot.h"
#include "random.h"
#include "refine.h"
#include "report.h"
#include "tradeoff.h"

static void a_known_front_is_found(void **state)
{
    (void)state;
    const double cost[] = {1, 2, 2, 3, 4, 5, 5, NAN, 6, INFINITY};
    const double error[] = {9, 7, 8, 7, 3, 3, 3, 1, NAN, 0};
    const bool want[] = {true, true, false, false, true, false, false, false, false, false};
    bool front[10];
    pareto_front(10, cost, error, front);
    assert_memory_equal(front, want, sizeof want);
}

static void nothing_beats_the_front_and_all_else_is_beaten(void **state)
{
    (void)state;
    random_seed("points", 40);
    for (int n = 0; n < 500; n++) {
        enum { MOST = 40 };
        double cost[MOST], error[MOST];
        bool front[MOST];
        unsigned count = 1 + random_below(MOST);
        for (unsigned i = 0; i < count; i++) { /* few values, so that ties occur */
            cost[i] = 1 + random_below(12);
            error[i] = random_below(12);
        }
        pareto_front(count, cost, error, front);
        for (unsigned i = 0; i < count; i++) {
            bool as_good = false; /* something on the front is at least as good in both */
            for (unsigned j = 0; j < count; j++) {
                bool no_worse = cost[j] <= cost[i] && error[j] <= error[i];
                as_good |= front[j] && j != i && no_worse;
                if (front[i] && j != i && no_worse)
                    assert_true(cost[j] == cost[i] && error[j] == error[i] && !front[j]);
            }
            assert_true(front[i] != as_good);
        }
    }
}

static void the_pick_within_a_limit_is_the_best_that_fits(void **state)
{
    (void)state;
    const double cost[] = {10, 20, 20, 30}, error[] = {5, 2, 2, NAN};
    assert_int_equal(pareto_within(4, cost, error, 9.9), 4); /* none */
    assert_int_equal(pareto_within(4, cost, error, 10), 0);
    assert_int_equal(pareto_within(4, cost, error, 25), 1);
    assert_int_equal(pareto_within(4, cost, error, 1e9), 1);
}

static void judging_marks_fronts_and_advises_what_fits(void **state)
{
    (void)state;
    struct failure why = {0};
    struct tradeoff r = {.instructions_known = true, .points = 3, .point = calloc(3, sizeof *r.point)};
    const double bytes[] = {200 * 1024, 700 * 1024, 900 * 1024}, patch[] = {0.02, 0.004, 0.006};
    const double load[] = {90e3, 15e3, 400e3}, ticks[] = {0.01, 0.03, 0.001};
    for (int i = 0; i < 3; i++) {
        snprintf(r.point[i].name, sizeof r.point[i].name, "setting %c", 'A' + i);
        r.point[i].bytes = bytes[i];
        r.point[i].bank[COMPRESSION_ERROR_PATCH].p95 = patch[i];
        r.point[i].load_max = load[i];
        r.point[i].tick_p95 = ticks[i];
    }
    assert_int_equal(tradeoff_judge(&r, &why), STATUS_OK);
    assert_true(r.point[0].front_bytes && r.point[1].front_bytes && !r.point[2].front_bytes);
    assert_true(r.point[0].front_time && r.point[1].front_time && r.point[2].front_time);
    for (size_t k = 0; k < r.advices; k++) {
        const struct tradeoff_advice *a = &r.advice[k];
        const double *cost = a->of == BUDGET_BYTES ? bytes : load, *error = a->of == BUDGET_BYTES ? patch : ticks;
        size_t want = 3;
        for (size_t i = 0; i < 3; i++)
            if (cost[i] <= a->limit && (want == 3 || error[i] < error[want]))
                want = i;
        assert_int_equal(a->pick, want);
        assert_non_null(strstr(a->text, want == 3 ? "nothing that was measured fits" : r.point[want].name));
    }
    assert_true(r.advices >= 8);
    tradeoff_free(&r);
}

/* Against the definition in advice.c, by trying every setting. */
static void the_scenes_budget_is_honoured(void **state)
{
    (void)state;
    struct failure why = {0};
    random_seed("budgets", 41);
    for (int n = 0; n < 300; n++) {
        enum { COUNT = 8 };
        struct tradeoff r = {.points = COUNT, .point = calloc(COUNT, sizeof *r.point)};
        unsigned limited = random_below(8);
        r.budget_bytes = limited & 1 ? 1000 * (1 + random_below(9)) : 0;
        r.budget_instructions = limited & 2 ? 1000 * (1 + random_below(9)) : 0;
        r.budget_force_error = limited & 4 ? 0.001 * (1 + random_below(9)) : 0;
        size_t want = COUNT;
        for (size_t i = 0; i < COUNT; i++) {
            struct tradeoff_point *p = &r.point[i];
            snprintf(p->name, sizeof p->name, "setting %c", (char)('A' + (char)i));
            p->bytes = 1000 * (1 + random_below(9)) + (unsigned)i;
            p->worst_bound = 1000 * (1 + random_below(9));
            p->bank[COMPRESSION_ERROR_PATCH].p95 = 0.001 * (1 + random_below(9)) + 1e-7 * (double)i;
            bool kept = (!(limited & 1) || p->bytes <= r.budget_bytes) &&
                        (!(limited & 2) || p->worst_bound <= r.budget_instructions) &&
                        (!(limited & 4) || p->bank[COMPRESSION_ERROR_PATCH].p95 <= r.budget_force_error);
            bool smallest = (limited & 4) && !(limited & 1);
            if (kept && (want == COUNT || (smallest ? p->bytes < r.point[want].bytes
                                                    : p->bank[COMPRESSION_ERROR_PATCH].p95 <
                                                          r.point[want].bank[COMPRESSION_ERROR_PATCH].p95)))
                want = i;
        }
        assert_int_equal(tradeoff_judge(&r, &why), STATUS_OK);
        assert_true((r.advice[0].of == BUDGET_SCENE) == (limited != 0));
        if (limited) {
            assert_int_equal(r.advice[0].pick, want);
            assert_non_null(strstr(r.advice[0].text, want == COUNT ? "nothing that was measured" : r.point[want].name));
        }
        tradeoff_free(&r);
    }
}

static void every_setting_of_a_plan_is_there_once_and_neighbours_share_what_they_can(void **state)
{
    (void)state;
    struct scene *scene = calloc(1, sizeof *scene);
    struct failure why = {0};
    scene_assume("a.msh", 0.2, MESH_UNIT_NONE, scene);
    for (int form = 0; form < 4; form++) {
        bool quick = form & 1;
        scene->effects.named = form & 2 ? EFFECT_FRICTION : 0;
        scene->effects.friction.sweeps = 10;
        struct setting base = knob_scene(scene);
        struct plan plan;
        assert_true(knob_acts(KNOB_SWEEPS, &base) == (form >= 2) && knob_acts(KNOB_STEPS, &base) == (form < 2));
        assert_int_equal(plan_make(&base, quick, &plan, &why), STATUS_OK);
        assert_true(knob_differ(&plan.setting[0], &base) > STAGE_CONTROLLER);
        for (size_t i = 0; i < plan.count; i++)
            for (size_t j = 0; j < i; j++)
                assert_true(knob_differ(&plan.setting[i], &plan.setting[j]) <= STAGE_CONTROLLER);
        for (int k = 0; k < KNOBS; k++) { /* each value of each knob, alone */
            const struct knob_info *knob = &knob_table[k];
            for (size_t v = 0; knob_acts((enum knob)k, &base) && v < (quick ? knob->quick : knob->full); v++) {
                struct setting one = base;
                one.value[k] = knob->value[v];
                bool found = false;
                for (size_t i = 0; i < plan.count; i++)
                    found |= knob_differ(&plan.setting[i], &one) > STAGE_CONTROLLER;
                assert_true(found);
            }
        }
        for (int stage = STAGE_BODY; stage <= STAGE_BANK; stage++) /* once left, what is shared does not come back */
            for (size_t i = 1; i < plan.count; i++)
                for (size_t j = i; j < plan.count && knob_differ(&plan.setting[i - 1], &plan.setting[i]) <= stage; j++)
                    assert_true(knob_differ(&plan.setting[i - 1], &plan.setting[j]) <= stage);
        plan_free(&plan);
    }
    free(scene);
}

static void axes_hold_all_marks_and_ticks_rise(void **state)
{
    (void)state;
    random_seed("axes", 41);
    for (int n = 0; n < 300; n++) {
        struct plot_mark mark[5];
        struct plot plot = {.title = "t",
                            .x = {.label = "x", .unit = n % 2 ? PLOT_BYTES : PLOT_NUMBER},
                            .y = {.label = "y", .unit = PLOT_PERCENT},
                            .count = 5,
                            .mark = mark};
        double spread = random_range(0, 6);
        for (int i = 0; i < 5; i++)
            mark[i] = (struct plot_mark){.x = 1e3 * pow(10, random_range(0, spread)),
                                         .y = 1e-6 * pow(10, random_range(0, spread))};
        assert_true(plot_scale(&plot));
        for (int i = 0; i < 5; i++) {
            assert_true(mark[i].x >= plot.x.low && mark[i].x <= plot.x.high);
            assert_true(mark[i].y >= plot.y.low && mark[i].y <= plot.y.high);
        }
        for (size_t k = 1; k < plot.x.ticks; k++)
            assert_true(plot.x.tick[k] > plot.x.tick[k - 1]);
        assert_true(plot.x.ticks >= 2 && plot.y.ticks >= 2 && plot.x.ticks <= 14 && plot.y.ticks <= 14);
    }
    struct plot_mark none = {.x = NAN, .y = 1};
    struct plot empty = {.count = 1, .mark = &none};
    assert_false(plot_scale(&empty));
}

static double volume(const struct mesh *m, size_t t)
{
    double e[3][3];
    for (int k = 0; k < 3; k++)
        for (int a = 0; a < 3; a++)
            e[k][a] = m->nodes[3 * m->tetrahedra[4 * t + k + 1] + a] - m->nodes[3 * m->tetrahedra[4 * t] + a];
    return (e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) - e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
            e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0])) /
           6;
}

static void a_refined_mesh_fills_the_same_body_with_eight_times_the_elements(void **state)
{
    (void)state;
    double nodes[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1.5};
    uint32_t tetrahedra[] = {0, 1, 2, 3, 1, 2, 3, 4};
    int32_t labels[] = {0, 3};
    struct mesh coarse = {
        .node_count = 5, .nodes = nodes, .tetrahedron_count = 2, .tetrahedra = tetrahedra, .labels = labels};
    struct mesh fine;
    struct failure why = {0};
    assert_int_equal(refine_mesh(&coarse, &fine, NULL, &why), STATUS_OK);
    assert_int_equal(fine.tetrahedron_count, 16);
    assert_int_equal(fine.node_count, 5 + 9); /* 6 + 6 edges less the 3 of the shared face */
    double sum[2] = {0, 0};
    for (size_t t = 0; t < 16; t++) {
        double v = volume(&fine, t);
        assert_true(fabs(v - volume(&coarse, t / 8) / 8) < 1e-15); /* each an eighth: no overlap, right orientation */
        sum[t / 8] += v;
        assert_int_equal(fine.labels[t], labels[t / 8]);
    }
    assert_true(fabs(sum[0] - volume(&coarse, 0)) < 1e-15 && fabs(sum[1] - volume(&coarse, 1)) < 1e-15);
    struct surface surface;
    struct mesh_report report;
    assert_int_equal(mesh_check(&fine, false, &report, &why), STATUS_OK);
    assert_int_equal(report.reoriented, 0);
    assert_int_equal(mesh_surface(&fine, &surface, &why), STATUS_OK);
    assert_int_equal(surface.triangle_count, 4 * 6); /* no hanging nodes: the shared face is inside */
    surface_free(&surface);
    mesh_free(&fine);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_known_front_is_found),
        cmocka_unit_test(nothing_beats_the_front_and_all_else_is_beaten),
        cmocka_unit_test(the_pick_within_a_limit_is_the_best_that_fits),
        cmocka_unit_test(judging_marks_fronts_and_advises_what_fits),
        cmocka_unit_test(the_scenes_budget_is_honoured),
        cmocka_unit_test(every_setting_of_a_plan_is_there_once_and_neighbours_share_what_they_can),
        cmocka_unit_test(axes_hold_all_marks_and_ticks_rise),
        cmocka_unit_test(a_refined_mesh_fills_the_same_body_with_eight_times_the_elements),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
