/* The controller as a CAN node: frames in, frames out, no I/O of its own. A port (or the simulator) moves the frames.
 *
 * One tick:
 *   node_begin_tick(n)        queues SYNC; the device samples and answers with its encoder frame
 *   node_receive(n, frame)    any number of times, any frame: what does not concern the node is ignored and counted
 *   node_finish_tick(n)       runs tick(), queues the torque frame, and contact, force, health, heartbeat when due
 *   node_transmit(n, &frame)  takes the queued frames, most urgent first; false when none is left
 */
#ifndef TROCAR_NODE_H
#define TROCAR_NODE_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "tick.h"

enum { NODE_QUEUE = 64 };

struct node {
    struct controller controller;
    const struct bank_view *bank;
    struct tick_input input;   /* gathered since node_begin_tick */
    struct tick_output output; /* of the last tick */
    uint8_t node_id;           /* 1..127 */
    uint32_t frames_received, frames_ignored, frames_malformed, queue_overflows;
    uint32_t queued, taken;
    struct can_frame_t queue[NODE_QUEUE];
    uint32_t contact_turn, health_turn;
};

/* `instrument` selects the bank's TOOL record. The node starts in INIT, silent but for heartbeats. */
void node_start(struct node *n, const struct bank_view *bank, uint32_t instrument, uint8_t node_id);
void node_begin_tick(struct node *n);
void node_receive(struct node *n, const struct can_frame_t *frame);
void node_finish_tick(struct node *n);
bool node_transmit(struct node *n, struct can_frame_t *frame);

#endif
