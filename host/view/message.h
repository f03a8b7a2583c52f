/* The two binary messages that the page receives. Both are little-endian:
 *
 *   u32 kind (1 hello, 2 frame) | u32 J, a multiple of 4 | J bytes of JSON, padded with spaces | arrays
 *
 * hello, once per connection. JSON: protocol 2, scene, vertices n, triangles t, fixed (count), jaws (the instruments grasp),
 *   force_limit_N, health_names [...], instruments [{name, trocar_m [3], rotation [9] (row-major, columns are the trocar
 *   frame's axes in the world), tip_radius_m, joint_min [3], joint_max [3] (rad, rad, m), opening_rad, spheres [[x, y, z, radius,
 *   along, side] ...] (those two of the effect shape, shared/SPEC.md, SHAP; 0 and none without)} ...], obstacles [{radius_m, points
 *   [[x, y, z] ...]} ...] (of the effect rigid: all that is so near to the points' convex hull), cannula_m [2] (outer radius, 0:
 *   none; how far it reaches inwards).
 *   Arrays: float32 rest positions 3n (m), u16 triangles 3t, u8 fixed flags n.
 *
 * frame, 30 per second of the run. JSON: frame (number from 1), time_s, clients, dropped, malformed, field_error ("" or why
 *   the field is not shown), max_m (largest displacement), scale_m, instruments [{...} ...], fewer than in hello when some are not
 *   there, each with: tip_m [3], force_N [3] (of the tissue on the tool), grip (of the jaws, 0 open .. 1 closed), roll_rad, contacts
 *   [[x, y, z] ...] (displaced, m), held [[x, y, z] ...] (points that the jaws hold, the same), state (INIT READY RUN SAFE),
 *   reason (name of the status or ""), meaning, remedy, silent_s (since the controller was heard last), health [...] (order
 *   of health_names), trace [[time_s, N] ...] (force since the frame before), hand_m [3] (target, trocar's frame), driven (a
 *   page moves the hand).
 *   Array: int16 displacements 3n; times scale_m gives m (rounding: half of max/32767, under 1 um for 3 cm).
 *
 * World frame unless said otherwise. A number that is not finite is null. */
#ifndef TROCAR_MESSAGE_H
#define TROCAR_MESSAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bank_view.h"
#include "failure.h"
#include "link.h"

enum { MESSAGE_HELLO = 1, MESSAGE_FRAME = 2, MESSAGE_HEADROOM = 64 };

struct message {
    unsigned char *buffer;   /* MESSAGE_HEADROOM free bytes for the transport, then the message */
    size_t length, capacity; /* of the message */
};

enum { MESSAGE_MAX_TRACE = 64 };

struct message_instrument {
    const struct link *link;
    double hand_target_m[3];
    bool driven;
    size_t held_count; /* <= LINK_MAX_CONTACTS */
    struct link_contact held[LINK_MAX_CONTACTS];
    unsigned trace_count; /* <= MESSAGE_MAX_TRACE */
    double trace_time_s[MESSAGE_MAX_TRACE], trace_force_N[MESSAGE_MAX_TRACE];
};

struct message_state {
    uint64_t number;
    double time_s;
    uint32_t instruments;
    struct message_instrument instrument[BANK_MAX_INSTRUMENTS];
    unsigned clients;
    uint64_t dropped, malformed;
    const char *field_error;
};

/* `names`: of the bank's instruments. */
int message_hello(struct message *message, const struct bank_view *bank, const char *scene,
                  const char *const names[BANK_MAX_INSTRUMENTS], struct failure *why);
/* `u`: displacements, 3 per vertex, m. */
int message_frame(struct message *message, const struct bank_view *bank, const struct message_state *state,
                  const double *u, struct failure *why);
void message_free(struct message *message);

#endif
