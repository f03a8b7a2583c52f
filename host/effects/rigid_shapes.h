/* What there is to draw of the rigid things of a bank (shared/effects/rigid.md): obstacles where they stand, and the parts of the
 * instruments along their shafts, which move with them. */
#ifndef TROCAR_RIGID_SHAPES_H
#define TROCAR_RIGID_SHAPES_H

#include <math.h>
#include <stddef.h>

#include "bank_view.h"

enum rigid_shape_kind {
    RIGID_SHAPE_OBSTACLE, /* a hull in the world */
    RIGID_SHAPE_CANNULA,  /* a capsule on the instrument's axis */
    RIGID_SHAPE_SHAFT,    /* the same */
    RIGID_SHAPE_TIP       /* a ball at the tip, where it is thicker than the shaft */
};

struct rigid_shape {
    enum rigid_shape_kind kind;
    double radius_m;           /* swept around the hull or the axis */
    const float (*point_m)[3]; /* of an obstacle, in the bank */
    size_t points;
    unsigned instrument; /* else: whose it is, */
    double from_m, to_m; /* and from where to where along the axis, from the trocar on; INFINITY: to the tip */
};

enum { RIGID_SHAPES_MAX = BANK_MAX_OBSTACLES + 3 * BANK_MAX_INSTRUMENTS };

/* How many there are; 0 when the bank does not name the effect. */
size_t rigid_shapes(const struct bank_view *bank, struct rigid_shape shape[RIGID_SHAPES_MAX]);

#endif
