/* How many bits a classic CAN frame takes on the bus (ISO 11898-1), and so how long it occupies it.
 *
 *   SOF 1 | identifier 11 | RTR 1 | IDE 1 | r0 1 | DLC 4 | data 8n | CRC 15     34 + 8n bits, stuffed
 *   CRC delimiter 1 | ACK 2 | EOF 7 | intermission 3                            13 bits, not stuffed
 *
 * With a 29-bit identifier the first line has SRR 1, 18 more identifier bits and r1 1: 54 + 8n. After five equal bits a
 * bit of the other value is stuffed in; it counts for the next five. The exact number follows by building the frame bit
 * by bit, CRC included.
 *
 * Worst case over all identifiers and data: g + 8n + 13 + floor((g + 8n - 1) / 4), g = 34 or 54
 * (Davis, Burns, Bril, Lukkien: Controller Area Network (CAN) schedulability analysis: refuted, revisited and revised,
 * Real-Time Systems 35, 2007, eq. 1, after Tindell and Burns 1994). Eight bytes: 135 bits = 135 us at 1 Mbit/s. */
#ifndef TROCAR_FRAMEBITS_H
#define TROCAR_FRAMEBITS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "can_frame.h"

/* Bits of this frame with its stuff bits and the intermission that follows; 0 for an FD or error frame or more than
 * eight bytes. A remote frame has no data whatever its length says. */
unsigned framebits(const struct can_frame_t *frame);

/* Largest value that framebits can have for `length` bytes of data (0..8). */
unsigned framebits_worst(unsigned length, bool extended);

/* CRC-15/CAN: polynomial 0x4599, start 0, over `count` bits, one per byte. */
uint16_t framebits_crc15(const uint8_t *bits, size_t count);

#endif
