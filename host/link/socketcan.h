/* SocketCAN: what passes between Linux and a program on a raw CAN socket (Documentation/networking/can.rst of the kernel).
 * The conversions are here as functions of bytes; opening and moving frames is the backend "socketcan:IF" (backend.h).
 *
 * The socket: receive filters in the kernel, error frames, SO_TIMESTAMPNS for the time of arrival, SO_RXQ_OVFL for what did
 * not fit its receive buffer, CAN_RAW_RECV_OWN_MSGS and CAN_RAW_FD_FRAMES as the options say. Its send buffer is the
 * kernel's smallest (about three frames), so that a program waits for its own socket, which poll can see, before the interface's queue of ten
 * frames overflows into ENOBUFS, which poll cannot; and so that few old frames stand before an urgent one. */
#ifndef TROCAR_SOCKETCAN_H
#define TROCAR_SOCKETCAN_H

#include <stdbool.h>
#include <stddef.h>

#include "backend.h"

enum { SOCKETCAN_CLASSIC_BYTES = 16, SOCKETCAN_FD_BYTES = 72 }; /* sizeof struct can_frame, struct canfd_frame */

/* The kernel's bytes of a frame; returns how many: SOCKETCAN_CLASSIC_BYTES, or SOCKETCAN_FD_BYTES with CAN_FLAG_FD. */
size_t socketcan_pack(const struct can_frame_t *frame, unsigned char bytes[SOCKETCAN_FD_BYTES]);
/* False for a length that is neither, and for a frame that says it has more data than it can. */
bool socketcan_unpack(const unsigned char *bytes, size_t length, struct can_frame_t *frame);

/* Count what an error frame says (linux/can/error.h: id = classes, data[0] bit of lost arbitration, data[1] state of the
 * controller, data[2..3] protocol violation, data[4] transceiver, data[6..7] transmit and receive error counters). */
void socketcan_count_error(const struct can_frame_t *frame, struct backend_counters *counters);
/* The same for people: "bus off", "error passive (transmit errors 128)"; into `text`, which it returns. */
const char *socketcan_error_text(const struct can_frame_t *frame, char *text, size_t size);

#endif
