/* `effects: {rigid: {shaft: 5 mm, cannula: {radius: 6 mm, inside: 30 mm}, obstacles: [{name: rib, hull: [...], radius: 4 mm}]}}`:
 * instruments that touch each other, and what does not give way (shared/effects/rigid.md). */
#ifndef TROCAR_SCENE_RIGID_H
#define TROCAR_SCENE_RIGID_H

#include <stddef.h>
#include <stdio.h>

#include "bank_format.h"

struct body;
struct effect_section;
struct failure;
struct scene;
struct tree;

struct scene_obstacle {
    char name[32];
    double radius_m;
    size_t points;
    double point_m[BANK_MAX_OBSTACLE_POINTS][3];
    long line;
};

struct scene_rigid {
    double shaft_radius_m;                     /* of every instrument; 0: as its tip's */
    double cannula_radius_m, cannula_inside_m; /* 0: no cannula */
    size_t obstacle_count;
    struct scene_obstacle obstacle[BANK_MAX_OBSTACLES];
};

void scene_rigid_parse(struct tree *tree, void *map, struct scene *scene);
/* Once all effects are read: contacts that fit the controller; nothing inside anything while the instruments are drawn back, if the
 * scene places them. SCENE_VALUE. */
void scene_rigid_check(struct tree *tree, void *map, const struct scene *scene);
void scene_rigid_print(FILE *out, const struct scene *scene);
/* Checks the latter also for instruments that the scene does not place. */
int scene_rigid_section(const struct scene *scene, struct body *body, struct effect_section *section,
                        struct failure *why);

/* The contacts that a tick may have at once beside those of the tissue, and the pairs of pieces that it may look at, with the
 * points of both of each summed up. */
unsigned scene_rigid_contacts(const struct scene *scene);
unsigned scene_rigid_pairs(const struct scene *scene, unsigned *points);

#endif
