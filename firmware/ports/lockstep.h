/* Lockstep over two byte streams: how a controller in a process of its own, or in an emulator, runs in simulated time.
 * Records of 16 bytes, little-endian:
 *
 *   frame   uint32 id | uint8 length | uint8 flags | uint16 0 | uint8 data[8]
 *   time    uint32 0  | uint8 0      | uint8 0     | uint16 1 | uint64 time_us
 *
 * The controller writes the frames it sends; when it idles it writes the time until which it would, and then reads:
 * frames that have arrived, closed by the time that it now is (at most what it asked for). The stream's end ends it.
 *
 * What the controller asks does not depend on what it computes, so the answers may be written down beforehand: per tick
 * the frames until LOOP_SAMPLE_WAIT_US after its start and that time, then the frames until its end and that time.
 *
 * Below is the controller's half, but for reading and writing, which is the port's. */
#ifndef TROCAR_LOCKSTEP_H
#define TROCAR_LOCKSTEP_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"

enum { LOCKSTEP_RECORD = 16, LOCKSTEP_FRAME = 0, LOCKSTEP_TIME = 1, LOCKSTEP_MAILBOXES = 32 };

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

/* Frames that wait for the controller, and its time. All 0 at start. */
struct lockstep {
    uint64_t time_us;
    uint32_t first, count, lost;
    struct can_frame_t mailbox[LOCKSTEP_MAILBOXES];
};

static inline struct lockstep_record lockstep_send(const struct can_frame_t *frame)
{
    struct lockstep_record r = {
        .id = frame->id, .length = frame->length, .flags = frame->flags, .kind = LOCKSTEP_FRAME};
    for (uint32_t i = 0; i < sizeof r.u.data; i++) /* bound: 8 */
        r.u.data[i] = frame->data[i];
    return r;
}

/* Take a record that was read. True: it was the time, which closes the answer. Frames beyond the mailboxes are lost
 * and counted, as on a controller. */
static inline bool lockstep_take(struct lockstep *l, const struct lockstep_record *r)
{
    if (r->kind == LOCKSTEP_TIME) {
        l->time_us = r->u.time_us > l->time_us ? r->u.time_us : l->time_us;
        return true;
    }
    if (l->count == LOCKSTEP_MAILBOXES || r->length > sizeof r->u.data) {
        l->lost++;
        return false;
    }
    struct can_frame_t *f = &l->mailbox[(l->first + l->count++) % LOCKSTEP_MAILBOXES];
    *f = (struct can_frame_t){.id = r->id, .length = r->length, .flags = r->flags};
    for (uint32_t i = 0; i < sizeof r->u.data; i++) /* bound: 8 */
        f->data[i] = r->u.data[i];
    return false;
}

static inline bool lockstep_receive(struct lockstep *l, struct can_frame_t *frame)
{
    if (l->count == 0)
        return false;
    *frame = l->mailbox[l->first];
    l->first = (l->first + 1) % LOCKSTEP_MAILBOXES;
    l->count--;
    return true;
}

#endif
