#include "knob.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "compression.h"
#include "tick.h"

static double order_of(const struct scene *scene)
{
    return scene->order == ELEMENT_QUADRATIC ? 2 : 1;
}

static void set_order(double value, struct scene *scene)
{
    scene->order = value == 2 ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
}

static double none(const struct scene *scene)
{
    (void)scene;
    return 0;
}

static double default_step(const struct scene *scene)
{
    (void)scene;
    return COMPRESSION_STEP;
}

static double effects_of(const struct scene *scene)
{
    return scene->effects.named != 0;
}

static void set_effects(double value, struct scene *scene)
{
    if (value == 0)
        scene->effects.named = 0;
}

static double points_of(const struct scene *scene)
{
    return scene->instrument[0].tip_points;
}

static void set_points(double value, struct scene *scene)
{
    for (size_t i = 0; i < scene->instrument_count; i++)
        scene->instrument[i].tip_points = (unsigned)value;
    if (scene->effects.named & EFFECT_SHAPE)
        scene_shape_sample(scene, (unsigned)value);
}

static double steps_of(const struct scene *scene)
{
    return scene->solver_steps ? scene->solver_steps : BANK_MAX_SOLVER_STEPS;
}

static void set_steps(double value, struct scene *scene)
{
    scene->solver_steps = (unsigned)value;
}

static double sweeps_of(const struct scene *scene)
{
    return scene->effects.named & EFFECT_FRICTION ? scene->effects.friction.sweeps : 0;
}

static void set_sweeps(double value, struct scene *scene)
{
    if (value > 0)
        scene->effects.friction.sweeps = (unsigned)value;
}

static double tick_rate(const struct scene *scene)
{
    (void)scene;
    return TICK_RATE_HZ;
}

const struct knob_info knob_table[KNOBS] = {
    [KNOB_ORDER] = {.name = "order",
                    .legend = "order of the elements",
                    .what = "of the elements: 1 linear, 2 quadratic and projected on the surface",
                    .stage = STAGE_BODY,
                    .best_is_most = true,
                    .quick = 2,
                    .full = 2,
                    .value = {1, 2},
                    .of_scene = order_of,
                    .apply = set_order,
                    .format = "order %.0f",
                    .at = {NULL, "linear", "quadratic"}},
    [KNOB_REFINE] = {.name = "refinement",
                     .legend = "finer mesh",
                     .what = "each tetrahedron is split into 8, so many times",
                     .stage = STAGE_BODY,
                     .best_is_most = true,
                     .quick = 1,
                     .full = 2,
                     .value = {0, 1},
                     .of_scene = none,
                     .format = "each tetrahedron split %.0f times",
                     .at = {"the mesh as it is", "refined once"}},
    [KNOB_STEP] = {.name = "step",
                   .legend = "rounding step",
                   .what = "rounding of the stored factor, relative; 0: not compressed",
                   .stage = STAGE_BANK,
                   .quick = 5,
                   .full = 10,
                   .value = {0, 5e-3, 4e-4, 2e-2, 1e-4, 1e-2, 2.5e-3, 1.25e-3, 6e-4, 2e-4},
                   .of_scene = default_step,
                   .format = "step %.3g",
                   .at = {"not compressed"}},
    [KNOB_EFFECTS] = {.name = "effects",
                      .legend = "effects", /* a scene that names none has nothing to turn */
                      .what = "1: those that the scene names, 0: none",
                      .stage = STAGE_BODY,
                      .best_is_most = true,
                      .quick = 1,
                      .full = 1,
                      .value = {0},
                      .of_scene = effects_of,
                      .apply = set_effects,
                      .format = "%.0f effects",
                      .at = {"without effects", "with effects"}},
    [KNOB_POINTS] = {.name = "points",
                     .legend = "points of the tip",
                     .what = "points that sample the instrument's tip, or spheres its shape",
                     .stage = STAGE_CONTROLLER,
                     .best_is_most = true,
                     .quick = 2,
                     .full = 8,
                     .value = {1, 12, 16, 2, 3, 4, 7, 10},
                     .of_scene = points_of,
                     .apply = set_points,
                     .format = "%.0f points",
                     .at = {NULL, "1 point"}},
    [KNOB_STEPS] = {.name = "solver_steps",
                    .legend = "solver steps",
                    .what = "factorisations after which the contact solver of a tick stops",
                    .stage = STAGE_CONTROLLER,
                    .best_is_most = true,
                    .quick = 1,
                    .full = 5,
                    .value = {1, 2, 3, 6, BANK_MAX_SOLVER_STEPS},
                    .of_scene = steps_of,
                    .apply = set_steps,
                    .format = "at most %.0f solver steps",
                    .at = {NULL, "at most 1 solver step"}},
    [KNOB_SWEEPS] = {.name = "sweeps",
                     .legend = "sweeps",
                     .what = "sweeps after which the contact solver of a tick with friction stops; 0: no friction",
                     .stage = STAGE_CONTROLLER,
                     .best_is_most = true,
                     .quick = 4,
                     .full = 5,
                     .value = {2, 5, 10, 20, BANK_MAX_SWEEPS},
                     .of_scene = sweeps_of,
                     .apply = set_sweeps,
                     .format = "at most %.0f sweeps"},
    [KNOB_ROW_WORK] = {.name = "row_work",
                       .legend = "row work",
                       .what =
                           "thousands of units of work on rows of the bank in one tick; 0: as the scene's budget of "
                           "instructions leaves",
                       .stage = STAGE_CONTROLLER,
                       .best_is_most = true,
                       .quick = 1,
                       .full = 5,
                       .value = {3, 10, 30, 100, 200},
                       .of_scene = none,
                       .format = "%.0f thousand units of row work",
                       .at = {"row work as the budget leaves", "1 thousand units of row work"}},
    [KNOB_RATE] = {.name = "rate_Hz",
                   .legend = "tick rate",
                   .what = "ticks per second; between them the force is held",
                   .stage = STAGE_CONTROLLER,
                   .best_is_most = true,
                   .quick = 1,
                   .full = 4,
                   .value = {500, 250, 125, TICK_RATE_HZ},
                   .of_scene = tick_rate,
                   .format = "%.0f Hz"},
};

