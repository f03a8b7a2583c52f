/* Two buses made one: every data or remote frame that comes on one side goes out on the other.
 *
 * An identifier has one sender, so it belongs to the side on which it was heard first. The same identifier on the other side is
 * the bridge's own frame come back (by a second bridge, or both sides being one bus): it is dropped and counted. A side that
 * was silent with an identifier for BRIDGE_MOVE_US loses it: a node may be plugged in elsewhere. */
#ifndef TROCAR_BRIDGE_H
#define TROCAR_BRIDGE_H

#include "backend.h"

enum { BRIDGE_MOVE_US = 2000000, BRIDGE_EXTENDED = 1024, BRIDGE_BURST = 256 };

struct bridge_owner {
    uint32_t id;  /* of extended frames; 11-bit identifiers have their place */
    uint8_t side; /* 1 or 2; 0: not heard */
    uint64_t heard_us;
};

struct bridge_way { /* from one side to the other */
    uint64_t heard, forwarded;
    uint64_t no_room; /* the other side took none in time */
    uint64_t looped;  /* dropped: the identifier is the other side's */
    uint64_t refused; /* FD frames that the other side cannot carry, error frames */
};

struct bridge {
    struct backend *side[2];  /* the caller's; opened with `own` off */
    struct bridge_way way[2]; /* from side[0] to side[1], and back */
    uint64_t downs;           /* times that a side said that it is down */
    struct bridge_owner standard[2048], extended[BRIDGE_EXTENDED];
};

void bridge_start(struct bridge *bridge, struct backend *a, struct backend *b);

/* Wait for a frame on either side, at most `wait_us`, and forward what is there, BRIDGE_BURST of each side at most. Returns how
 * many frames were heard; a failure is final. A side that is down is told once with STATUS_BUS_DOWN or STATUS_BUS_LOST; go on
 * calling. */
int bridge_step(struct bridge *bridge, int64_t wait_us, struct failure *why);

#endif
