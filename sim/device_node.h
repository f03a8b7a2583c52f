/* The simulated device on the bus: it samples at SYNC and answers with its encoder frame, and applies torque frames that
 * are whole (length, CRC-8) and not older than the last one it took. */
#ifndef TROCAR_DEVICE_NODE_H
#define TROCAR_DEVICE_NODE_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "device.h"

struct device_node {
    struct device device;
    uint8_t node_id;
    bool answered;             /* a torque frame was taken since the motors were dropped last */
    uint8_t answered_sequence; /* of the sample that it answered */
    uint32_t syncs, ignored;   /* SYNC frames; frames that do not concern it */
    uint32_t late; /* whole torque frames that answer an older sample than the last one taken: not applied */
};

void device_node_start(struct device_node *node, const struct device_model *model, const struct hand *hand,
                       uint8_t node_id);

/* A frame from the bus. True when `reply` is to be sent. Rejected torque frames (CRC, length) are counted in
 * device.commands_rejected. A duplicate is applied again: it says the same. */
bool device_node_receive(struct device_node *node, const struct can_frame_t *frame, struct can_frame_t *reply);

#endif
