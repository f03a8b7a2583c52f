/* `effects: {swing: {modes: 4, damping: 0.1}}`: the body's slowest vibrations (shared/effects/swing.md). */
#ifndef TROCAR_SCENE_SWING_H
#define TROCAR_SCENE_SWING_H

#include <stdio.h>

struct body;
struct effect_section;
struct failure;
struct scene;
struct tree;

#define SCENE_DEFAULT_MODES         4
#define SCENE_DEFAULT_SWING_DAMPING 0.1

struct scene_swing {
    unsigned modes; /* 1 .. BANK_MAX_MODES */
    double damping; /* of critical, the same for each: above 0, to 1 */
};

void scene_swing_parse(struct tree *tree, void *map, struct scene *scene);
void scene_swing_print(FILE *out, const struct scene *scene);
/* Finds the modes: a dozen solves with the model's factor. SCENE_VALUE when one of them is too fast for the tick, or the body
 * has none; MODEL_FACTOR, MEMORY, INTERRUPTED. */
int scene_swing_section(const struct scene *scene, struct body *body, struct effect_section *section,
                        struct failure *why);

#endif
