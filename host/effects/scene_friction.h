/* `effects: {friction: {mu: 0.2, sweeps: 10}}`: Coulomb friction between instruments and tissue (shared/effects/friction.md). */
#ifndef TROCAR_SCENE_FRICTION_H
#define TROCAR_SCENE_FRICTION_H

#include <stdio.h>

struct body;
struct effect_section;
struct failure;
struct scene;
struct tree;

#define SCENE_DEFAULT_SWEEPS 10

struct scene_friction {
    double mu;       /* above 0, to BANK_MAX_FRICTION */
    unsigned sweeps; /* 1 .. BANK_MAX_SWEEPS: bound of the contact solver in a tick */
};

void scene_friction_parse(struct tree *tree, void *map, struct scene *scene);
void scene_friction_print(FILE *out, const struct scene *scene);
int scene_friction_section(const struct scene *scene, struct body *body, struct effect_section *section,
                           struct failure *why);

#endif
