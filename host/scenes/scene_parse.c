/* Keys to struct scene. Every key, its unit, default and range stand in SCENE.md. */
#include "scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "device.h"
#include "effects/image.h"
#include "scene_keys.h"

static void tip(struct tree *t, tree_node map, struct scene_instrument *instrument)
{
    if (!tree_map(t, map, "tip", KEYS("radius", "points")))
        return;
    tree_node radius = tree_find(t, map, "radius"), points = tree_find(t, map, "points");
    scene_bounded(t, radius, "radius", DIMENSION_LENGTH, SCENE_MIN_LENGTH_m, SCENE_MAX_TIP_RADIUS_m, " m",
                  &instrument->tip_radius_m);
    double count = instrument->tip_points;
    tree_quantity(t, points, "points", DIMENSION_NUMBER, &count);
    tree_require(t, points, count >= 1 && count <= BANK_MAX_TOOL_POINTS && count == floor(count),
                 "points = %g: a whole number from 1 to %d is needed", count, BANK_MAX_TOOL_POINTS);
    if (!t->status)
        instrument->tip_points = (unsigned)count;
}

static void coupling(struct tree *t, tree_node map, const struct device_model *device,
                     struct scene_instrument *instrument)
{
    if (!map || !tree_map(t, map, "coupling", KEYS("stiffness", "damping")))
        return;
    tree_node stiffness = tree_find(t, map, "stiffness"), damping = tree_find(t, map, "damping");
    scene_bounded(t, stiffness, "stiffness", DIMENSION_STIFFNESS, 1, 1e6, " N/m", &instrument->coupling_stiffness_N_m);
    scene_bounded(t, damping, "damping", DIMENSION_DAMPING, 1e-3, 1e3, " N s/m", &instrument->coupling_damping_Ns_m);
    struct scene_coupling used;
    scene_coupling(instrument, device, &used);
    tree_require(t, map, used.damping_Ns_m < used.device_damping_Ns_m,
                 "damping = %g N s/m: it must stay below the %g N s/m of %s", used.damping_Ns_m,
                 used.device_damping_Ns_m, device->name);
    tree_require(t, map, used.stiffness_N_m <= used.largest_stiffness_N_m,
                 "stiffness = %g N/m with damping = %g N s/m: %s at 1 kHz stays passive up to %.0f N/m",
                 used.stiffness_N_m, used.damping_Ns_m, device->name, used.largest_stiffness_N_m);
}

static void length(struct tree *t, tree_node node, const struct device_model *device,
                   struct scene_instrument *instrument)
{
    double range[2] = {device->axis[2].minimum, device->axis[2].maximum};
    tree_range(t, node, "length", DIMENSION_LENGTH, range);
    tree_require(t, node, range[0] < range[1], "length = %g..%g m: the first must be below the second", range[0],
                 range[1]);
    /* 1 um: a range written in another unit may round to just outside */
    tree_require(t, node, range[0] >= device->axis[2].minimum - 1e-6 && range[1] <= device->axis[2].maximum + 1e-6,
                 "length = %g..%g m: %s reaches %g..%g m", range[0], range[1], device->name, device->axis[2].minimum,
                 device->axis[2].maximum);
    instrument->length_min_m = range[0];
    instrument->length_max_m = range[1];
}

static void instrument_of(struct tree *t, tree_node map, struct scene_instrument *instrument)
{
    if (!tree_map(t, map, "instrument", KEYS("name", "trocar", "length", "tip", "device", "coupling", "force_limit")))
        return;
    tree_name(t, tree_need(t, map, "instrument", "name"), "name", instrument->name, sizeof instrument->name);
    tree_node device_node = tree_find(t, map, "device");
    tree_text(t, device_node, "device", instrument->device, sizeof instrument->device);
    const struct device_model *device = device_model_find(instrument->device);
    tree_require(t, device_node, device != NULL, "device '%s' is not known; this version has: %s", instrument->device,
                 device_model_names());
    if (t->status || !device)
        return;
    tree_node trocar = tree_find(t, map, "trocar");
    if (trocar && tree_map(t, trocar, "trocar", KEYS("at", "axis"))) {
        scene_position(t, tree_need(t, trocar, "trocar", "at"), "at", instrument->trocar_m);
        tree_direction(t, tree_need(t, trocar, "trocar", "axis"), "axis", instrument->axis);
        instrument->placed = true;
    }
    length(t, tree_find(t, map, "length"), device, instrument);
    tip(t, tree_find(t, map, "tip"), instrument);
    coupling(t, tree_find(t, map, "coupling"), device, instrument);
    tree_node force = tree_find(t, map, "force_limit");
    scene_bounded(t, force, "force_limit", DIMENSION_FORCE, 1e-3, device->force_limit_N, " N",
                  &instrument->force_limit_N);
}

