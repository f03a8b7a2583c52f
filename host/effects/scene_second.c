#include "scene_second.h"

#include <stdlib.h>

#include "scene.h"

void scene_second_parse(struct tree *tree, void *map, struct scene *scene)
{
    (void)tree, (void)map, (void)scene;
}

void scene_second_print(FILE *out, const struct scene *scene)
{
    (void)out, (void)scene;
}

int scene_second_section(const struct scene *scene, struct body *body, struct effect_section *section,
                         struct failure *why)
{
    (void)body;
    struct bank_second *b = malloc(sizeof *b);
    if (!b)
        return failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect second");
    *b = (struct bank_second){.points = {scene->instrument[0].tip_points, scene->instrument[1].tip_points}};
    *section = (struct effect_section){.bytes = b, .length = sizeof *b, .count = 1};
    return STATUS_OK;
}
