/* How many instructions the worst tick of a Cortex-M7 takes, bounded from what the bank says: so that a limit can be kept
 * before there is a controller. "A tick" is firmware's node_finish_tick, from the encoder sample to the frames that wait to
 * be sent; instructions, never microseconds.
 *
 *   WORST_TICK_BASE                            encoders, state, torques, the free points' look ahead
 *   + WORST_TICK_SECOND                        the same of a second instrument
 *   + points     WORST_TICK_POINT              collision: swept and slid along the surface
 *     or, with a shape,  and WORST_TICK_SPHERE   the same for spheres (firmware/effects/shape.c)
 *   + points     WORST_TICK_ROWS               finding their rows, and those ahead, among the decoded ones; none with a plain bank
 *   + m (m + 1)/2 pairs                        the contact system, m = points of all instruments: all of them touch
 *   + steps (m^3, m^2, m)                      the solver uses all its factorisations, each with every contact
 *     or, with friction or grasp, sweeps (m^2, m)   round the contacts, each seeing all others (firmware/effects/cone.c)
 *   + what swing, visco-elastic and neo-Hookean tissue do at every contact, and what is rigid for every pair of its pieces
 *                                              (firmware/effects)
 *   + (row work + overshoot) WORST_TICK_WORK   rows of the factor: the tick's share (CONT row_work) and the portion and
 *                                              product that may pass it; none with a plain bank
 *
 * The coefficients are counts of the firmware's code as GCC makes it, rounded up; tests/rig/budgets.t counts ticks in an
 * emulated Cortex-M7 on recordings that no hand could make and holds them against this bound, tests/rig/worst_tick.t those of
 * the effects with rows at hand. The solver's term is exact in the number of steps or sweeps, which a real motion seldom takes,
 * so the bound lies above what is counted. */
#ifndef TROCAR_WORST_TICK_H
#define TROCAR_WORST_TICK_H

#include <stdbool.h>
#include <stdint.h>

#include "bank_format.h"
#include "scene.h"

#define WORST_TICK_BASE       12000.0
#define WORST_TICK_SECOND     5000.0
#define WORST_TICK_POINT      7200.0
#define WORST_TICK_ROWS       3000.0
#define WORST_TICK_SPHERE     4000.0 /* the nearest place of the surface to its centre, and the lever */
#define WORST_TICK_PAIR       1100.0 /* of contacts that share no vertex, blocks in the table of products */
#define WORST_TICK_PAIR_PLAIN 2060.0 /* blocks read in place */
#define WORST_TICK_CLOSEST    900.0  /* a step towards the closest points of two convex hulls, */
#define WORST_TICK_SUPPORT    30.0   /* and in it for each of their points */
#define WORST_TICK_WORK       1.05   /* instructions per unit of row work (firmware/row_cache.h), and around it */

/* What the effects of a scene add; all 0 without. */
struct worst_effects {
    unsigned sweeps;   /* bound of friction's or grasp's solver, which stands in place of the factorisations */
    bool slides;       /* with friction: each sweep looks for the slip of each contact */
    bool second;       /* instrument */
    unsigned modes;    /* of swing */
    unsigned branches; /* of visco-elastic tissue */
    bool spheres;      /* the points are spheres of a shape: they look for the surface before they meet it */
    bool curved;       /* the forces go through a curve */
    bool corrected;    /* the forces are corrected and pushed again */
    unsigned rigid_pairs, rigid_points, rigid_contacts; /* of what does not give way: scene_rigid.h */
};

/* `points`: of all instruments; `max_blocks`: of the longest row, 0 for a plain bank. */
double worst_tick(const struct bank_contact *contact, struct worst_effects effects, unsigned points,
                  uint32_t max_blocks);

/* The largest row_work with which the worst tick keeps `limit` (0, the image's own bound, when that does; or when limit is
 * 0). False when not even the smallest does: then row_work is 1, and worst_tick says what it takes. */
bool worst_tick_fit(struct bank_contact *contact, struct worst_effects effects, unsigned points, uint32_t max_blocks,
                    double limit);

/* Of the scene. */
struct worst_effects worst_tick_effects(const struct scene *scene);

/* Points of the scene's instruments together. */
unsigned worst_tick_points(const struct scene *scene);

#endif
