/* How far a bank's forces are from those of the body that it was made from. The reference is the exact solve of the same
 * discretisation: the compliance G in double precision, before any rounding, with the same regularisation epsilon. This
 * measures the bank, not the mesh's discretisation error.
 *
 * What is drawn, from one seed:
 *   one     one contact
 *   patch   3 .. 10 contacts, one at a random place of each of the triangles nearest to a random spot: a tool that sticks
 *   two     two such patches of 3 .. 5 contacts at two random spots: both jaws, or two instruments
 *   field   the displacement of the whole free surface under the forces of a patch
 * Each tool is rigid and moves by 10 mm, within 30 degrees of the inward normal of its spot, and turns by up to 10 degrees
 * about a random axis through the spot: contact c is displaced by d_c = t + w x (x_c - x_spot), in three dimensions. The
 * forces p solve (Wt G W + epsilon I) p = d. The error is |p - p_exact| / |p_exact| over the vector of all forces of the
 * set (field: of all displacements), and what counts is its 95th percentile and maximum over the sets.
 *
 * Triangles with a fixed vertex are left out. Epsilon is part of both sides: it is the declared compliance of a contact. */
#ifndef TROCAR_COMPRESSION_ERROR_H
#define TROCAR_COMPRESSION_ERROR_H

#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "failure.h"
#include "model.h"
#include "rounding.h"

#define COMPRESSION_ERROR_REFERENCE "exact solve of the same discretisation in double precision"

enum {
    COMPRESSION_ERROR_ONE,
    COMPRESSION_ERROR_PATCH,
    COMPRESSION_ERROR_TWO,
    COMPRESSION_ERROR_FIELD,
    COMPRESSION_ERROR_KINDS
};
#define COMPRESSION_ERROR_ALL ((1u << COMPRESSION_ERROR_KINDS) - 1)
extern const char *const compression_error_kind[COMPRESSION_ERROR_KINDS]; /* "one", "patch", "two", "field" */

struct error_figures {
    double p95, max;
};
struct compression_error {
    size_t trials; /* of each kind but field, which has a quarter */
    struct error_figures of[COMPRESSION_ERROR_KINDS];
};

/* "one 0.05 0.09, patch 0.45 0.78, ...": p95 and maximum of each kind in per cent. */
void compression_error_print(const struct compression_error *error, char *text, size_t room);

/* The surface as the bank holds it. */
struct contact_surface {
    size_t vertices, triangles;
    const struct bank_triangle *triangle;
    const float *positions, *normals; /* 3 per vertex */
    const uint16_t *row_of;           /* per vertex, rows of the bank */
    double regularisation_m_N;
};

/* `at`: per row of the bank its row in G; NULL when they are the same. `factor`: what the bank holds; NULL: G rounded to
 * float32. `kinds`: bit k measures kind k, the others stay 0. STATUS_SCENE_SELECTION when no triangle is free, MEMORY,
 * INTERRUPTED, CHECK_FAILED when a contact system of the bank is not positive definite. */
int compression_error_measure(const struct contact_surface *surface, const struct compliance *G, const uint32_t *at,
                              const struct factor *factor, unsigned kinds, size_t trials, uint64_t seed,
                              struct compression_error *error, struct failure *why);

#endif
