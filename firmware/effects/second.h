/* A second instrument in the same body: two devices on one bus, one controller, one contact system.
 *
 * Both tools' points are in one set of contacts, so each feels what the other does to the tissue, in the same tick and without
 * iteration; each hangs on its own device (contact.h, `pull`), and each has its own safety state, kinematics and limits
 * (struct instrument of tick.h). An image without this effect has one of each. Here is what the bank must hold for it.
 *
 * While a device is silent its tool stays in the tissue where it was last seen; after SAFETY_STALE_TICKS its contacts are
 * forgotten. Validity: shared/effects/second.md. */
#ifndef TROCAR_SECOND_H
#define TROCAR_SECOND_H

#include <stdbool.h>

#include "bank_view.h"

/* Nothing is remembered beside the instruments themselves. */
struct second {
    uint32_t alone; /* counter: ticks in which one of the two had no sample */
};

/* Two tools, whose points fit one contact system. */
int second_open(struct bank_view *view);

#endif
