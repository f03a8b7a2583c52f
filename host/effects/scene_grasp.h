/* `effects: {grasp: {closes: 60 %, opens: 40 %, slip: 2 N}}`: jaws that hold the tissue (shared/effects/grasp.md). */
#ifndef TROCAR_SCENE_GRASP_H
#define TROCAR_SCENE_GRASP_H

#include <stdio.h>

struct body;
struct effect_section;
struct failure;
struct scene;
struct tree;

struct scene_grasp {
    double closes, opens; /* shares of the grip's range, 1 is closed: opens < closes */
    double slip_N;        /* the most that one point of the tool holds */
    unsigned sweeps;      /* 1 .. BANK_MAX_SWEEPS: bound of the contact solver in a tick */
};

void scene_grasp_parse(struct tree *tree, void *map, struct scene *scene);
void scene_grasp_print(FILE *out, const struct scene *scene);
int scene_grasp_section(const struct scene *scene, struct body *body, struct effect_section *section,
                        struct failure *why);

#endif
