/* Lockstep over two byte streams: how a controller in a process of its own (or in an emulator) runs in simulated time.
 * Records of 16 bytes, little-endian:
 *
 *   frame   uint32 id | uint8 length | uint8 flags | uint16 0 | uint8 data[8]
 *   time    uint32 0  | uint8 0      | uint8 0     | uint16 1 | uint64 time_us
 *
 * The controller writes the frames it sends; when it idles it writes the time until which it would, and then reads:
 * frames that have arrived, closed by the time that it now is (at most what it asked for). The stream's end ends it. */
#ifndef TROCAR_LOCKSTEP_H
#define TROCAR_LOCKSTEP_H

#include <stdint.h>

enum { LOCKSTEP_RECORD = 16, LOCKSTEP_FRAME = 0, LOCKSTEP_TIME = 1 };

struct lockstep_record {
    uint32_t id;
    uint8_t length, flags;
    uint16_t kind;
    union {
        uint8_t data[8];
        uint64_t time_us;
    } u;
};
_Static_assert(sizeof(struct lockstep_record) == LOCKSTEP_RECORD, "a record is 16 bytes");

#endif
