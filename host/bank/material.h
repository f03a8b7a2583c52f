/* Which material each element has, and its elastic tensor. Costs nothing at run time: it is spent in the bank. */
#ifndef TROCAR_MATERIAL_H
#define TROCAR_MATERIAL_H

#include "hooke.h"
#include "mesh.h"

struct materials {
    struct hooke *hooke; /* one per material of the scene, then one per element whose directions are data */
    uint32_t *of;        /* per element: its number in `hooke` */
    double *mass_kg;     /* per element */
};

/* Every material of the scene is stable (hooke.h) and has a density; no mesh is needed. STATUS_MODEL_MATERIAL. */
int material_check(const struct scene *scene, struct failure *why);

/* By the elements' labels and intensities (scene_materials). Directions that are node data are averaged over an element's
 * four vertices as axes, without a sign: the principal axis of the mean of d (x) d. A vertex without a direction, or four
 * that cancel (no axis has twice the weight of the next), are STATUS_MODEL_DATA. Free with material_free, also after a failure. */
int material_find(const struct scene *scene, const struct mesh *mesh, struct materials *materials, struct failure *why);
void material_free(struct materials *materials);

#endif
