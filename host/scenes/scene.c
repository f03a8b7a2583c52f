#include "scene.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "device.h"
#include "tree.h"

int scene_read(const char *path, struct scene *scene, struct failure *why)
{
    FILE *file = fopen(path, "rb");
    if (!file)
        return failure_set(why, STATUS_FILE_OPEN, path, NULL, "cannot open the scene: %s", strerror(errno));
    /* One byte more than a scene may have: tree_open then refuses the length, and an endless file is not read on. */
    char *text = malloc(TREE_MAX_BYTES + 1);
    if (!text) {
        fclose(file);
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory to read the scene");
    }
    errno = 0;
    size_t length = fread(text, 1, TREE_MAX_BYTES + 1, file);
    int status = STATUS_OK;
    if (ferror(file))
        status = failure_set(why, STATUS_FILE_READ, path, NULL, "cannot read the scene: %s", strerror(errno));
    fclose(file);
    if (!status)
        status = scene_parse(text, length, path, scene, why);
    free(text);
    return status;
}

void scene_assume_instrument(struct scene_instrument *instrument)
{
    const struct device_model *device = device_model_find(SCENE_DEFAULT_DEVICE);
    *instrument = (struct scene_instrument){
        .name = "right",
        .device = SCENE_DEFAULT_DEVICE,
        .length_min_m = device->axis[2].minimum,
        .length_max_m = device->axis[2].maximum,
        .tip_radius_m = SCENE_DEFAULT_TIP_RADIUS_m,
        .tip_points = SCENE_DEFAULT_TIP_POINTS,
    };
}

/* A scene's name from a file's: what is not allowed in a name becomes '-'. */
static void name_from_path(const char *path, char *name, size_t size)
{
    const char *slash = strrchr(path, '/'), *base = slash ? slash + 1 : path;
    const char *point = strrchr(base, '.');
    size_t length = point && point > base ? (size_t)(point - base) : strlen(base);
    if (length >= size)
        length = size - 1;
    static const char allowed[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
    size_t used = 0;
    for (size_t i = 0; i < length; i++) {
        bool good = base[i] && strchr(allowed, base[i]);
        if (used == 0 && (!good || strchr("._-", base[i])))
            continue;
        name[used++] = good ? base[i] : '-';
    }
    name[used] = 0;
    if (!used)
        snprintf(name, size, "body");
}

void scene_assume(const char *mesh_path, double extent_m, enum mesh_unit unit, struct scene *scene)
{
    *scene = (struct scene){
        .extent_m = extent_m,
        .unit = extent_m > 0 ? MESH_UNIT_NONE : unit,
        .order = SCENE_DEFAULT_ORDER,
        .regularisation = SCENE_DEFAULT_REGULARISATION,
        .material_count = 1,
        .fixed_count = 1,
        .instrument_count = 1,
        .material = {{.label = "all", .E_Pa = 4000, .nu = 0.45, .rho_kg_m3 = 1060}},
        .fixed = {{.where = {.kind = SELECT_AXIS_END, .value = 0.04}, .component = {true, true, true}}},
    };
    snprintf(scene->mesh_path, sizeof scene->mesh_path, "%s", mesh_path);
    name_from_path(mesh_path, scene->name, sizeof scene->name);
    scene_assume_instrument(&scene->instrument[0]);
}
