/* The second-order answer of a body (second_order.h) at every vertex of its surface, for a tool of one radius (patch.h).
 *
 * Solved at `sites` vertices, coarse to fine (order.h), with three solves and a pass over the elements each; the others take the
 * mean of the solved ones near them, weighted by 1/distance^2, each turned with the surface from its normal to theirs. What is on
 * the far side of a thin lobe, or around an edge, counts less. Where the tool would stand on fixed vertices by more than half there
 * is none: zeros. */
#ifndef TROCAR_SECOND_ORDER_SURFACE_H
#define TROCAR_SECOND_ORDER_SURFACE_H

#include "second_order.h"

struct second_order_surface {
    size_t vertices, solved;
    double (*cubic)[SECOND_ORDER_TERMS]; /* per vertex: T as a form of the linear force, m/N2 */
    double *range_J;                     /* per vertex: second_order_range_J; of those without, the largest */
};

/* `sites` 0: every vertex. SCENE_SELECTION when there is no place for the tool; what second_order_find and patch_create say. */
int second_order_surface_find(struct model *model, const struct mesh *mesh, const struct surface *surface,
                              double radius_m, size_t sites, bool quiet, struct second_order_surface *found,
                              struct failure *why);
void second_order_surface_free(struct second_order_surface *found);

#endif
