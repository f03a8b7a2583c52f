/* SLCAN, the ASCII protocol of CAN adapters on a serial line (LAWICEL CAN232; also CANable, USBtin, and slcand of can-utils).
 * The text is here as functions; the line is the backend "slcan:TTY" (backend.h).
 *
 *   t1A2 3 112233   data frame, 11-bit identifier in 3 hexadecimal digits, length in one, bytes in two each (no spaces)
 *   T01ABCDEF 0     the same with a 29-bit identifier in 8 digits
 *   r1A2 3  R...    remote frames: no bytes
 *   S8  O  C        to the adapter: bit rate (S0..S8), open, close the channel
 *
 * A line ends with a carriage return (13). The adapter answers a command with a carriage return, before it "z" to a t or r and
 * "Z" to a T or R when it says so, or with a bell (7) when it refuses. It may add four digits of time, in milliseconds, behind
 * a frame; they are read and not used, for the time of arrival on this machine has no wrap. */
#ifndef TROCAR_SLCAN_H
#define TROCAR_SLCAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "can_frame.h"

enum {
    SLCAN_LINE = 32 /* characters of the longest line, with its end, a time and a NUL: 1 + 8 + 1 + 16 + 4 + 1 + 1 */
};

/* A frame as its line, with the carriage return; returns the length. 0: an FD or error frame, which SLCAN cannot say. */
size_t slcan_format(const struct can_frame_t *frame, char line[SLCAN_LINE]);

enum slcan_meaning {
    SLCAN_NOTHING,   /* empty, z, Z: what was sent was taken */
    SLCAN_FRAME,     /* *frame */
    SLCAN_COMMAND,   /* from the other side of a plain cable: S O C L V N and the like; no matter here */
    SLCAN_MALFORMED, /* anything else */
};

/* A line of `length` characters without its end. */
enum slcan_meaning slcan_parse(const char *line, size_t length, struct can_frame_t *frame);

/* The digit of S for a bit rate, or -1: 10, 20, 50, 100, 125, 250, 500, 800 kbit/s, 1 Mbit/s. */
int slcan_rate(uint32_t bit_rate);

#endif
