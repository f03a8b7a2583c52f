/* The finite-element model of a body: linear [C97 1, P01 with V0] or quadratic tetrahedra as the scene says, linear
 * elasticity, sparse stiffness K, its CHOLMOD factor. Unknowns are the free components only. Forces: K u = f, with f
 * exerted on the body. Surface vertices are loaded and read through R (projection.h), for linear elements the identity. */
#ifndef TROCAR_MODEL_H
#define TROCAR_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "failure.h"
#include "mesh.h"
#include "progress.h"
#include "scene.h"

struct model; /* owns K, the factor and CHOLMOD's workspace; refers to mesh and surface, which must outlive it */

/* Assemble K with the scene's materials, fixed nodes and ligaments. Refuses materials that are not stable, elements
 * without material, empty selections, and a body with free rigid motions, saying which ("rotation about x", ...), per
 * component of the mesh. Does not factor. */
int model_create(const struct scene *scene, const struct mesh *mesh, const struct surface *surface,
                 struct model **model, struct failure *why);
void model_free(struct model *model);

size_t model_unknowns(const struct model *model);
const char *model_discretisation(const struct model *model); /* "P1" or "P2 projected" */
/* Unknown of component c (0..2) of mesh node n, or -1 when it is fixed. */
int32_t model_unknown(const struct model *model, size_t node, int c);
/* One flag per surface vertex: all three components fixed. */
const bool *model_fixed_vertices(const struct model *model);
double model_mass(const struct model *model); /* kg, from the densities */

/* f += R e: a force on component c of a surface vertex, N. Nothing when the component is fixed. */
void model_load(const struct model *model, uint32_t vertex, int c, double force_N, double *f);
/* Component c of R^t u: the displacement of a surface vertex, m; 0 when the component is fixed. */
double model_displacement(const struct model *model, uint32_t vertex, int c, const double *u);

/* y = K x over unknowns (for tests and residuals). */
void model_multiply(const struct model *model, const double *x, double *y);

/* u = K^-1 f for `columns` right-hand sides stored one after the other (model_unknowns each); factors K at first use.
 */
int model_solve(struct model *model, size_t columns, const double *f, double *u, struct failure *why);

/* Reaction of an independent full solve: displacement prescribed on `m` constraint rows, row r being
 * sum_k weight[3r+k] * (R^t u)[vertex[3r+k]] . direction[3r..3r+2] = d[r] (surface vertices), with regularisation epsilon:
 * the Lagrange multipliers p (force exerted on the tissue along each row's direction) solve (B K^-1 B^t + epsilon I) p
 * = d. Dense in m, sparse direct in the body; double precision. `compliance` (m x m, row-major) takes B K^-1 B^t,
 * without epsilon; it may be NULL. With d or p NULL only the compliance is computed. */
int model_constrained(struct model *model, size_t m, const uint32_t *vertex, const double *weight,
                      const double *direction, double epsilon, const double *d, double *p, double *compliance,
                      struct failure *why);

/* Compliance on the surface, G = R^t K^-1 R: rows are the surface vertices that are not wholly fixed, in vertex order; a
 * fixed component of a vertex that is partly fixed has zeros in its row and column. G is n x n blocks, dense column-major
 * 3n x 3n, lower half filled, upper half zero (double, calloc). One sparse elimination that carries the columns of R along
 * (schur.h): no solve per column. Memory 36 n^2 bytes (72 n^2 of address space; the upper half is never touched) and what
 * schur.h says while it runs. Stops within a second of Ctrl-C. row_of[vertex] = row or UINT32_MAX. */
struct compliance {
    size_t rows;
    double *G;                  /* 9 rows^2 */
    uint32_t *row_of;           /* per surface vertex */
    double median_diagonal_m_N; /* median over rows of trace(G_ii)/3 */
};
int compliance_build(struct model *model, bool quiet, struct compliance *compliance, struct failure *why);
void compliance_free(struct compliance *compliance);

#endif
