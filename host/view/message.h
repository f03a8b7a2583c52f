/* The two binary messages that the page receives. Both are little-endian:
 *
 *   u32 kind (1 hello, 2 frame) | u32 J, a multiple of 4 | J bytes of JSON, padded with spaces | arrays
 *
 * hello, once per connection. JSON: protocol 1, scene, vertices n, triangles t, fixed (count), trocar_m [3], rotation [9]
 *   (row-major, columns are the trocar frame's axes in the world), tip_radius_m, joint_min [3], joint_max [3] (rad, rad, m),
 *   force_limit_N, health_names [...]. Arrays: float32 rest positions 3n (m), u16 triangles 3t, u8 fixed flags n.
 *
 * frame, 30 per second of the run. JSON: frame (number from 1), time_s, tip_m [3], force_N [3] (of the tissue on the tool),
 *   contacts [[x, y, z] ...] (displaced, m), state (INIT READY RUN SAFE), reason (name of the status or ""), meaning,
 *   remedy, silent_s (since the controller was heard last), health [...] (order of health_names), trace [[time_s, N] ...]
 *   (force since the frame before), hand_m [3] (target, trocar's frame), driven (a page moves the hand), clients, dropped,
 *   malformed, field_error ("" or why the field is not shown), max_m (largest displacement), scale_m.
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

struct message_state {
    uint64_t number;
    double time_s;
    const struct link *link;
    double hand_target_m[3];
    bool driven;
    unsigned trace_count; /* <= MESSAGE_MAX_TRACE */
    double trace_time_s[MESSAGE_MAX_TRACE], trace_force_N[MESSAGE_MAX_TRACE];
    unsigned clients;
    uint64_t dropped, malformed;
    const char *field_error;
};

int message_hello(struct message *message, const struct bank_view *bank, const char *scene, struct failure *why);
/* `u`: displacements, 3 per vertex, m. */
int message_frame(struct message *message, const struct bank_view *bank, const struct message_state *state,
                  const double *u, struct failure *why);
void message_free(struct message *message);

#endif
