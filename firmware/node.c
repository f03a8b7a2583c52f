#include "node.h"

#include "crc.h"
#include "wire.h"

enum { NMT_START = 1, NMT_STOP = 2 };

static struct can_frame_t *enqueue(struct node *n, uint32_t id, uint8_t length)
{
    if (n->queue_count == NODE_QUEUE) {
        n->queue_overflows++;
        n->queue_count--; /* the newest telemetry gives way; SYNC, torque and emergency are queued before it */
    }
    struct can_frame_t *frame = &n->queue[n->queue_count++];
    *frame = (struct can_frame_t){.id = id, .length = length};
    return frame;
}

bool node_transmit(struct node *n, struct can_frame_t *frame)
{
    if (n->queue_taken == n->queue_count) {
        n->queue_taken = n->queue_count = 0;
        return false;
    }
    *frame = n->queue[n->queue_taken++];
    return true;
}

int node_start(struct node *n, const struct bank_view *bank, uint32_t instrument, uint8_t node_id, void *memory,
               size_t bytes)
{
    *n = (struct node){.bank = bank, .node_id = node_id};
    int status = controller_start(&n->controller, bank, instrument, memory, bytes);
    struct can_frame_t boot = telemetry_heartbeat(node_id, 0);
    *enqueue(n, boot.id, boot.length) = boot;
    return status;
}

void node_begin_tick(struct node *n)
{
    n->queue_overflows += n->queue_count - n->queue_taken;
    n->queue_count = n->queue_taken = 0;
    n->answered = false;
    if (n->controller.instrument > 0) /* it follows the SYNC of instrument 0: an identifier has one sender */
        return;
    struct wire_sync m = {.counter = (uint8_t)(n->controller.tick_count + 1u)};
    wire_sync_pack(enqueue(n, WIRE_SYNC_ID, WIRE_SYNC_LENGTH)->data, &m);
}

static void receive_encoders(struct node *n, const struct can_frame_t *frame)
{
    struct wire_encoders m;
    if (!wire_encoders_unpack(&m, frame->data, frame->length)) {
        n->frames_malformed++;
        return;
    }
    if (n->input.fresh) { /* several samples in one tick: the newest counts */
        uint32_t ahead = (uint32_t)(m.sequence - n->input.sequence) & 15u;
        if (ahead == 0)
            n->controller.safety.duplicates++;
        else
            n->controller.safety.out_of_sequence++;
        if (ahead == 0 || ahead > 8) /* as safety_sequence has it */
            return;
    }
    n->answered = true;
    n->input.fresh = true;
    n->input.sequence = m.sequence;
    n->input.counts[0] = m.alpha;
    n->input.counts[1] = m.beta;
    n->input.counts[2] = m.insertion;
    n->input.roll = m.roll;
    n->input.grip = m.grip;
}

static void receive_nmt(struct node *n, const struct can_frame_t *frame)
{
    struct wire_nmt m;
    if (!wire_nmt_unpack(&m, frame->data, frame->length)) {
        n->frames_malformed++;
        return;
    }
    if (m.node != 0 && m.node != n->node_id)
        return;
    n->input.acknowledge |= m.command == NMT_START;
    n->input.stop |= m.command == NMT_STOP;
}

void node_receive(struct node *n, const struct can_frame_t *frame)
{
    n->frames_received++;
    if (frame->flags & (CAN_FLAG_EXTENDED | CAN_FLAG_RTR | CAN_FLAG_ERROR))
        n->frames_ignored++;
    else if (frame->id == WIRE_ENCODERS_ID + (uint32_t)n->node_id)
        receive_encoders(n, frame);
    else if (frame->id == WIRE_NMT_ID)
        receive_nmt(n, frame);
    else
        n->frames_ignored++;
}

static void send_torques(struct node *n)
{
    const struct tick_output *out = &n->output;
    struct wire_torques m = {.enable = out->enable, .sequence = out->sequence};
    m.alpha = (int16_t)wire_quantise(out->torque[0], WIRE_TORQUES_ALPHA_SCALE, WIRE_TORQUES_ALPHA_BITS, true);
    m.beta = (int16_t)wire_quantise(out->torque[1], WIRE_TORQUES_BETA_SCALE, WIRE_TORQUES_BETA_BITS, true);
    m.insertion =
        (int16_t)wire_quantise(out->torque[2], WIRE_TORQUES_INSERTION_SCALE, WIRE_TORQUES_INSERTION_BITS, true);
    struct can_frame_t *frame = enqueue(n, WIRE_TORQUES_ID + n->node_id, WIRE_TORQUES_LENGTH);
    wire_torques_pack(frame->data, &m);
    m.crc = crc8_frame(frame->id, frame->data, 7);
    wire_torques_pack(frame->data, &m);
}

/* CANopen EMCY once on entering SAFE and once on leaving it. 0x1000 is the standard's generic error. */
static void send_emergency(struct node *n)
{
    const struct safety *s = &n->controller.safety;
    bool safe = s->state == SAFETY_SAFE;
    if (safe == n->was_safe)
        return;
    n->was_safe = safe;
    struct wire_emergency m = {.error_code = safe ? 0x1000 : 0,
                               .error_register = safe ? 1 : 0,
                               .state = (uint8_t)s->state,
                               .reason = (int16_t)s->reason,
                               .tick = (uint16_t)n->controller.tick_count};
    wire_emergency_pack(enqueue(n, WIRE_EMERGENCY_ID + n->node_id, WIRE_EMERGENCY_LENGTH)->data, &m);
}

static void send_telemetry(struct node *n)
{
    const struct telemetry_counters counters = {.malformed = n->frames_malformed,
                                                .queue_overflows = n->queue_overflows + n->bus.aborted,
                                                .worst_tick_us = n->worst_tick_us,
                                                .bus = n->bus};
    struct can_frame_t frame[TELEMETRY_FRAMES];
    uint32_t count = telemetry_tick(&n->telemetry, &n->controller, n->bank, &counters, n->node_id, frame);
    for (uint32_t i = 0; i < count; i++) /* bound: TELEMETRY_FRAMES */
        *enqueue(n, frame[i].id, frame[i].length) = frame[i];
}

void node_finish_tick(struct node *n)
{
    tick(&n->controller, n->bank, &n->input, &n->output);
    n->input = (struct tick_input){.fresh = false};
    send_torques(n);
    send_emergency(n);
    send_telemetry(n);
}
