/* Which material each element has, and its elastic tensor. Costs nothing at run time: it is spent in the bank. */
#ifndef TROCAR_MATERIAL_H
#define TROCAR_MATERIAL_H

#include "hooke.h"
#include "mesh.h"

struct materials {
    struct hooke *hooke; /* one per material of the scene */
    uint32_t *of;        /* per element: its number in `hooke` */
    double mass_kg;      /* of the body */
};

/* Every material of the scene is stable (hooke.h) and has a density; no mesh is needed. STATUS_MODEL_MATERIAL. */
int material_check(const struct scene *scene, struct failure *why);

/* By the elements' labels (scene_materials). Free with material_free, also after a failure. */
int material_find(const struct scene *scene, const struct mesh *mesh, struct materials *materials, struct failure *why);
void material_free(struct materials *materials);

#endif
