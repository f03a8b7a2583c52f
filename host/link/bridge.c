#include "bridge.h"

#include <poll.h>
#include <string.h>

enum { ROOM_WAIT_US = 2000 }; /* a full frame takes 135 us at 1 Mbit/s; a queue of ten, 1.4 ms */

void bridge_start(struct bridge *bridge, struct backend *a, struct backend *b)
{
    memset(bridge, 0, sizeof *bridge);
    bridge->side[0] = a;
    bridge->side[1] = b;
}

/* Where the identifier's owner stands; of 29-bit ones by open addressing, the oldest gives way when it is full. */
static struct bridge_owner *owner_of(struct bridge *bridge, const struct can_frame_t *frame)
{
    if (!(frame->flags & CAN_FLAG_EXTENDED))
        return &bridge->standard[frame->id & 0x7FF];
    struct bridge_owner *oldest = NULL;
    const uint32_t start = (frame->id * 2654435761u) >> 22; /* Knuth's multiplicative hash, 10 bits */
    for (uint32_t i = 0; i < 16; i++) {
        struct bridge_owner *o = &bridge->extended[(start + i) % BRIDGE_EXTENDED];
        if (o->side && o->id == frame->id)
            return o;
        if (!oldest || !o->side || o->heard_us < oldest->heard_us)
            oldest = o;
        if (!o->side)
            break;
    }
    *oldest = (struct bridge_owner){.id = frame->id};
    return oldest;
}

/* May a frame of this identifier come from here? */
static bool belongs(struct bridge *bridge, const struct backend_received *received, unsigned from)
{
    struct bridge_owner *owner = owner_of(bridge, &received->frame);
    if (owner->side && owner->side != from + 1 && received->time_us < owner->heard_us + BRIDGE_MOVE_US)
        return false;
    owner->side = (uint8_t)(from + 1);
    owner->heard_us = received->time_us;
    return true;
}

static int forward(struct bridge *bridge, const struct backend_received *received, unsigned from, struct failure *why)
{
    struct bridge_way *way = &bridge->way[from];
    way->heard++;
    if (received->frame.flags & CAN_FLAG_ERROR) {
        way->refused++; /* it tells of this side's bus only */
        return STATUS_OK;
    }
    if (!belongs(bridge, received, from)) {
        way->looped++;
        return STATUS_OK;
    }
    const int status = backend_send(bridge->side[!from], &received->frame, ROOM_WAIT_US, why);
    if (status == STATUS_BUS_FRAME) {
        way->refused++;
        return STATUS_OK;
    }
    if (status == 0)
        way->no_room++;
    if (status == 1)
        way->forwarded++;
    return status < 0 ? status : STATUS_OK;
}

static int side_step(struct bridge *bridge, unsigned from, struct failure *why)
{
    struct backend_received received;
    int heard = 0;
    for (; heard < BRIDGE_BURST; heard++) {
        int status = backend_receive(bridge->side[from], &received, 0, why);
        if (status == 0)
            break;
        if (status == 1)
            status = forward(bridge, &received, from, why);
        if (status < 0)
            return status;
    }
    return heard;
}

int bridge_step(struct bridge *bridge, int64_t wait_us, struct failure *why)
{
    struct pollfd ends[2];
    for (int i = 0; i < 2; i++)
        ends[i] = (struct pollfd){.fd = backend_descriptor(bridge->side[i]), .events = POLLIN};
    if (wait_us > 0)
        poll(ends, 2, (int)((wait_us + 999) / 1000)); /* a signal ends it too */
    int heard = 0;
    for (unsigned from = 0; from < 2; from++) {
        const int status = side_step(bridge, from, why);
        if (status < 0) {
            bridge->downs += status == STATUS_BUS_DOWN || status == STATUS_BUS_LOST;
            return status;
        }
        heard += status;
    }
    return heard;
}
