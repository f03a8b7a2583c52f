/* `effects: {quasi_nonlinear: {fit: curve.csv, height: 13 mm, radius: 15 mm}}`: the force of compressions that were measured
 * (shared/effects/quasi_nonlinear.md). Either
 *   fit       a table of them (cylinder_fit.h), relative to the scene's folder, with the sample's `height` and `radius`, and `E` and `nu`
 *             of its linear answer (the body's); `degree`: the least of the curves
 * or the curves themselves, as a bank's scene has them:
 *   Q, P      {range, coefficients}: y = sum coefficient_k (x / range)^k, k from 1 to 10; Q in N, P in m and not needed
 * and, with both, `share`: newtons of the sample to one of the tool. */
#ifndef TROCAR_SCENE_QUASI_NONLINEAR_H
#define TROCAR_SCENE_QUASI_NONLINEAR_H

#include <stdio.h>

#include "cylinder_fit.h"

struct body;
struct effect_section;
struct failure;
struct scene;
struct tree;

struct scene_quasi_nonlinear {
    struct cylinder_fit fit; /* of the curves only degree, coefficients and range when they were given */
    struct sample sample;    /* with a table */
    unsigned degree;
    double share;
    char fit_path[1024]; /* of the table; "" when none */
};

#define SCENE_DEFAULT_CURVE_DEGREE 4 /* [C97 3.4.2]: 4 to 10 */

void scene_quasi_nonlinear_parse(struct tree *tree, void *map, struct scene *scene);
void scene_quasi_nonlinear_print(FILE *out, const struct scene *scene);
int scene_quasi_nonlinear_section(const struct scene *scene, struct body *body, struct effect_section *section,
                                  struct failure *why);

#endif
