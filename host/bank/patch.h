/* A tool of a given radius on the surface: contact whose force does not depend on how fine the mesh is.
 *
 * The tool presses with the traction k(r) = 1 - (r/a)^2 on the surface within its radius a of the contact point, r the
 * distance from it. Shared among the vertices by the hat functions phi_v and normalised,
 *     w_v = int k phi_v dA / int k dA,
 * so a unit force has the resultant and the moment of that traction exactly, whatever the mesh: where elements are large
 * beside a the weights become the point's barycentric ones, where they are small, area times kernel. The displacement of
 * the tool is sum_v w_v u_v, the mean of u under the same weights, so its compliance along n is
 *     sum_vw w_v w_w n . G_vw n.
 * Only surface that is connected to the point inside the ball and faces as it does counts, not the far side of a thin
 * lobe. */
#ifndef TROCAR_PATCH_H
#define TROCAR_PATCH_H

#include "failure.h"
#include "mesh.h"

struct patch {
    size_t count;
    uint32_t *vertex; /* rising */
    double *weight;   /* their sum is 1 */
    double centre_m[3];
    double normal[3]; /* outward unit normal, the mean under k */
};

/* The patch around the point with barycentric weights `at` in `triangle`. Integrated with the midpoint rule of degree 2 on
 * parts of a/8 at most: relative error of a weight below 1e-3. A tool below 1/64 of the triangle's longest edge is a point:
 * it has the weights `at`. */
int patch_create(const struct mesh *mesh, const struct surface *surface, uint32_t triangle, const double at[3],
                 double radius_m, struct patch *patch, struct failure *why);
void patch_free(struct patch *patch);

#endif
