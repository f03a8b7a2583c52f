/* The body of a model with large displacements: static equilibrium of the neo-Hookean solid (neo_hookean.h) on the same
 * mesh, elements, fixed nodes and ligaments, under tools that prescribe displacements. The reference for what linear
 * elasticity, and any correction of it, leaves out; not fast: a sparse factor per iteration.
 *
 *   minimise  E(u) = W(u) + springs + |d - B u|^2 / (2 epsilon),     p = (d - B u) / epsilon
 *
 * which is the contact system of the bank, B K^-1 B^t + epsilon I = C + epsilon, where W is quadratic: for small d the
 * forces p on the tissue are those of model_constrained. Newton's method with a line search on E, which an inverted
 * element makes infinite; where the tangent is not positive definite it is stiffened by the linear one. */
#ifndef TROCAR_NONLINEAR_H
#define TROCAR_NONLINEAR_H

#include "model.h"

/* Row r prescribes sum over k of weight[k] direction[3 r ..] . (R^t u)[vertex[k]], start[r] <= k < start[r + 1]: of surface
 * vertices, as a contact point or a tool (patch.h) weights them. */
struct nonlinear_rows {
    size_t count;
    const size_t *start;
    const uint32_t *vertex;
    const double *weight, *direction;
};

struct nonlinear;

/* From a model, which must outlive it. MODEL_MATERIAL when a material is not isotropic. */
int nonlinear_create(struct model *model, struct nonlinear **nonlinear, struct failure *why);
void nonlinear_free(struct nonlinear *nonlinear);

struct nonlinear_report {
    size_t iterations, parts; /* Newton steps; load steps that the way was cut into */
    double energy_J;          /* of the body and its springs */
    double least_volume;      /* smallest J in the body: 1 at rest */
};

/* From an equilibrium under rows that were at rows' present values (u = 0, p = 0 is one), to the one at d (m, one per row).
 * u (model_unknowns) and p (rows->count, N) are in and out: so a curve is followed from depth to depth. epsilon > 0.
 * MODEL_NONLINEAR when no equilibrium is found on the way, naming the share that was reached; MEMORY, INTERRUPTED. */
int nonlinear_press(struct nonlinear *nonlinear, const struct nonlinear_rows *rows, double epsilon_m_N, const double *d,
                    double *u, double *p, struct nonlinear_report *report, struct failure *why);

/* dE/du without the tools: the forces that hold the body at u, N, over unknowns. False when an element is inverted. */
bool nonlinear_force(const struct nonlinear *nonlinear, const double *u, double *force);

#endif