struct setting knob_scene(const struct scene *scene)
{
    struct setting setting;
    for (int k = 0; k < KNOBS; k++)
        setting.value[k] = knob_table[k].of_scene(scene);
    return setting;
}

void knob_apply(const struct setting *setting, struct scene *scene)
{
    for (int k = 0; k < KNOBS; k++)
        if (knob_table[k].apply)
            knob_table[k].apply(setting->value[k], scene);
}

bool knob_acts(enum knob knob, const struct setting *base)
{
    bool friction = base->value[KNOB_SWEEPS] > 0;
    return knob == KNOB_SWEEPS ? friction : knob == KNOB_STEPS ? !friction : true;
}

struct setting knob_reference(const struct setting *setting)
{
    struct setting reference = *setting;
    for (int k = 0; k < KNOBS; k++) {
        const struct knob_info *knob = &knob_table[k];
        for (size_t v = 0; v < knob->full && knob->stage != STAGE_BODY && knob_acts((enum knob)k, setting); v++)
            if ((knob->value[v] > reference.value[k]) == knob->best_is_most)
                reference.value[k] = knob->value[v];
    }
    return reference;
}

void knob_value_text(enum knob knob, double value, char *text, size_t room)
{
    const struct knob_info *info = &knob_table[knob];
    const char *word = value == 0 || value == 1 || value == 2 ? info->at[(int)value] : NULL;
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
    snprintf(text, room, word ? word : info->format, value);
#pragma GCC diagnostic pop
}

void knob_name(const struct setting *setting, const struct setting *base, char *text, size_t room)
{
    size_t used = 0;
    *text = 0;
    for (int k = 0; k < KNOBS; k++) {
        char value[80];
        if (setting->value[k] == base->value[k])
            continue;
        knob_value_text((enum knob)k, setting->value[k], value, sizeof value);
        int n = snprintf(text + used, room - used, "%s%s", used ? ", " : "", value);
        used = used + (size_t)n < room ? used + (size_t)n : room - 1;
    }
    if (!used)
        snprintf(text, room, "as the scene says");
}

int knob_differ(const struct setting *a, const struct setting *b)
{
    int first = STAGE_CONTROLLER + 1;
    for (int k = 0; k < KNOBS; k++)
        if (a->value[k] != b->value[k] && (int)knob_table[k].stage < first)
            first = (int)knob_table[k].stage;
    return first;
}

static int add(struct plan *plan, const struct setting *setting, struct failure *why)
{
    for (size_t s = 0; s < plan->count; s++)
        if (knob_differ(&plan->setting[s], setting) > STAGE_CONTROLLER)
            return STATUS_OK;
    struct setting *grown = realloc(plan->setting, (plan->count + 1) * sizeof *grown);
    if (!grown)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the settings");
    plan->setting = grown;
    plan->setting[plan->count++] = *setting;
    return STATUS_OK;
}

static size_t values(int knob, bool quick)
{
    return quick ? knob_table[knob].quick : knob_table[knob].full;
}

/* Every combination of the knobs of `stage`, each with its value in the base first. `then` goes on with each. */
static int combine(const struct setting *at, const struct setting *base, int knob, bool quick, struct plan *plan,
                   struct failure *why)
{
    while (knob < KNOBS && knob_table[knob].stage == STAGE_CONTROLLER)
        knob++;
    if (knob == KNOBS)
        return add(plan, at, why);
    int status = combine(at, base, knob + 1, quick, plan, why);
    for (size_t v = 0; v < values(knob, quick) && !status; v++) {
        struct setting next = *at;
        next.value[knob] = knob_table[knob].value[v];
        bool turned = knob_differ(at, base) <= STAGE_CONTROLLER;
        if (next.value[knob] != base->value[knob] && !(quick && turned)) /* in quick form one knob at a time */
            status = combine(&next, base, knob + 1, quick, plan, why);
    }
    return status;
}

int plan_make(const struct setting *base, bool quick, struct plan *plan, struct failure *why)
{
    *plan = (struct plan){0};
    int status = add(plan, base, why);
    for (int k = 0; k < KNOBS; k++)
        for (size_t v = 0; v < values(k, quick) && knob_table[k].stage == STAGE_CONTROLLER &&
                           knob_acts((enum knob)k, base) && !status;
             v++) {
            struct setting one = *base;
            one.value[k] = knob_table[k].value[v];
            status = add(plan, &one, why);
        }
    int solver = knob_acts(KNOB_SWEEPS, base) ? KNOB_SWEEPS : KNOB_STEPS;
    for (size_t p = 0; p < knob_table[KNOB_POINTS].full && !quick && !status; p++)
        for (size_t s = 0; s < knob_table[solver].full && !status; s++) {
            struct setting both = *base;
            both.value[KNOB_POINTS] = knob_table[KNOB_POINTS].value[p];
            both.value[solver] = knob_table[solver].value[s];
            status = add(plan, &both, why);
        }
    if (!status)
        status = combine(base, base, 0, quick, plan, why);
    if (status)
        plan_free(plan);
    return status;
}

void plan_free(struct plan *plan)
{
    free(plan->setting);
    *plan = (struct plan){0};
}
