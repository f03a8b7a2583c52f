/* `effects: {shape: {shaft: {...}, jaws: {...}}}`: an instrument of swept spheres (shared/effects/shape.md). */
#ifndef TROCAR_SCENE_SHAPE_H
#define TROCAR_SCENE_SHAPE_H

#include <stdbool.h>
#include <stdio.h>

struct body;
struct bank_shape;
struct effect_section;
struct failure;
struct scene;
struct tree;

/* A capsule: `radius_m` around an axis of `length_m`, sampled by `samples` spheres. */
struct scene_capsule {
    double radius_m, length_m;
    unsigned samples;
};

struct scene_shape {
    char instrument[32]; /* name of the one that has this shape; "" every one */
    struct scene_capsule shaft;
    bool jaws;
    struct scene_capsule jaw; /* samples: of one jaw */
    double opening_rad;       /* between the jaws when they are open */
};

void scene_shape_parse(struct tree *tree, void *map, struct scene *scene);
void scene_shape_print(FILE *out, const struct scene *scene);
/* MEMORY, MESH_TOO_LARGE. */
int scene_shape_section(const struct scene *scene, struct body *body, struct effect_section *section,
                        struct failure *why);

/* Spheres of an instrument with this shape. */
unsigned scene_shape_samples(const struct scene_shape *shape);
/* Share out `samples` spheres, at least 1: two go to the ends of the jaws, one to the shaft's, then one by one (by pairs on the jaws)
 * where neighbours are farthest apart for their radius. */
void scene_shape_spread(struct scene_shape *shape, unsigned samples);
/* The same for the scene's instruments that have the shape. */
void scene_shape_sample(struct scene *scene, unsigned samples);
/* The spheres and openings of the bank's record, and its band; the instruments that do not have the shape keep their points. */
void scene_shape_spheres(const struct scene *scene, struct bank_shape *shape);

#endif
