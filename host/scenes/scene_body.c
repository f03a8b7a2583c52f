/* The keys of `body`, but for its materials. Every key, its unit, default and range stand in SCENE.md. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "scene_keys.h"

void scene_bounded(struct tree *t, tree_node node, const char *name, enum dimension dimension, double low, double high,
                   const char *shown, double *value)
{
    tree_quantity(t, node, name, dimension, value);
    tree_require(t, node, *value >= low && *value <= high, "%s = %.9g%s: it must be from %g to %g", name, *value, shown,
                 low, high);
}

void scene_position(struct tree *t, tree_node node, const char *name, double at[3])
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
        scene_position(t, tree_need(t, node, "box", "from"), "from", where->a);
        scene_position(t, tree_need(t, node, "box", "to"), "to", where->b);
        for (int i = 0; i < 3; i++)
            tree_require(t, node, where->a[i] <= where->b[i], "box: from %g m is above to %g m along %c", where->a[i],
                         where->b[i], "xyz"[i]);
        break;
    case SELECT_SPHERE:
        if (!tree_map(t, node, "sphere", KEYS("at", "radius")))
            return;
        scene_position(t, tree_need(t, node, "sphere", "at"), "at", where->a);
        scene_bounded(t, tree_need(t, node, "sphere", "radius"), "radius", DIMENSION_LENGTH, SCENE_MIN_LENGTH_m,
                      SCENE_MAX_LENGTH_m, " m", &where->value);
        break;
    case SELECT_PLANE:
        if (!tree_map(t, node, "plane", KEYS("at", "normal")))
            return;
        scene_position(t, tree_need(t, node, "plane", "at"), "at", where->a);
        tree_direction(t, tree_need(t, node, "plane", "normal"), "normal", where->b);
        break;
    case SELECT_LABEL:
        tree_text(t, node, "label", where->label, sizeof where->label);
        break;
    case SELECT_PATCH:
        if (!tree_map(t, node, "patch", KEYS("near", "share")))
            return;
        scene_position(t, tree_need(t, node, "patch", "near"), "near", where->a);
        share(t, node, "patch", &where->value);
        break;
    case SELECT_AXIS_END:
        if (tree_map(t, node, "axis_end", KEYS("share")))
            share(t, node, "axis_end", &where->value);
        break;
    }
}

void scene_file(struct tree *t, tree_node node, char *path, size_t size)
{
    char file[1024] = "";
    tree_text(t, node, "file", file, sizeof file);
    const char *slash = strrchr(t->path, '/');
    int folder = file[0] != '/' && slash ? (int)(slash - t->path) + 1 : 0;
    int length = snprintf(path, size, "%.*s%s", folder, t->path, file);
    tree_require(t, node, (size_t)length < size, "file: the path is longer than %zu bytes", size - 1);
}

static void mesh(struct tree *t, tree_node map, struct scene *scene)
{
    if (!tree_map(t, map, "mesh", KEYS("file", "extent", "unit", "size", "order")))
        return;
    scene_file(t, tree_need(t, map, "mesh", "file"), scene->mesh_path, sizeof scene->mesh_path);
    tree_node extent = tree_find(t, map, "extent"), unit = tree_find(t, map, "unit"), size = tree_find(t, map, "size");
    if (!extent && !unit)
        tree_fail(t, map, STATUS_SCENE_MISSING, "add extent: LENGTH (of the longest side) or unit: m, cm or mm",
                  "mesh needs 'extent' or 'unit': files do not say their length unit");
    if (extent && unit)
        tree_fail(t, unit, STATUS_SCENE_VALUE, "keep one of them", "mesh has both 'extent' and 'unit'");
    scene_bounded(t, extent, "extent", DIMENSION_LENGTH, SCENE_MIN_LENGTH_m, SCENE_MAX_LENGTH_m, " m",
                  &scene->extent_m);
    static const enum mesh_unit unit_of[] = {MESH_UNIT_M, MESH_UNIT_CM, MESH_UNIT_MM};
    int choice = tree_choice(t, unit, "unit", KEYS("m", "cm", "mm"));
    scene->unit = choice < 0 ? MESH_UNIT_NONE : unit_of[choice];
    scene_bounded(t, size, "size", DIMENSION_LENGTH, SCENE_MIN_LENGTH_m, SCENE_MAX_LENGTH_m, " m",
                  &scene->surface_size_m);
    static const enum element_order order_of[] = {ELEMENT_LINEAR, ELEMENT_QUADRATIC};
    choice = tree_choice(t, tree_find(t, map, "order"), "order", KEYS("linear", "quadratic"));
    scene->order = choice < 0 ? SCENE_DEFAULT_ORDER : order_of[choice];
}

/* `along`: the one component that is fixed, in any direction. */
static void fixed_along(struct tree *t, tree_node node, struct scene_fixed *f)
{
    tree_direction(t, node, "along", f->along);
    f->slides = true;
    for (int c = 0; c < 3; c++) {
        f->component[c] = fabs(f->along[c]) == 1;
        f->slides = f->slides && !f->component[c];
    }
}

static void fixed(struct tree *t, tree_node list, struct scene *scene)
{
    size_t count = tree_list(t, list, "fixed", SCENE_MAX_FIXED);
    for (size_t i = 0; i < count; i++) {
        tree_node map = tree_item(t, list, i);
        if (!tree_map(t, map, "fixed",
                      KEYS("box", "sphere", "plane", "label", "patch", "axis_end", "components", "along")))
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
        tree_node along = tree_find(t, map, "along");
        if (along && components)
            tree_fail(t, along, STATUS_SCENE_VALUE, "keep one of them", "fixed has both 'components' and 'along'");
        else if (along)
            fixed_along(t, along, f);
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
        scene_bounded(t, tree_need(t, map, "ligaments", "stiffness"), "stiffness", DIMENSION_STIFFNESS, 1e-6, 1e12,
                      " N/m", &l->stiffness_N_m);
        tree_direction(t, tree_need(t, map, "ligaments", "direction"), "direction", l->direction);
    }
    scene->ligament_count = count;
}

void scene_body(struct tree *t, tree_node map, struct scene *scene)
{
    if (!tree_map(t, map, "body", KEYS("mesh", "intensities", "materials", "fixed", "ligaments", "allow_components")))
        return;
    mesh(t, tree_need(t, map, "body", "mesh"), scene);
    scene_intensity_source(t, tree_find(t, map, "intensities"), scene);
    scene_material_list(t, tree_need(t, map, "body", "materials"), scene);
    fixed(t, tree_find(t, map, "fixed"), scene);
    ligaments(t, tree_find(t, map, "ligaments"), scene);
    tree_flag(t, tree_find(t, map, "allow_components"), "allow_components", &scene->allow_components);
}
