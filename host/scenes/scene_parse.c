/* Keys to struct scene. Every key, its unit, default and range stand in SCENE.md. */
#include "scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "device.h"
#include "tree.h"

#define KEYS(...)                                                                                                      \
    (const char *const[])                                                                                              \
    {                                                                                                                  \
        __VA_ARGS__, NULL                                                                                              \
    }

/* Wide bounds, to keep mistakes of units and numbers that overflow a float out. */
static const double MIN_LENGTH_m = 1e-5, MAX_LENGTH_m = 1e3;

/* A value from `low` to `high`; `shown` is the unit of the message. */
static void bounded(struct tree *t, tree_node node, const char *name, enum dimension dimension, double low, double high,
                    const char *shown, double *value)
{
    tree_quantity(t, node, name, dimension, value);
    tree_require(t, node, *value >= low && *value <= high, "%s = %.9g%s: it must be from %g to %g", name, *value, shown,
                 low, high);
}

static void position(struct tree *t, tree_node node, const char *name, double at[3])
{
    tree_vector(t, node, name, DIMENSION_POSITION, at);
    for (int i = 0; i < 3; i++)
        tree_require(t, node, fabs(at[i]) <= (double)BANK_MAX_POSITION_M, "%s: %g m is beyond the %g m of a bank", name,
                     at[i], (double)BANK_MAX_POSITION_M);
}

/* A share above 0, at most 100 %. */
static void share(struct tree *t, tree_node map, const char *name, double *value)
{
    tree_node node = tree_need(t, map, name, "share");
    tree_quantity(t, node, "share", DIMENSION_SHARE, value);
    tree_require(t, node, *value > 0 && *value <= 1, "share = %g %%: it must be above 0 and at most 100 %%",
                 100 * *value);
}

/* The one selection key among the keys of a `fixed` or `ligaments` entry. */
static void selection(struct tree *t, tree_node map, const char *name, struct selection *where)
{
    static const char *const kinds[] = {"box", "sphere", "plane", "label", "patch", "axis_end"};
    int kind = -1;
    for (int k = 0; k < 6; k++) {
        if (!tree_find(t, map, kinds[k]))
            continue;
        if (kind >= 0)
            tree_fail(t, map, STATUS_SCENE_VALUE, "write two entries of the list", "%s has two selections, %s and %s",
                      name, kinds[kind], kinds[k]);
        kind = k;
    }
    if (kind < 0) {
        tree_fail(t, map, STATUS_SCENE_MISSING, "give one of box, sphere, plane, label, patch, axis_end",
                  "%s selects nothing", name);
        return;
    }
    where->kind = (enum selection_kind)kind;
    where->line = tree_line(map);
    tree_node node = tree_find(t, map, kinds[kind]);
    switch (where->kind) {
    case SELECT_BOX:
        if (!tree_map(t, node, "box", KEYS("from", "to")))
            return;
        position(t, tree_need(t, node, "box", "from"), "from", where->a);
        position(t, tree_need(t, node, "box", "to"), "to", where->b);
        for (int i = 0; i < 3; i++)
            tree_require(t, node, where->a[i] <= where->b[i], "box: from %g m is above to %g m along %c", where->a[i],
                         where->b[i], "xyz"[i]);
        break;
    case SELECT_SPHERE:
        if (!tree_map(t, node, "sphere", KEYS("at", "radius")))
            return;
        position(t, tree_need(t, node, "sphere", "at"), "at", where->a);
        bounded(t, tree_need(t, node, "sphere", "radius"), "radius", DIMENSION_LENGTH, MIN_LENGTH_m, MAX_LENGTH_m, " m",
                &where->value);
        break;
    case SELECT_PLANE:
        if (!tree_map(t, node, "plane", KEYS("at", "normal")))
            return;
        position(t, tree_need(t, node, "plane", "at"), "at", where->a);
        tree_direction(t, tree_need(t, node, "plane", "normal"), "normal", where->b);
        break;
    case SELECT_LABEL:
        tree_text(t, node, "label", where->label, sizeof where->label);
        break;
    case SELECT_PATCH:
        if (!tree_map(t, node, "patch", KEYS("near", "share")))
            return;
        position(t, tree_need(t, node, "patch", "near"), "near", where->a);
        share(t, node, "patch", &where->value);
        break;
    case SELECT_AXIS_END:
        if (tree_map(t, node, "axis_end", KEYS("share")))
            share(t, node, "axis_end", &where->value);
        break;
    }
}

/* file: relative to the folder of the scene. */
static void mesh_file(struct tree *t, tree_node node, struct scene *scene)
{
    char file[sizeof scene->mesh_path] = "";
    tree_text(t, node, "file", file, sizeof file);
    const char *slash = strrchr(t->path, '/');
    int folder = file[0] != '/' && slash ? (int)(slash - t->path) + 1 : 0;
    int length = snprintf(scene->mesh_path, sizeof scene->mesh_path, "%.*s%s", folder, t->path, file);
    tree_require(t, node, (size_t)length < sizeof scene->mesh_path, "file: the path is longer than %zu bytes",
                 sizeof scene->mesh_path - 1);
}