static void instruments(struct tree *t, tree_node list, struct scene *scene)
{
    size_t count = tree_list(t, list, "instruments", BANK_MAX_INSTRUMENTS);
    tree_require(t, list, count > 0, "instruments is empty");
    for (size_t i = 0; i < count; i++) {
        scene_assume_instrument(&scene->instrument[i]);
        instrument_of(t, tree_item(t, list, i), &scene->instrument[i]);
        for (size_t j = 0; j < i; j++)
            tree_require(t, tree_item(t, list, i), strcmp(scene->instrument[i].name, scene->instrument[j].name) != 0,
                         "two instruments are named '%s'", scene->instrument[i].name);
    }
    if (count < 2) {
        scene->instrument_count = 1;
        return;
    }
    scene->instrument_count = count;
    scene->effects.named |= EFFECT_SECOND;
    unsigned points = scene->instrument[0].tip_points + scene->instrument[1].tip_points;
    tree_require(t, list, points <= BANK_MAX_TOOL_POINTS,
                 "the tips of both instruments have %u points in all: at most %d fit one contact system", points,
                 BANK_MAX_TOOL_POINTS);
}

static void contact(struct tree *t, tree_node map, struct scene *scene)
{
    if (!map || !tree_map(t, map, "contact", KEYS("regularisation", "steps")))
        return;
    tree_node node = tree_find(t, map, "regularisation");
    scene_bounded(t, node, "regularisation", DIMENSION_RATIO, SCENE_MIN_REGULARISATION, 1, " of the median compliance",
                  &scene->regularisation);
    tree_node steps = tree_find(t, map, "steps");
    double count = 0;
    tree_quantity(t, steps, "steps", DIMENSION_NUMBER, &count);
    bool good = count >= 1 && count <= BANK_MAX_SOLVER_STEPS && count == floor(count);
    tree_require(t, steps, good, "steps = %g: a whole number from 1 to %d is needed", count, BANK_MAX_SOLVER_STEPS);
    if (steps && good)
        scene->solver_steps = (unsigned)count;
}

/* A mapping from names of effects to what each of them takes. */
static void effects(struct tree *t, tree_node map, struct scene *scene)
{
    if (tree_empty(t, map))
        return;
    char offered[400], remedy[440];
    uint32_t all = 0;
    for (size_t i = 0; i < effects_count(); i++)
        all |= effects_at(i)->bit;
    effects_names(all & ~(uint32_t)EFFECT_SECOND, ", ", offered, sizeof offered);
    snprintf(remedy, sizeof remedy, "this version offers: %s", offered);
    if (map->type != YAML_MAPPING_NODE) {
        tree_fail(t, map, STATUS_SCENE_KEY, remedy, "effects is not a mapping from effects to what they take");
        return;
    }
    for (const yaml_node_pair_t *pair = map->data.mapping.pairs.start; pair < map->data.mapping.pairs.top; pair++) {
        tree_node key = yaml_document_get_node(&t->document, pair->key);
        bool word = key->type == YAML_SCALAR_NODE;
        const char *name = word ? (const char *)key->data.scalar.value : "";
        const struct effect *effect = effects_find(name);
        if (!effect) {
            tree_fail(t, key, STATUS_SCENE_KEY, remedy, "effect%s%.60s%s is not known", word ? " '" : "", name,
                      word ? "'" : "");
            return;
        }
        if (effect->bit == EFFECT_SECOND) {
            tree_fail(t, key, STATUS_SCENE_KEY, "write a second entry of instruments",
                      "'%s' is no key of effects: a second instrument names it", name);
            return;
        }
        if (scene->effects.named & effect->bit) {
            tree_fail(t, key, STATUS_SCENE_KEY, "keep one of them", "'%s' stands twice", name);
            return;
        }
        scene->effects.named |= effect->bit;
        effect->parse(t, yaml_document_get_node(&t->document, pair->value), scene);
    }
    /* What the first of each takes for granted the second changes: that contacts push along their normals; that they respond as the
     * bank says; that the force acts at the tip. */
    static const uint32_t apart[][2] = {
        {EFFECT_SWING, EFFECT_FRICTION | EFFECT_GRASP | EFFECT_VISCOELASTIC},
        {EFFECT_NEO_HOOKEAN, EFFECT_FRICTION | EFFECT_GRASP | EFFECT_VISCOELASTIC | EFFECT_SWING},
        {EFFECT_QUASI_NONLINEAR,
         EFFECT_FRICTION | EFFECT_GRASP | EFFECT_VISCOELASTIC | EFFECT_SWING | EFFECT_NEO_HOOKEAN},
        {EFFECT_SHAPE, EFFECT_FRICTION},
        {EFFECT_RIGID, EFFECT_NEO_HOOKEAN | EFFECT_QUASI_NONLINEAR},
    };
    for (size_t i = 0; i < sizeof apart / sizeof apart[0]; i++) {
        uint32_t clash = scene->effects.named & apart[i][1];
        if (!(scene->effects.named & apart[i][0]) || !clash)
            continue;
        effects_names(apart[i][0] | clash, " and ", offered, sizeof offered);
        tree_fail(t, map, STATUS_SCENE_VALUE, "leave one of them out", "%s do not go together yet", offered);
    }
    if (scene->effects.named & EFFECT_RIGID)
        scene_rigid_check(t, tree_find(t, map, "rigid"), scene);
}

