#include "scene_viscoelastic.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "prony_fit.h"
#include "scene_keys.h"
#include "tick.h"

/* Bounds that keep mistakes of units out: what is faster than a tick is a dashpot, what is slower than hours does not move. */
static const double SHORTEST_s = 1e-5, LONGEST_s = 1e5, LEAST_SHARE = 1e-6, MOST_SHARE = 1e3;

static void prony_list(struct tree *t, tree_node list, struct prony *series)
{
    size_t count = tree_list(t, list, "prony", PRONY_MAX);
    tree_require(t, list, count > 0, "prony is empty");
    for (size_t b = 0; b < count; b++) {
        tree_node pair = tree_item(t, list, b);
        size_t parts = tree_list(t, pair, "a branch of prony", 2);
        tree_require(t, pair, parts == 2, "a branch of prony has %zu entries; [share, time] are needed", parts);
        if (t->status)
            return;
        scene_bounded(t, tree_item(t, pair, 0), "the share of a branch", DIMENSION_RATIO, LEAST_SHARE, MOST_SHARE, "",
                      &series->share[b]);
        scene_bounded(t, tree_item(t, pair, 1), "the time of a branch", DIMENSION_TIME, SHORTEST_s, LONGEST_s, " s",
                      &series->time_s[b]);
    }
    series->count = count;
    prony_sort(series);
}

static double positive(struct tree *t, tree_node map, const char *model, const char *name, enum dimension dimension)
{
    double value = 1;
    tree_node node = tree_need(t, map, model, name);
    scene_bounded(t, node, name, dimension, 1e-9, 1e13, "", &value);
    return value;
}

/* Two moduli and a viscosity. */
static void solid(struct tree *t, tree_node map, const char *name, struct prony (*model)(double, double, double),
                  struct prony *series)
{
    if (!tree_map(t, map, name, KEYS("k1", "k2", "C")))
        return;
    double k1 = positive(t, map, name, "k1", DIMENSION_PRESSURE), k2 = positive(t, map, name, "k2", DIMENSION_PRESSURE);
    double C = positive(t, map, name, "C", DIMENSION_VISCOSITY);
    if (t->status)
        return;
    *series = model(k1, k2, C);
    tree_require(
        t, map,
        series->time_s[0] >= SHORTEST_s && series->time_s[0] <= LONGEST_s && series->share[0] >= LEAST_SHARE &&
            series->share[0] <= MOST_SHARE,
        "%s relaxes in %g s, by %g of its equilibrium: the time must be from %g to %g s, the part from %g to %g", name,
        series->time_s[0], series->share[0], SHORTEST_s, LONGEST_s, LEAST_SHARE, MOST_SHARE);
}

static void fit(struct tree *t, tree_node node, struct scene_viscoelastic *v)
{
    scene_file(t, node, v->fit_path, sizeof v->fit_path);
    if (t->status)
        return;
    struct prony_fit result;
    t->status = prony_fit_file(v->fit_path, &result, t->why);
    v->series = result.series;
    prony_fit_free(&result);
}

