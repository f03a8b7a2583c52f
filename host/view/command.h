/* What a page may send: one JSON object per WebSocket text message, at most COMMAND_MAX_BYTES, with one of these keys.
 *
 *   {"hand": [x, y, z]}     the hand follows this tip target, trocar's frame (Z into the body), m, |each| <= 1
 *   {"hand": null}          the hand is given back to the gesture
 *                           both with "instrument": 0 (the first, as without) or 1
 *   {"do": "acknowledge"}   leave SAFE or READY for RUN
 *   {"do": "stop"}          ask for SAFE
 *   {"do": "quit"}          end the run
 *
 * Anything else is malformed: counted by the caller and without effect. */
#ifndef TROCAR_COMMAND_H
#define TROCAR_COMMAND_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { COMMAND_MAX_BYTES = 512 };

enum command_kind { COMMAND_HAND, COMMAND_RELEASE, COMMAND_ACKNOWLEDGE, COMMAND_STOP, COMMAND_QUIT };

struct command {
    enum command_kind kind;
    uint32_t instrument; /* COMMAND_HAND, COMMAND_RELEASE: below BANK_MAX_INSTRUMENTS */
    double target_m[3];  /* COMMAND_HAND */
};

/* False when the message is malformed; `command` is then untouched. */
bool command_parse(const char *text, size_t length, struct command *command);

#endif