static void budget(struct tree *t, tree_node map, struct scene *scene)
{
    if (!map || !tree_map(t, map, "budget", KEYS("instructions", "bank", "force_error")))
        return;
    tree_node instructions = tree_find(t, map, "instructions"), bank = tree_find(t, map, "bank"),
              force_error = tree_find(t, map, "force_error");
    tree_quantity(t, instructions, "instructions", DIMENSION_NUMBER, &scene->budget_instructions);
    tree_require(t, instructions,
                 scene->budget_instructions >= 1 && scene->budget_instructions <= 1e12 &&
                     scene->budget_instructions == floor(scene->budget_instructions),
                 "instructions = %g: a whole number above 0 is needed", scene->budget_instructions);
    scene_bounded(t, bank, "bank", DIMENSION_BYTES, 1, 4294967295.0, " B", &scene->budget_bank_bytes);
    tree_quantity(t, force_error, "force_error", DIMENSION_SHARE, &scene->budget_force_error);
    tree_require(t, force_error, scene->budget_force_error > 0 && scene->budget_force_error <= 1,
                 "force_error = %g %%: it must be above 0 and at most 100 %%", 100 * scene->budget_force_error);
}

int scene_parse(const char *text, size_t length_bytes, const char *path, struct scene *scene, struct failure *why)
{
    struct tree tree;
    *scene = (struct scene){.regularisation = SCENE_DEFAULT_REGULARISATION, .instrument_count = 1};
    scene_assume_instrument(&scene->instrument[0]);
    if (strlen(path) >= sizeof scene->path)
        return failure_set(why, STATUS_FILE_OPEN, "", "move the scene", "the scene's path is longer than %zu bytes",
                           sizeof scene->path - 1);
    snprintf(scene->path, sizeof scene->path, "%s", path);
    int status = tree_open(&tree, text, length_bytes, path, why);
    if (status)
        return status;
    tree_node root = tree_root(&tree);
    if (tree_map(&tree, root, "the scene", KEYS("scene", "body", "instruments", "contact", "effects", "budget"))) {
        tree_name(&tree, tree_need(&tree, root, "the scene", "scene"), "scene", scene->name, sizeof scene->name);
        scene_body(&tree, tree_need(&tree, root, "the scene", "body"), scene);
        instruments(&tree, tree_find(&tree, root, "instruments"), scene);
        contact(&tree, tree_find(&tree, root, "contact"), scene);
        effects(&tree, tree_find(&tree, root, "effects"), scene);
        budget(&tree, tree_find(&tree, root, "budget"), scene);
    }
    status = tree.status;
    tree_close(&tree);
    return status;
}