static void mesh(struct tree *t, tree_node map, struct scene *scene)
{
    if (!tree_map(t, map, "mesh", KEYS("file", "extent", "unit", "size", "order")))
        return;
    mesh_file(t, tree_need(t, map, "mesh", "file"), scene);
    tree_node extent = tree_find(t, map, "extent"), unit = tree_find(t, map, "unit"), size = tree_find(t, map, "size");
    if (!extent && !unit)
        tree_fail(t, map, STATUS_SCENE_MISSING, "add extent: LENGTH (of the longest side) or unit: m, cm or mm",
                  "mesh needs 'extent' or 'unit': files do not say their length unit");
    if (extent && unit)
        tree_fail(t, unit, STATUS_SCENE_VALUE, "keep one of them", "mesh has both 'extent' and 'unit'");
    bounded(t, extent, "extent", DIMENSION_LENGTH, MIN_LENGTH_m, MAX_LENGTH_m, " m", &scene->extent_m);
    static const enum mesh_unit unit_of[] = {MESH_UNIT_M, MESH_UNIT_CM, MESH_UNIT_MM};
    int choice = tree_choice(t, unit, "unit", KEYS("m", "cm", "mm"));
    scene->unit = choice < 0 ? MESH_UNIT_NONE : unit_of[choice];
    bounded(t, size, "size", DIMENSION_LENGTH, MIN_LENGTH_m, MAX_LENGTH_m, " m", &scene->surface_size_m);
    static const enum element_order order_of[] = {ELEMENT_LINEAR, ELEMENT_QUADRATIC};
    choice = tree_choice(t, tree_find(t, map, "order"), "order", KEYS("linear", "quadratic"));
    scene->order = choice < 0 ? SCENE_DEFAULT_ORDER : order_of[choice];
}

static void materials(struct tree *t, tree_node list, struct scene *scene)
{
    size_t count = tree_list(t, list, "materials", SCENE_MAX_MATERIALS);
    tree_require(t, list, count > 0, "materials is empty");
    for (size_t i = 0; i < count; i++) {
        tree_node map = tree_item(t, list, i);
        if (!tree_map(t, map, "material", KEYS("label", "E", "nu", "rho")))
            return;
        struct scene_material *m = &scene->material[i];
        *m = (struct scene_material){.label = "all", .line = tree_line(map)};
        tree_text(t, tree_find(t, map, "label"), "label", m->label, sizeof m->label);
        tree_node E = tree_need(t, map, "material", "E"), nu = tree_need(t, map, "material", "nu"),
                  rho = tree_need(t, map, "material", "rho");
        bounded(t, E, "E", DIMENSION_PRESSURE, 1e-3, 1e13, " Pa", &m->E_Pa);
        tree_quantity(t, nu, "nu", DIMENSION_NUMBER, &m->nu);
        tree_require(t, nu, m->nu > -1 && m->nu < 0.5, "nu = %.9g: it must be above -1 and below 0.5", m->nu);
        bounded(t, rho, "rho", DIMENSION_DENSITY, 1e-3, 1e5, " kg/m3", &m->rho_kg_m3);
        for (size_t j = 0; j < i; j++)
            tree_require(t, map, strcmp(m->label, scene->material[j].label) != 0,
                         "label '%s' has a material already, in line %ld", m->label, scene->material[j].line);
    }
    scene->material_count = count;
}

static void fixed(struct tree *t, tree_node list, struct scene *scene)
{
    size_t count = tree_list(t, list, "fixed", SCENE_MAX_FIXED);
    for (size_t i = 0; i < count; i++) {
        tree_node map = tree_item(t, list, i);
        if (!tree_map(t, map, "fixed", KEYS("box", "sphere", "plane", "label", "patch", "axis_end", "components")))
            return;
        struct scene_fixed *f = &scene->fixed[i];
        selection(t, map, "fixed", &f->where);
        tree_node components = tree_find(t, map, "components");
        size_t named = tree_list(t, components, "components", 3);
        tree_require(t, components, named > 0, "components is empty");
        for (int c = 0; c < 3; c++)
            f->component[c] = !components;
        for (size_t k = 0; k < named; k++) {
            tree_node item = tree_item(t, components, k);
            int c = tree_choice(t, item, "components", KEYS("x", "y", "z"));
            tree_require(t, item, c < 0 || !f->component[c], "components names %c twice", "xyz"[c < 0 ? 0 : c]);
            if (c >= 0)
                f->component[c] = true;
        }
    }
    scene->fixed_count = count;
}