void scene_viscoelastic_parse(struct tree *t, void *map, struct scene *scene)
{
    static const char *const models[] = {"prony", "kelvin_voigt", "boltzmann", "maxwell_kelvin_voigt", "fit"};
    struct scene_viscoelastic *v = &scene->effects.viscoelastic;
    if (!tree_map(t, map, "viscoelastic",
                  KEYS("prony", "viscosity", "kelvin_voigt", "boltzmann", "maxwell_kelvin_voigt", "fit")))
        return;
    tree_node viscosity = tree_find(t, map, "viscosity"), given = NULL;
    int model = -1;
    for (int k = 0; k < 5; k++) {
        tree_node node = tree_find(t, map, models[k]);
        if (node && given) {
            tree_fail(t, node, STATUS_SCENE_VALUE, "keep one of them", "viscoelastic has both %s and %s", models[model],
                      models[k]);
            return;
        }
        model = node ? k : model;
        given = node ? node : given;
    }
    if (!given && !viscosity)
        tree_fail(t, map, STATUS_SCENE_MISSING,
                  "give one of prony, viscosity, kelvin_voigt, boltzmann, maxwell_kelvin_voigt, fit",
                  "viscoelastic has no model");
    if (viscosity && model > 0)
        tree_fail(t, viscosity, STATUS_SCENE_VALUE, "keep one of them", "viscosity goes with prony, not with %s",
                  models[model]);
    if (t->status)
        return;
    if (model == 0)
        prony_list(t, given, &v->series);
    else if (model == 1 && tree_map(t, given, "kelvin_voigt", KEYS("k", "C"))) {
        double k = positive(t, given, "kelvin_voigt", "k", DIMENSION_PRESSURE);
        v->series = prony_kelvin_voigt(k, positive(t, given, "kelvin_voigt", "C", DIMENSION_VISCOSITY));
    } else if (model == 2)
        solid(t, given, "boltzmann", prony_boltzmann, &v->series);
    else if (model == 3)
        solid(t, given, "maxwell_kelvin_voigt", prony_maxwell_kelvin_voigt, &v->series);
    else if (model == 4)
        fit(t, given, v);
    scene_bounded(t, viscosity, "viscosity", DIMENSION_TIME, 1e-6, 1, " s", &v->series.viscosity_s);
    tree_require(t, map, v->series.viscosity_s <= 1, "the viscosity is %g s of the modulus: at most 1 s is possible",
                 v->series.viscosity_s);
    tree_require(t, map, v->series.count + (v->series.viscosity_s > 0) <= BANK_MAX_BRANCHES,
                 "%zu branches and a dashpot: %d in all are possible", v->series.count, BANK_MAX_BRANCHES);
}

void scene_viscoelastic_print(FILE *out, const struct scene *scene)
{
    const struct prony *s = &scene->effects.viscoelastic.series;
    char share[QUANTITY_TEXT], time[QUANTITY_TEXT];
    fputc('{', out);
    for (size_t b = 0; b < s->count; b++) {
        quantity_print(s->share[b], DIMENSION_NUMBER, share);
        quantity_print(s->time_s[b], DIMENSION_TIME, time);
        fprintf(out, "%s[%s, %s]", b ? ", " : "prony: [", share, time);
    }
    quantity_print(s->viscosity_s, DIMENSION_TIME, time);
    fprintf(out, "%s", s->count ? "]" : "");
    if (s->viscosity_s > 0)
        fprintf(out, "%sviscosity: %s", s->count ? ", " : "", time);
    fputc('}', out);
}

int scene_viscoelastic_section(const struct scene *scene, struct body *body, struct effect_section *section,
                               struct failure *why)
{
    (void)body;
    const struct prony *s = &scene->effects.viscoelastic.series;
    size_t branches = s->count + (s->viscosity_s > 0);
    struct bank_viscoelastic *b = calloc(1, sizeof *b + branches * sizeof b->branch[0]);
    if (!b)
        return failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect viscoelastic");
    const double T = 1.0 / TICK_RATE_HZ;
    double reach = SCENE_DEFAULT_TIP_RADIUS_m;
    for (size_t i = 0; i < scene->instrument_count; i++)
        reach = fmax(reach, scene->instrument[i].tip_radius_m);
    b->branches = (uint32_t)branches;
    b->reach_m = (float)reach;
    for (size_t k = 0; k < s->count; k++)
        b->branch[k] = (struct bank_branch){.decay = (float)exp(-T / s->time_s[k]),
                                            .gain = (float)(s->share[k] * s->time_s[k] * -expm1(-T / s->time_s[k]) / T),
                                            .share = (float)s->share[k],
                                            .time_s = (float)s->time_s[k]};
    if (s->viscosity_s > 0)
        b->branch[s->count] =
            (struct bank_branch){.gain = (float)(s->viscosity_s / T), .time_s = (float)s->viscosity_s};
    double total = 0;
    for (size_t k = 0; k < branches; k++) {
        if (b->branch[k].decay >= 1) /* slower than float can tell from standing still in a tick */
            b->branch[k].decay = 1 - 0x1p-24F;
        total += (double)b->branch[k].gain;
    }
    if (total > (double)BANK_MAX_GAIN) {
        free(b);
        return failure_set(why, STATUS_SCENE_VALUE, scene->path, "lower shares or viscosity",
                           "the tissue would be %g times as stiff within a tick as at rest: at most %g", 1 + total,
                           1 + (double)BANK_MAX_GAIN);
    }
    *section =
        (struct effect_section){.bytes = b, .length = sizeof *b + branches * sizeof b->branch[0], .count = branches};
    return STATUS_OK;
}
