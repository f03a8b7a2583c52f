/* Slow swing: the body's slowest vibrations, on top of its static answer. A barely held organ swings at 0.7 to 3 Hz, within a
 * hand's motion, and goes on when it is let go.
 *
 * Mode k has the shape s_k on the surface, (m/N)^(1/2), so scaled that s_k s_k' is its share of the compliance (host: modes.h),
 * and the amplitude z_k, N^(1/2) m^(1/2): it follows its load g_k = sum of s_k . f over the forces f on the tissue,
 *
 *   z'' + 2 zeta omega z' + omega^2 z = omega^2 g;        at rest z = g
 *   u = G f + sum_k s_k (z_k - g_k)                        the static displacement, but the modes have their own time
 *
 * exact over a tick whose load is constant: the load of the tick's end, solved together with it. With z = free + drive g,
 *
 *   u = [G - sum_k (1 - drive_k) s_k s_k'] f + sum_k s_k free_k
 *
 * so contacts meet the compliance that is left beside the modes, which is stiffer, and a body that has moved by the second
 * part. G with its modes taken out is positive semidefinite; that the bank's rounding keeps it so is checked each tick
 * (solve of Cholesky), and what would not be is taken out by half, then not at all (counter `withheld`).
 *
 * Collision works on the surface at rest: the tool's points are moved against the swing first, by a linear map of space fitted
 * to each mode; depths then take the mode itself. Validity: shared/effects/swing.md. */
#ifndef TROCAR_SWING_H
#define TROCAR_SWING_H

#include "bank_view.h"
#include "contact.h"

struct swing {
    float amplitude[BANK_MAX_MODES];             /* z */
    float speed[BANK_MAX_MODES];                 /* z' / omega */
    float free[BANK_MAX_MODES];                  /* z at the end of this tick if there were no load */
    float moved_m[CONTACT_MAX][3];               /* per point of the tool: what was taken from its position */
    float shape[CONTACT_MAX][BANK_MAX_MODES][3]; /* s at each contact of the set */
    float push[CONTACT_MAX][BANK_MAX_MODES];     /* s . n */
    float part;        /* of the modes that this tick's system leaves to them: 1, a half or 0 */
    uint32_t withheld; /* counter: ticks in which that was not 1 */
};

int swing_open(struct bank_view *view);

/* The stages of hooks.h. */
void swing_move(struct swing *s, const struct bank_view *bank, float (*points_m)[3], uint32_t count);
void swing_place(struct swing *s, const struct bank_view *bank, struct contact_set *set);
void swing_respond(struct swing *s, const struct bank_view *bank, struct contact_set *set);
void swing_follow(struct swing *s, const struct bank_view *bank, struct contact_set *set);
void swing_forget(struct swing *s);

#endif
