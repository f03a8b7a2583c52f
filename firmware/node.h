/* The controller as a CAN node: frames in, frames out, no I/O of its own. A port (or the simulator) moves the frames.
 *
 * One tick, every millisecond:
 *   node_begin_tick(n)        queues SYNC, if it is the node of instrument 0; the device samples and answers with its
 *                             encoder frame. The node of another instrument begins its tick at that SYNC
 *   node_receive(n, frame)    any number of times, any frame; what does not concern the node is ignored and counted
 *   node_finish_tick(n)       runs tick(), queues the torque frame and the telemetry whose turn it is (telemetry.h)
 *   node_transmit(n, &frame)  takes the queued frames, most urgent first; false when none is left
 *
 * Frames that the port could not send before the next tick are dropped and counted: a
 * stale torque must not follow a fresh one. */
#ifndef TROCAR_NODE_H
#define TROCAR_NODE_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "telemetry.h"
#include "tick.h"

enum { NODE_QUEUE = 8 /* SYNC, torque, emergency, TELEMETRY_FRAMES: at most 5 in a tick */ };

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
    uint32_t worst_tick_us; /* the port's, for Health: from the beginning of node_finish_tick to its end */
    struct telemetry telemetry;
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
