/* The linear (P1) and the quadratic (P2) tetrahedron with straight edges [C97 1; P01]. Corners P0..P3 in positive
 * orientation, rest volume V0 in m3. The shape vector alpha_j is the gradient of the barycentric coordinate L_j (1/m):
 * constant in the element, their sum is zero.
 *   P1: nodes 0..3 with shape functions L_j; the displacement gradient is sum_j U_j (x) alpha_j.
 *   P2: nodes 0..3 with L_j (2 L_j - 1), then the middles of the edges 01 02 03 12 13 23 with 4 L_j L_k. */
#ifndef TROCAR_ELEMENT_H
#define TROCAR_ELEMENT_H

#include <stddef.h>
#include <stdint.h>

#include "scene.h"

struct element {
    double volume_m3;
    double shape_1_m[4][3];
};

struct lame {
    double lambda_Pa, mu_Pa;
};
struct hooke;

/* Corners at the ends of each edge. */
extern const unsigned char element_edge[6][2];

/* 4 or 10. */
size_t element_nodes(enum element_order order);

/* lambda = E nu / ((1 + nu)(1 - 2 nu)), mu = E / (2 (1 + nu)); [C97 1.34] prints the second as nu. */
struct lame lame_from_young(double E_Pa, double nu);

/* Geometry of one element; `nodes` has 3 coordinates per node, m. */
struct element element_geometry(const double *nodes, const uint32_t vertex[4]);

/* Gradients of the shape functions at barycentric coordinates L, 1/m: element_nodes(order) of them. */
void element_gradients(const struct element *element, enum element_order order, const double L[4],
                       double (*gradient)[3]);

/* Add the stiffness between nodes j and k to the row-major 3 x 3 `block`, N/m: force on j under a displacement of k,
 *   K_jk = int [lambda g_j (x) g_k + mu (g_k (x) g_j + (g_j . g_k) I)] dV, with g the gradients of the shape functions,
 * for P1 V0 [...] with g = alpha, twice the B_jk of the energy (theory.md 1); [P01 eq. 8, 14] leaves V0 out; for an
 * anisotropic material (hooke.h) (K_jk)_ac = int sum over bd of C_abcd (g_j)_b (g_k)_d dV. Integrated in closed form: the
 * products are polynomials of degree 2 at most.
 *
 * P2 takes the part lambda tr(eps)^2 (hooke.h: volume_Pa) of the element's mean of tr(eps), lambda V0 mean(g_j) (x)
 * mean(g_k): elements with a constant pressure do not lock as nu goes to 1/2, where full integration is 12 % too stiff, and
 * are truer below, too [mean dilatation: Nagtegaal, Parks and Rice 1974; Hughes, The Finite Element Method, 4.4]. Fields
 * that are linear in the element are as exact as before. */
void element_add_block(const struct element *element, const struct hooke *material, enum element_order order, size_t j,
                       size_t k, double block[9]);

#endif
