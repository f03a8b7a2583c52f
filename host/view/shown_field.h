/* The displacement that the page shows: all vertices, from the contacts that the links heard, and the swing. */
#ifndef TROCAR_SHOWN_FIELD_H
#define TROCAR_SHOWN_FIELD_H

#include "bank_view.h"
#include "failure.h"
#include "link.h"

/* u: 3 per vertex, m. The contacts of all `count` links (at most BANK_MAX_INSTRUMENTS) together, in one system
 * (field_from_contacts); those whose triangle this bank does not have came from a controller with another bank and are left out.
 * `amplitude`: BANK_MAX_MODES, z of firmware/effects/swing.h, for a bank with swing; NULL: modes are shown at rest. u is then
 * sum_k s_k (z_k - g_k) more, with the load g_k of the contacts' forces. On failure u is zero. */
int shown_field(const struct bank_view *bank, const struct link *links, uint32_t count, const float *amplitude,
                double *u, struct failure *why);

#endif
