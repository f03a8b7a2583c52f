/* The projection of displacements on the hat functions of the shown surface, and its transpose, which spreads forces: the
 * matrix R of the reduced compliance G = R^t K^-1 R (numerics.md).
 *
 * A force p on surface vertices (3 per vertex) loads the body with f = R p; the displacement of the vertices is R^t u, so
 * work is the same on both sides and G is symmetric. For linear elements R picks the vertex itself. For quadratic ones
 * it comes from the functions psi_v that are biorthogonal to the hats phi_w on every triangle,
 *     int_T psi_v phi_w = delta_vw |T|/3,   psi_v = 4 phi_v - 1 on the triangles around v, 0 elsewhere
 * [Wohlmuth, SIAM J. Numer. Anal. 38(3), 2000]: a unit force on v is the traction psi_v / A_v, with A_v = int phi_v,
 * integrated exactly against the quadratic shape functions. Hence
 *   - displacements that are linear on each triangle come back as they are, so a force on v has exactly the resultant and
 *     the moment of a point force at v, and one at barycentric weights w of a triangle, w_1 w_2 w_3 on its vertices,
 *     those of a point force there;
 *   - R has full rank, so G is positive definite;
 *   - int R^t u = int u: the mean displacement over any region of the surface is kept, up to its rim. Spreading over hats
 *     (psi = phi) would widen every load by the variance h^2/4 of an element of size h, soft tools by too much;
 *   - columns are local: the nodes of the triangles around v.
 * Point forces at quadratic nodes are no choice: a corner's share of any smooth traction is nearly zero, and its own
 * compliance is the mesh's. */
#ifndef TROCAR_PROJECTION_H
#define TROCAR_PROJECTION_H

#include "space.h"

/* Column v of R, the same for each of the three components: weight[k] on node[k], start[v] <= k < start[v + 1]. */
struct projection {
    size_t *start;
    uint32_t *node;
    double *weight;
};

int projection_create(const struct space *space, const struct surface *surface, struct projection *projection,
                      struct failure *why);
void projection_free(struct projection *projection);

#endif
