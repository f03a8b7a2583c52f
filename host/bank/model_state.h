/* Inside of struct model: shared by model.c, solve.c, constrained.c, compliance.c, nonlinear.c and second_order.c only. */
#ifndef TROCAR_MODEL_STATE_H
#define TROCAR_MODEL_STATE_H

#include <cholmod.h>

#include "material.h"
#include "model.h"
#include "projection.h"
#include "space.h"

struct model {
    const struct mesh *mesh;
    const struct surface *surface;
    char place[300]; /* the scene's or the mesh's path, for messages */
    struct space space;
    struct projection projection;
    int32_t *unknown; /* 3 per node of the space: number of the free component, -1 when fixed; rises with node and
                         component */
    uint32_t *node;   /* per unknown: its node */
    size_t unknowns;
    bool *fixed_vertex; /* per surface vertex: all three components fixed */
    double *mass_kg;    /* lumped, per unknown (modes.h) */
    double total_mass_kg;
    struct materials materials;
    double (*spring)[6]; /* per node of the space, as holding.h; NULL without ligaments */
    cholmod_common common;
    cholmod_sparse *K;       /* lower half */
    cholmod_factor *pattern; /* of the factor: order and supernodes; NULL before model_order */
    cholmod_factor *factor;  /* of K, for the solves; NULL before the first */
};

/* A pivot of the Cholesky factor below this part of its own diagonal entry of K is rounding error: nothing holds that
 * unknown but rounding. Independent of the scale of each node, so stiff bone beside soft tissue does not matter:
 * measured at nu = 0.4999, a body with slivers of 0.13 degrees stays above 8e-7; a mechanism falls to some 1e-16. */
#define MODEL_PIVOT_MIN 1e-13

/* Find the elimination order and the pattern of the factor of K, once: METIS' nested dissection of the nodes, whose large
 * separators come last. Compliance and solves share it. */
int model_order(struct model *model, struct failure *why);

/* u = A^-1 f for the columns of f, with a factor L of A. */
int model_solve_with(struct model *model, cholmod_factor *L, size_t columns, const double *f, double *u,
                     struct failure *why);

/* CHOLMOD's status as ours: out of memory or too large, else a factor that does not exist. */
int model_cholmod_failure(struct model *model, const char *what, struct failure *why);

/* K is not positive definite at this unknown: say where in the body. */
int model_indefinite(const struct model *model, size_t unknown, struct failure *why);

#endif
