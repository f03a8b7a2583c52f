/* What the contact solver leaves when its bound of steps or sweeps stops it: the force of each tick of a recording against that of the
 * same tick, from the same state and on the same bank, with a solver that goes on to its rest. Nothing else differs between the two, so
 * what the points, the rounding and the effects do is no part of it. The next tick goes on from the bounded one. */
#ifndef TROCAR_SOLVER_ERROR_H
#define TROCAR_SOLVER_ERROR_H

#include "recording.h"

/* |f - f_rest| of the ticks in contact, in parts of the largest |f_rest|. */
int solver_error_measure(const struct bank_view *bank, const struct recording *recording, struct tick_error *error,
                         struct failure *why);

#endif
