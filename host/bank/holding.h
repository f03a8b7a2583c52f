/* What holds a body: the scene's fixed nodes and its ligaments, on the nodes of a finite-element space. */
#ifndef TROCAR_HOLDING_H
#define TROCAR_HOLDING_H

#include <stdbool.h>
#include <stddef.h>

#include "failure.h"
#include "material.h"
#include "rigid.h"
#include "scene.h"
#include "space.h"

struct slide {
    uint32_t node;
    double direction[3]; /* unit vector */
};

struct holding {
    bool *fixed;         /* 3 per node of the space: this component does not move */
    double (*spring)[6]; /* per node: xx yy zz xy xz yz of the springs to the ground, N/m; NULL without ligaments */
    struct slide *slide; /* nodes of the space that are fixed along one direction only */
    size_t slides, slide_room;
    struct support *support; /* one per held direction of a mesh node, for rigid_check */
    size_t supports, room;
};

/* A node that slides is held by a spring so many times as stiff as the tissue that it belongs to (mu h summed over its elements):
 * it gives way by a part in that of what it would move. A factor in double precision then loses no more than that either. */
#define HOLDING_SLIDE_STIFFNESS 1e7

/* From the scene. The middle of an edge is fixed in a component when both ends are. A ligament's stiffness is the
 * total of springs k n (x) n spread evenly over the surface triangles whose three vertices it selects; a triangle's part
 * goes to its nodes as a lumped mass does (the diagonal of the mass matrix, scaled): a third to each corner in P1, 3/57 to
 * each corner and 16/57 to each middle in P2. Vertices that span no triangle (points, a line) share it equally. `place` is named in
 * messages. Free with holding_free, also after a failure. */
int holding_find(const struct scene *scene, const struct space *space, const struct surface *surface, const char *place,
                 struct holding *holding, struct failure *why);
/* The springs of the nodes that slide, when the materials are known. */
int holding_stiffen(struct holding *holding, const struct space *space, const struct materials *materials,
                    const char *place, struct failure *why);
void holding_free(struct holding *holding);

#endif
