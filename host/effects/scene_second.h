/* A second entry of a scene's `instruments`: two instruments in one body (shared/effects/second.md). It has no key of its own. */
#ifndef TROCAR_SCENE_SECOND_H
#define TROCAR_SCENE_SECOND_H

#include <stdio.h>

struct body;
struct effect_section;
struct failure;
struct scene;
struct tree;

/* All that it holds is said by the instruments. */
struct scene_second {
    int nothing;
};

/* Of struct effect; never asked. */
void scene_second_parse(struct tree *tree, void *map, struct scene *scene);
void scene_second_print(FILE *out, const struct scene *scene);
int scene_second_section(const struct scene *scene, struct body *body, struct effect_section *section,
                         struct failure *why);

#endif
