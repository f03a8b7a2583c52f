#include "knob.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "compression.h"
#include "tick.h"
#include "worst_tick.h"

const struct knob_info knob_table[KNOBS] = {
    [KNOB_ORDER] = {"order",
                    "of the elements: 1 linear, 2 quadratic and projected on the surface",
                    STAGE_BODY,
                    true,
                    2,
                    2,
                    {1, 2}},
    [KNOB_REFINE] = {"refinement", "each tetrahedron is split into 8, so many times", STAGE_BODY, true, 1, 2, {0, 1}},
    [KNOB_STEP] = {"step",
                   "rounding of the stored factor, relative; 0: not compressed",
                   STAGE_BANK,
                   false,
                   3,
                   9,
                   {0, 5e-3, 4e-4, 2e-2, 1e-2, 2.5e-3, 1.25e-3, 6e-4, 2e-4}},
    [KNOB_POINTS] = {"points",
                     "points that sample the instrument's tip",
                     STAGE_CONTROLLER,
                     true,
                     2,
                     8,
                     {1, 12, 16, 2, 3, 4, 7, 10}},
    [KNOB_STEPS] = {"solver_steps",
                    "factorisations after which the contact solver of a tick stops",
                    STAGE_CONTROLLER,
                    true,
                    1,
                    5,
                    {1, 2, 3, 6, BANK_MAX_SOLVER_STEPS}},
    [KNOB_SWEEPS] = {"sweeps",
                     "sweeps after which the contact solver of a tick with friction stops; 0: no friction",
                     STAGE_CONTROLLER,
                     true,
                     4,
                     5,
                     {2, 5, 10, 20, BANK_MAX_SWEEPS}},
    [KNOB_RATE] = {"rate_Hz",
                   "ticks per second; between them the force is held",
                   STAGE_CONTROLLER,
                   true,
                   1,
                   4,
                   {500, 250, 125, TICK_RATE_HZ}},
};

struct setting knob_scene(const struct scene *scene)
{
    return (struct setting){.value = {
                                [KNOB_ORDER] = scene->order == ELEMENT_QUADRATIC ? 2 : 1,
                                [KNOB_REFINE] = 0,
                                [KNOB_STEP] = COMPRESSION_STEP,
                                [KNOB_POINTS] = scene->instrument[0].tip_points,
                                [KNOB_STEPS] = scene->solver_steps ? scene->solver_steps : BANK_MAX_SOLVER_STEPS,
                                [KNOB_SWEEPS] = worst_tick_sweeps(scene),
                                [KNOB_RATE] = TICK_RATE_HZ,
                            }};
}

void knob_apply(const struct setting *setting, struct scene *scene)
{
    for (size_t i = 0; i < scene->instrument_count; i++)
        scene->instrument[i].tip_points = (unsigned)setting->value[KNOB_POINTS];
    scene->order = setting->value[KNOB_ORDER] == 2 ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
    scene->solver_steps = (unsigned)setting->value[KNOB_STEPS];
    if (setting->value[KNOB_SWEEPS] > 0)
        scene->effects.friction.sweeps = (unsigned)setting->value[KNOB_SWEEPS];
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
    static const char *const format[KNOBS] = {
        [KNOB_REFINE] = "each tetrahedron split %.0f times",
        [KNOB_STEP] = "step %.3g",
        [KNOB_POINTS] = "%.0f points",
        [KNOB_STEPS] = "at most %.0f solver steps",
        [KNOB_RATE] = "%.0f Hz",
        [KNOB_SWEEPS] = "at most %.0f sweeps",
    };
    if (value == 1 && knob == KNOB_POINTS)
        snprintf(text, room, "1 point");
    else if (value == 1 && knob == KNOB_STEPS)
        snprintf(text, room, "1 solver step");
    else if (value == 1 && knob == KNOB_REFINE)
        snprintf(text, room, "refined once");
    else if (knob == KNOB_ORDER)
        snprintf(text, room, value == 2 ? "quadratic" : "linear");
    else if (value == 0 && knob == KNOB_STEP)
        snprintf(text, room, "not compressed");
    else if (value == 0 && knob == KNOB_REFINE)
        snprintf(text, room, "the mesh as it is");
    else {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
        snprintf(text, room, format[knob], value);
#pragma GCC diagnostic pop
    }
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
