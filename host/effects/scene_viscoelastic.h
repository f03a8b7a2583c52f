/* `effects: {viscoelastic: {prony: [[0.3, 0.05 s]]}}`: tissue that relaxes (shared/effects/viscoelastic.md). Exactly one of
 *   prony                a list of up to 8 pairs [share, time], and viscosity (a time: C/k), or one of the two
 *   kelvin_voigt         {k, C}
 *   boltzmann            {k1, k2, C}
 *   maxwell_kelvin_voigt {k1, k2, C}; moduli, viscosities: only their ratios count, the magnitude is the materials'
 *   fit                  a table of measurements (prony_fit.h), relative to the scene's folder
 * All are a Prony series in memory, and printed as one: a bank's scene does not need the table. */
#ifndef TROCAR_SCENE_VISCOELASTIC_H
#define TROCAR_SCENE_VISCOELASTIC_H

#include <stdio.h>

#include "prony.h"

struct body;
struct effect_section;
struct failure;
struct scene;
struct tree;

struct scene_viscoelastic {
    struct prony series;
    char fit_path[1024]; /* of the table that it was fitted to; "" when none */
};

void scene_viscoelastic_parse(struct tree *tree, void *map, struct scene *scene);
void scene_viscoelastic_print(FILE *out, const struct scene *scene);
int scene_viscoelastic_section(const struct scene *scene, struct body *body, struct effect_section *section,
                               struct failure *why);

#endif
