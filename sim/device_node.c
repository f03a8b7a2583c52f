#include "device_node.h"

#include <string.h>

#include "crc.h"
#include "wire.h"

void device_node_start(struct device_node *node, const struct device_model *model, const struct hand *hand,
                       uint8_t node_id)
{
    *node = (struct device_node){.node_id = node_id};
    device_start(&node->device, model, hand);
}

static void sample(struct device_node *node, struct can_frame_t *reply)
{
    struct device *device = &node->device;
    uint16_t counts[3];
    device_counts(device, counts);
    device->sequence = (device->sequence + 1) & 15;
    device->samples++;
    const struct wire_encoders encoders = {.alpha = counts[0],
                                           .beta = counts[1],
                                           .insertion = counts[2],
                                           .roll = 512, /* the shaft is not turned */
                                           .grip = (uint16_t)(device->grip * DEVICE_GRIP_CLOSED + 0.5),
                                           .sequence = device->sequence};
    *reply = (struct can_frame_t){.id = WIRE_ENCODERS_ID + node->node_id, .length = WIRE_ENCODERS_LENGTH};
    wire_encoders_pack(reply->data, &encoders);
}

static void apply(struct device_node *node, const struct can_frame_t *frame)
{
    struct device *device = &node->device;
    struct wire_torques torques;
    if (!wire_torques_unpack(&torques, frame->data, frame->length) ||
        torques.crc != crc8_frame(frame->id, frame->data, WIRE_TORQUES_LENGTH - 1)) {
        device->commands_rejected++;
        return;
    }
    /* Four bits: more than half the circle ahead is behind. After a silence any answer is the newest. */
    uint8_t step = (uint8_t)(torques.sequence - node->answered_sequence) & 15;
    if (node->answered && device->silence_us < DEVICE_SILENCE_US && step > 8) {
        node->late++;
        return;
    }
    node->answered = true;
    node->answered_sequence = torques.sequence;
    device->commands_received++;
    const double effort[3] = {torques.alpha * (double)WIRE_TORQUES_ALPHA_SCALE,
                              torques.beta * (double)WIRE_TORQUES_BETA_SCALE,
                              torques.insertion * (double)WIRE_TORQUES_INSERTION_SCALE};
    device_command(device, effort, torques.enable);
}

bool device_node_receive(struct device_node *node, const struct can_frame_t *frame, struct can_frame_t *reply)
{
    if (frame->flags == 0 && frame->id == WIRE_SYNC_ID && frame->length == WIRE_SYNC_LENGTH) {
        node->syncs++;
        sample(node, reply);
        return true;
    }
    if (frame->flags == 0 && frame->id == (uint32_t)WIRE_TORQUES_ID + node->node_id)
        apply(node, frame);
    else
        node->ignored++;
    return false;
}
