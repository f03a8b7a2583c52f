/* The controller as a CAN node: frames in, frames out, no I/O of its own. A port (or the simulator) moves the frames.
 *
 * One tick, every millisecond:
 *   node_begin_tick(n)        queues SYNC; the device samples and answers with its encoder frame
 *   node_receive(n, frame)    any number of times, any frame; what does not concern the node is ignored and counted
 *   node_finish_tick(n)       runs tick(), queues the torque frame and at most NODE_TELEMETRY_FRAMES of telemetry
 *   node_transmit(n, &frame)  takes the queued frames, most urgent first; false when none is left
 *
 * Telemetry by turns: heartbeat and health 10 Hz each, force and pose 100 Hz, contacts in the remaining ticks (with m
 * contacts a set takes m ticks). Frames that the port could not send before the next tick are dropped and counted: a
 * stale torque must not follow a fresh one. */
#ifndef TROCAR_NODE_H
#define TROCAR_NODE_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "tick.h"

enum {
    NODE_QUEUE = 8, /* SYNC, torque, emergency, telemetry: at most 5 in a tick */
    NODE_TELEMETRY_FRAMES =
        2, /* a tick: with SYNC, encoders and torque 5 of the 7 full frames that fit 1 ms at 1 Mbit/s */
    NODE_HEALTH_PAGES = 7
};

struct node_contact_report { /* one contact as it goes on the wire: raw integers of wire.dbc */
    uint32_t triangle;
    uint16_t weight1, weight2;
    int32_t displacement[3];
};

struct node {
    struct controller controller;
    const struct bank_view *bank;
    uint8_t node_id;           /* 1..126; 127 is the host */
    struct tick_input input;   /* gathered since the last tick */
    struct tick_output output; /* of the last tick */
    bool answered; /* a sample arrived after this tick's SYNC; an older one in `input` serves only if none does */
    bool was_safe;
    uint32_t frames_received, frames_ignored, frames_malformed, queue_overflows; /* counters */
    struct can_errors bus;                                                       /* the port's, for Health */
    uint32_t queue_count, queue_taken;
    struct can_frame_t queue[NODE_QUEUE];
    /* contact set being sent, so that its frames belong together */
    uint32_t report_count, report_sent, report_set;
    struct node_contact_report report[CONTACT_MAX];
    uint32_t health_page, pose_set;
};

/* `instrument` selects the bank's TOOL record; `memory` as for controller_start, whose status is returned. Queues the
 * boot-up heartbeat; the state is INIT, silent. */
int node_start(struct node *n, const struct bank_view *bank, uint32_t instrument, uint8_t node_id, void *memory,
               size_t bytes);
void node_begin_tick(struct node *n);
void node_receive(struct node *n, const struct can_frame_t *frame);
void node_finish_tick(struct node *n);
bool node_transmit(struct node *n, struct can_frame_t *frame);

#endif
