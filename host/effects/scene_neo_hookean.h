/* `effects: {neo_hookean: {sites: 600, radius: 5 mm}}`: large displacements (shared/effects/neo_hookean.md). */
#ifndef TROCAR_SCENE_NEO_HOOKEAN_H
#define TROCAR_SCENE_NEO_HOOKEAN_H

#include <stdio.h>

struct body;
struct effect_section;
struct failure;
struct scene;
struct tree;

#define SCENE_DEFAULT_SITES 600
#define SCENE_MIN_SITES     10

struct scene_neo_hookean {
    unsigned sites;  /* vertices that are solved for; the others lie between them */
    double radius_m; /* of the tool; 0: the first instrument's tip */
};

void scene_neo_hookean_parse(struct tree *tree, void *map, struct scene *scene);
void scene_neo_hookean_print(FILE *out, const struct scene *scene);
/* Three solves per site. MODEL_MATERIAL when a material is not isotropic; MODEL_FACTOR, MEMORY, INTERRUPTED. */
int scene_neo_hookean_section(const struct scene *scene, struct body *body, struct effect_section *section,
                              struct failure *why);

#endif
