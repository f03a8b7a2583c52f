/* The controller as a CAN node: frames in, frames out, no I/O of its own. A port (or the simulator) moves the frames.
 * On the bus each instrument is a node: instrument t has the node id node_id + t, with its own encoder, torque, emergency and
 * telemetry frames, and is started and stopped by itself (NMT).
 *
 * One tick, every millisecond:
 *   node_begin_tick(n)        queues SYNC; every device samples and answers with its encoder frame
 *   node_receive(n, frame)    any number of times, any frame; what does not concern the node is ignored and counted
 *   node_finish_tick(n)       runs tick(), queues the torque frames and the telemetry whose turn it is (telemetry.h)
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

enum {
    NODE_QUEUE =
        5 + 5 * TICK_INSTRUMENTS /* SYNC and, each, torque, emergency, TELEMETRY_FRAMES: at most 1 + 4 each in a tick */
};

/* What the bus has of each instrument. */
struct node_instrument {
    struct tick_input input;   /* gathered since the last tick */
    struct tick_output output; /* of the last tick */
    bool answered; /* a sample arrived after this tick's SYNC; an older one in `input` serves only if none does */
    bool was_safe;
    struct telemetry telemetry;
};

struct node {
    struct controller controller;
    const struct bank_view *bank;
    uint8_t node_id; /* of instrument 0; all in 1..126; 127 is the host */
    struct node_instrument instrument[TICK_INSTRUMENTS];
    uint32_t frames_received, frames_ignored, frames_malformed, queue_overflows; /* counters */
    struct can_errors bus;                                                       /* the port's, for Health */
    uint32_t queue_count, queue_taken;
    struct can_frame_t queue[NODE_QUEUE];
    uint32_t worst_tick_us; /* the port's, for Health: from the beginning of node_finish_tick to its end */
};

/* `memory` as for controller_start, whose status is returned. Queues the boot-up heartbeats; the state is INIT, silent. */
int node_start(struct node *n, const struct bank_view *bank, uint8_t node_id, void *memory, size_t bytes);
void node_begin_tick(struct node *n);
void node_receive(struct node *n, const struct can_frame_t *frame);
bool node_answered(const struct node *n); /* every device has, since node_begin_tick */
void node_overrun(struct node *n);        /* the port saw the last tick end late */
void node_finish_tick(struct node *n);
bool node_transmit(struct node *n, struct can_frame_t *frame);

#endif
