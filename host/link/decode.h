/* One frame in words: what shared/wire.dbc says of it. */
#ifndef TROCAR_DECODE_H
#define TROCAR_DECODE_H

#include <json-c/json.h>
#include <stddef.h>

#include "can_frame.h"
#include "dbc.h"

enum { DECODE_TEXT = 400 };

/* "Encoders 1: Alpha 8206 count, Beta 8193 count, ..."; a frame that the protocol does not have, or whose length or page it has
 * not: "not of the protocol", "malformed". Returns the message, NULL for those. */
const struct dbc_message *decode_text(const struct dbc *dbc, const struct can_frame_t *frame, char text[DECODE_TEXT]);

/* {"time_us", "id", "data", "name", "node", "signals": {...}}; the last three only for a frame of the protocol. */
struct json_object *decode_json(const struct dbc *dbc, const struct can_frame_t *frame, uint64_t time_us);

/* Data as hexadecimal digits; returns `text`. */
const char *decode_data(const struct can_frame_t *frame, char text[129]);

#endif
