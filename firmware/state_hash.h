/* A number that two controllers share when their states agree: the host runs the same objects on the frames it hears
 * (host/link/mirror.h) and compares. FNV-1a (Fowler, Noll, Vo) over the 32-bit words of what decides the next torques: tick
 * count, safety, joints, contacts with their anchors, forces and energy; not the row cache, whose content follows from
 * the contacts before. About 3 instructions a word, and only in the tick that sends it. */
#ifndef TROCAR_STATE_HASH_H
#define TROCAR_STATE_HASH_H

#include <stdint.h>

#include "tick.h"

uint32_t state_hash(const struct controller *c);

#endif
