/* How far a discretisation is from the body that it stands for: its stiffness under a tool of a given radius (patch.h),
 * pressed along the normal at random sites, against the same body with every element cut into eight, quadratic. That is the
 * mesh's error, not the bank's, which is measured apart against the exact solve of the same discretisation; and both are
 * linear elasticity.
 *
 * Stiffness is force over the displacement of the tool, both under the tool's weights. A site is the centre of a triangle of
 * the coarse surface, which is also the centre of a part of it when it is cut. The scene's selections hold each mesh as they
 * find it, so a share of the vertices may be a slightly other region; sites keep the larger radius away from what is held. */
#ifndef TROCAR_MESH_ERROR_H
#define TROCAR_MESH_ERROR_H

#include <stdint.h>

#include "bank.h"
#include "patch.h"

enum { MESH_ERROR_SITES = 12, MESH_ERROR_RADII = 2 };

/* Displacement of the tool along `normal` under a unit force along it, m/N. */
int tool_compliance(struct model *model, const struct patch *tool, const double normal[3], double *compliance_m_N,
                    struct failure *why);

/* Centre of a triangle of the surface, and the triangle whose centre is nearest to a point. */
void triangle_centre(const struct mesh *mesh, const struct surface *surface, uint32_t triangle, double centre_m[3]);
uint32_t triangle_at(const struct mesh *mesh, const struct surface *surface, const double centre_m[3]);

/* The truth at the sites. */
struct mesh_truth {
    size_t sites; /* 0: none found, or not made */
    double radius_m[MESH_ERROR_RADII];
    double centre_m[MESH_ERROR_SITES][3], normal[MESH_ERROR_SITES][3];
    double compliance_m_N[MESH_ERROR_SITES][MESH_ERROR_RADII];
};
/* On `body` refined once and quadratic, at sites of its surface drawn from `seed`, for tools of these radii. STATUS_MEMORY when that
 * is too large. */
int mesh_truth_make(const struct body *body, const double radius_m[MESH_ERROR_RADII], uint64_t seed,
                    struct mesh_truth *truth, struct failure *why);

/* |stiffness / true stiffness - 1| over the sites. */
struct mesh_error {
    double mean, max;
};
/* `body`: a discretisation of the same body, as coarse as that of mesh_truth_make or cut finer. */
int mesh_error_measure(const struct mesh_truth *truth, struct body *body, struct mesh_error *error,
                       struct failure *why);

#endif
