/* The slowest free vibrations of a body: K phi = omega^2 M phi, with the lumped mass of its model. A barely held organ swings
 * at 0.7 to 3 Hz, within a hand's motion (numerics.md), where the quasi-static answer of the bank is not true.
 *
 * A mode is kept as its share of the compliance: with phi' M phi = 1, the compliance is the sum over all modes of s s', s =
 * R' phi / omega on the surface vertices (projection.h), (m/N)^(1/2). So what is left when some modes are taken out of G is
 * still positive semidefinite. */
#ifndef TROCAR_MODES_H
#define TROCAR_MODES_H

#include <stddef.h>

#include "failure.h"
#include "model.h"

enum { MODES_MAX = 8 };

struct modes {
    size_t count;
    double omega_rad_s[MODES_MAX]; /* rising */
    double *share;                 /* mode after mode, 3 per surface vertex: s */
};

/* By subspace iteration with K's factor (Bathe and Wilson 1973) until the frequencies stand to 1e-9. STATUS_SCENE_VALUE when the
 * body has fewer unknowns or no mass. Free with modes_free, also after a failure. */
int modes_find(struct model *model, size_t count, struct modes *modes, struct failure *why);
void modes_free(struct modes *modes);

#endif
