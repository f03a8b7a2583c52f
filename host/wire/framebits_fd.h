/* How many bits a CAN FD frame with an 11-bit identifier takes on the bus (ISO 11898-1:2015), at each of its two bit rates.
 *
 *   nominal  SOF 1 | identifier 11 | RRS 1 | IDE 1 | FDF 1 | res 1 | BRS 1                17 bits, stuffed
 *   data     ESI 1 | DLC 4 | data 8n                                                       stuffed
 *            stuff count 4 | CRC 17 (n <= 16) or 21 | a fixed stuff bit before them and after every four: 6 or 7
 *   nominal  CRC delimiter 1 | ACK 2 | EOF 7 | intermission 3                              13 bits
 *
 * Bit-rate switch is on, the sender error-active (ESI 0). The bits at which the rate changes, BRS and CRC delimiter, are
 * counted as nominal, which is the longer. The last bit of the data gets no stuff bit of its own, for a fixed one follows.
 *
 * Worst case over all identifiers and data: stuff bits come after the fifth of the 22 + 8n bits at the soonest, then after
 * every fourth. FDF, res and BRS are 1, 0, 1, so of the first 17 bits at most three have one behind them (the 5th, 9th, 13th),
 * and the next run begins with BRS, the 17th: stuff bits after the 21st, 25th, ... and before the last, 1 + 2n of them. */
#ifndef TROCAR_FRAMEBITS_FD_H
#define TROCAR_FRAMEBITS_FD_H

#include <stdbool.h>

#include "can_frame.h"

struct framebits_fd {
    unsigned nominal, data;
};

/* False for a frame that FD cannot carry: a length it does not have, a remote or error frame, a 29-bit identifier. A classic
 * frame is counted as if it were sent in FD format. */
bool framebits_fd(const struct can_frame_t *frame, struct framebits_fd *bits);

/* Largest values for `length` bytes (0..8, 12, 16, 20, 24, 32, 48, 64; else the next larger one). */
struct framebits_fd framebits_fd_worst(unsigned length);

/* The time on the bus, us, with rates in bit/s. */
double framebits_fd_us(struct framebits_fd bits, double nominal_rate, double data_rate);

#endif
