/* Which rigid motions of a body nothing holds. */
#ifndef TROCAR_RIGID_H
#define TROCAR_RIGID_H

#include "failure.h"
#include "mesh.h"

/* A support: the displacement of `node` along `direction` is held, by a fixed component or a spring. */
struct support {
    uint32_t node;
    double direction[3]; /* unit vector */
};

/* Refuse with STATUS_MODEL_FREE_MOTION when a connected piece of the mesh keeps a rigid motion that no support resists,
 * and say in words which: the null space of the supports' rows on the six rigid modes of the piece. A rotation counts
 * as free when the supports' lever arms are below 1e-6 of the piece's size: coordinates in single-precision files are
 * no better. `place` is the scene or mesh to name. */
int rigid_check(const struct mesh *mesh, size_t count, const struct support *support, const char *place,
                struct failure *why);

#endif