static void ligaments(struct tree *t, tree_node list, struct scene *scene)
{
    size_t count = tree_list(t, list, "ligaments", SCENE_MAX_LIGAMENTS);
    for (size_t i = 0; i < count; i++) {
        tree_node map = tree_item(t, list, i);
        if (!tree_map(t, map, "ligaments",
                      KEYS("box", "sphere", "plane", "label", "patch", "axis_end", "stiffness", "direction")))
            return;
        struct scene_ligament *l = &scene->ligament[i];
        selection(t, map, "ligaments", &l->where);
        bounded(t, tree_need(t, map, "ligaments", "stiffness"), "stiffness", DIMENSION_STIFFNESS, 1e-6, 1e12, " N/m",
                &l->stiffness_N_m);
        tree_direction(t, tree_need(t, map, "ligaments", "direction"), "direction", l->direction);
    }
    scene->ligament_count = count;
}

static void body(struct tree *t, tree_node map, struct scene *scene)
{
    if (!tree_map(t, map, "body", KEYS("mesh", "materials", "fixed", "ligaments", "allow_components")))
        return;
    mesh(t, tree_need(t, map, "body", "mesh"), scene);
    materials(t, tree_need(t, map, "body", "materials"), scene);
    fixed(t, tree_find(t, map, "fixed"), scene);
    ligaments(t, tree_find(t, map, "ligaments"), scene);
    tree_flag(t, tree_find(t, map, "allow_components"), "allow_components", &scene->allow_components);
}

static void tip(struct tree *t, tree_node map, struct scene_instrument *instrument)
{
    if (!tree_map(t, map, "tip", KEYS("radius", "points")))
        return;
    tree_node radius = tree_find(t, map, "radius"), points = tree_find(t, map, "points");
    bounded(t, radius, "radius", DIMENSION_LENGTH, MIN_LENGTH_m, SCENE_MAX_TIP_RADIUS_m, " m",
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
    bounded(t, stiffness, "stiffness", DIMENSION_STIFFNESS, 1, 1e6, " N/m", &instrument->coupling_stiffness_N_m);
    bounded(t, damping, "damping", DIMENSION_DAMPING, 1e-3, 1e3, " N s/m", &instrument->coupling_damping_Ns_m);
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
        position(t, tree_need(t, trocar, "trocar", "at"), "at", instrument->trocar_m);
        tree_direction(t, tree_need(t, trocar, "trocar", "axis"), "axis", instrument->axis);
        instrument->placed = true;
    }
    length(t, tree_find(t, map, "length"), device, instrument);
    tip(t, tree_find(t, map, "tip"), instrument);
    coupling(t, tree_find(t, map, "coupling"), device, instrument);
    tree_node force = tree_find(t, map, "force_limit");
    bounded(t, force, "force_limit", DIMENSION_FORCE, 1e-3, device->force_limit_N, " N", &instrument->force_limit_N);
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
    if (count)
        scene->instrument_count = count;
}

static void contact(struct tree *t, tree_node map, struct scene *scene)
{
    if (!map || !tree_map(t, map, "contact", KEYS("regularisation", "steps")))
        return;
    tree_node node = tree_find(t, map, "regularisation");
    bounded(t, node, "regularisation", DIMENSION_RATIO, SCENE_MIN_REGULARISATION, 1, " of the median compliance",
            &scene->regularisation);
    tree_node steps = tree_find(t, map, "steps");
    double count = 0;
    tree_quantity(t, steps, "steps", DIMENSION_NUMBER, &count);
    bool good = count >= 1 && count <= BANK_MAX_SOLVER_STEPS && count == floor(count);
    tree_require(t, steps, good, "steps = %g: a whole number from 1 to %d is needed", count, BANK_MAX_SOLVER_STEPS);
    if (steps && good)
        scene->solver_steps = (unsigned)count;
}

/* This version has no effects: an empty mapping is the only one that can be met. */
static void effects(struct tree *t, tree_node map)
{
    if (tree_empty(t, map))
        return;
    tree_node key = map;
    if (map->type == YAML_MAPPING_NODE)
        key = yaml_document_get_node(&t->document, map->data.mapping.pairs.start->key);
    bool word = key->type == YAML_SCALAR_NODE;
    tree_fail(t, key, STATUS_SCENE_KEY, "write effects: {}", "effect%s%.60s%s is not known; this version offers: none",
              word ? " '" : "", word ? (const char *)key->data.scalar.value : "", word ? "'" : "");
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
    bounded(t, bank, "bank", DIMENSION_BYTES, 1, 4294967295.0, " B", &scene->budget_bank_bytes);
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
        body(&tree, tree_need(&tree, root, "the scene", "body"), scene);
        instruments(&tree, tree_find(&tree, root, "instruments"), scene);
        contact(&tree, tree_find(&tree, root, "contact"), scene);
        effects(&tree, tree_find(&tree, root, "effects"));
        budget(&tree, tree_find(&tree, root, "budget"), scene);
    }
    status = tree.status;
    tree_close(&tree);
    return status;
}
