/* How far the bank's forces are from those of the body that it was made from: random patches of contacts, the bank's
 * compliance against a direct sparse solve in double precision with the displacement prescribed on the same rows.
 * Nothing is shared between the two but mesh, materials and the regularisation. This measures the bank (rounding to
 * float32, later its compression), not the mesh's discretisation error. */
#ifndef TROCAR_FORCE_ERROR_H
#define TROCAR_FORCE_ERROR_H

#include <stddef.h>
#include <stdint.h>

#include "bank.h"
#include "progress.h"

#define FORCE_ERROR_REFERENCE "direct sparse solve of the same mesh in double precision"

struct force_error {
    size_t trials;
    double p95, max; /* of |p - p_direct| / |p_direct| over the vector p of the contact forces of a patch */
};

/* `trials` patches of 1, 3, 6, 10 contacts in turn, drawn from `seed`; prescribed along the normals. `bar` may be NULL. */
int force_error_measure(const struct bank_view *bank, struct body *body, size_t trials, uint64_t seed,
                        struct progress *bar, struct force_error *error, struct failure *why);

#endif
