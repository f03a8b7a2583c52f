/* The linear tetrahedron (P1) [C97 1; P01]. Vertices P0..P3 in positive orientation, rest volume V0 in m3. The shape
 * vector alpha_j is the gradient of the barycentric coordinate j (1/m): constant in the element, their sum is zero, and
 * the displacement gradient is sum_j U_j (x) alpha_j. */
#ifndef TROCAR_ELEMENT_H
#define TROCAR_ELEMENT_H

#include <stddef.h>
#include <stdint.h>

struct element {
    double volume_m3;
    double shape_1_m[4][3];
};

struct lame {
    double lambda_Pa, mu_Pa;
};

/* lambda = E nu / ((1 + nu)(1 - 2 nu)), mu = E / (2 (1 + nu)); [C97 1.34] prints the second as nu. */
struct lame lame_from_young(double E_Pa, double nu);

/* Geometry of one element; `nodes` has 3 coordinates per node, m. */
struct element element_geometry(const double *nodes, const uint32_t vertex[4]);

/* Add the stiffness between vertices j and k to the row-major 3 x 3 `block`, N/m: force on j under a displacement of k,
 * K_jk = V0 [lambda alpha_j (x) alpha_k + mu (alpha_k (x) alpha_j + (alpha_j . alpha_k) I)], twice the B_jk of the
 * energy (theory.md 1). [P01 eq. 8, 14] leaves V0 out. */
void element_add_block(const struct element *element, struct lame material, int j, int k, double block[9]);

#endif
