/* One CAN frame, as every node of Trocar passes it around: 11-bit identifier, classic (8 bytes) or FD (up to 64). */
#ifndef TROCAR_CAN_FRAME_H
#define TROCAR_CAN_FRAME_H

#include <stdint.h>

enum { CAN_FLAG_FD = 1, CAN_FLAG_RTR = 2, CAN_FLAG_ERROR = 4, CAN_FLAG_EXTENDED = 8 };

struct can_frame_t {
    uint32_t id;    /* 11 bits; 29 with CAN_FLAG_EXTENDED */
    uint8_t length; /* bytes of data, 0..8 classic, 0..64 FD */
    uint8_t flags;  /* CAN_FLAG_* */
    uint8_t data[64];
};

/* What a CAN controller has gone through since start, as its driver counted it. */
struct can_errors {
    uint32_t receive_overflows; /* no room for a frame: one or more were lost */
    uint32_t error_passive;     /* entered */
    uint32_t bus_off;           /* entered */
    uint32_t aborted;           /* frames taken back because they were too old to be sent */
};

#endif
