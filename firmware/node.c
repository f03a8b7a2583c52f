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

int node_start(struct node *n, const struct bank_view *bank, uint8_t node_id, void *memory, size_t bytes)
{
    *n = (struct node){.bank = bank, .node_id = node_id};
    int status = controller_start(&n->controller, bank, memory, bytes);
    for (uint32_t t = 0; t < tick_instruments(&n->controller); t++) { /* bound: TICK_INSTRUMENTS */
        struct can_frame_t boot = telemetry_heartbeat((uint8_t)(node_id + t), 0);
        *enqueue(n, boot.id, boot.length) = boot;
    }
    return status;
}

void node_begin_tick(struct node *n)
{
    n->queue_overflows += n->queue_count - n->queue_taken;
    n->queue_count = n->queue_taken = 0;
    for (uint32_t t = 0; t < TICK_INSTRUMENTS; t++) /* bound: TICK_INSTRUMENTS */
        n->instrument[t].answered = false;
    struct wire_sync m = {.counter = (uint8_t)(n->controller.tick_count + 1u)};
    wire_sync_pack(enqueue(n, WIRE_SYNC_ID, WIRE_SYNC_LENGTH)->data, &m);
}

static void receive_encoders(struct node *n, uint32_t t, const struct can_frame_t *frame)
{
    struct node_instrument *own = &n->instrument[t];
    struct safety *safety = &n->controller.instrument[t].safety;
    struct wire_encoders m;
    if (!wire_encoders_unpack(&m, frame->data, frame->length)) {
        n->frames_malformed++;
        return;
    }
    if (own->input.fresh) { /* several samples in one tick: the newest counts */
        uint32_t ahead = (uint32_t)(m.sequence - own->input.sequence) & 15u;
        if (ahead == 0)
            safety->duplicates++;
        else
            safety->out_of_sequence++;
        if (ahead == 0 || ahead > 8) /* as safety_sequence has it */
            return;
    }
    own->answered = true;
    own->input.fresh = true;
    own->input.sequence = m.sequence;
    own->input.counts[0] = m.alpha;
    own->input.counts[1] = m.beta;
    own->input.counts[2] = m.insertion;
    own->input.roll = m.roll;
    own->input.grip = m.grip;
}

static void receive_nmt(struct node *n, const struct can_frame_t *frame)
{
    struct wire_nmt m;
    if (!wire_nmt_unpack(&m, frame->data, frame->length)) {
        n->frames_malformed++;
        return;
    }
    for (uint32_t t = 0; t < tick_instruments(&n->controller); t++) { /* bound: TICK_INSTRUMENTS */
        if (m.node != 0 && m.node != n->node_id + t)
            continue;
        n->instrument[t].input.acknowledge |= m.command == NMT_START;
        n->instrument[t].input.stop |= m.command == NMT_STOP;
    }
}

void node_receive(struct node *n, const struct can_frame_t *frame)
{
    uint32_t t = frame->id - WIRE_ENCODERS_ID - n->node_id;
    n->frames_received++;
    if (frame->flags & (CAN_FLAG_EXTENDED | CAN_FLAG_RTR | CAN_FLAG_ERROR))
        n->frames_ignored++;
    else if (t < tick_instruments(&n->controller))
        receive_encoders(n, t, frame);
    else if (frame->id == WIRE_NMT_ID)
        receive_nmt(n, frame);
    else
        n->frames_ignored++;
}

bool node_answered(const struct node *n)
{
    bool all = true;
    for (uint32_t t = 0; t < tick_instruments(&n->controller); t++) /* bound: TICK_INSTRUMENTS */
        all = all && n->instrument[t].answered;
    return all;
}

void node_overrun(struct node *n)
{
    for (uint32_t t = 0; t < TICK_INSTRUMENTS; t++) /* bound: TICK_INSTRUMENTS */
        n->instrument[t].input.overrun = true;
}

static void send_torques(struct node *n, uint32_t t)
{
    const struct tick_output *out = &n->instrument[t].output;
    struct wire_torques m = {.enable = out->enable, .sequence = out->sequence};
    m.alpha = (int16_t)wire_quantise(out->torque[0], WIRE_TORQUES_ALPHA_SCALE, WIRE_TORQUES_ALPHA_BITS, true);
    m.beta = (int16_t)wire_quantise(out->torque[1], WIRE_TORQUES_BETA_SCALE, WIRE_TORQUES_BETA_BITS, true);
    m.insertion =
        (int16_t)wire_quantise(out->torque[2], WIRE_TORQUES_INSERTION_SCALE, WIRE_TORQUES_INSERTION_BITS, true);
    struct can_frame_t *frame = enqueue(n, WIRE_TORQUES_ID + n->node_id + t, WIRE_TORQUES_LENGTH);
    wire_torques_pack(frame->data, &m);
    m.crc = crc8_frame(frame->id, frame->data, 7);
    wire_torques_pack(frame->data, &m);
}

/* CANopen EMCY once on entering SAFE and once on leaving it. 0x1000 is the standard's generic error. */
static void send_emergency(struct node *n, uint32_t t)
{
    const struct safety *s = &n->controller.instrument[t].safety;
    bool safe = s->state == SAFETY_SAFE;
    if (safe == n->instrument[t].was_safe)
        return;
    n->instrument[t].was_safe = safe;
    struct wire_emergency m = {.error_code = safe ? 0x1000 : 0,
                               .error_register = safe ? 1 : 0,
                               .state = (uint8_t)s->state,
                               .reason = (int16_t)s->reason,
                               .tick = (uint16_t)n->controller.tick_count};
    wire_emergency_pack(enqueue(n, WIRE_EMERGENCY_ID + n->node_id + t, WIRE_EMERGENCY_LENGTH)->data, &m);
}

static void send_telemetry(struct node *n, uint32_t t)
{
    const struct telemetry_counters counters = {.malformed = n->frames_malformed,
                                                .queue_overflows = n->queue_overflows + n->bus.aborted,
                                                .worst_tick_us = n->worst_tick_us,
                                                .bus = n->bus};
    struct can_frame_t frame[TELEMETRY_FRAMES];
    uint32_t count = telemetry_tick(&n->instrument[t].telemetry, &n->controller, t, n->bank, &counters,
                                    (uint8_t)(n->node_id + t), frame);
    for (uint32_t i = 0; i < count; i++) /* bound: TELEMETRY_FRAMES */
        *enqueue(n, frame[i].id, frame[i].length) = frame[i];
}

void node_finish_tick(struct node *n)
{
    struct tick_input in[TICK_INSTRUMENTS];
    struct tick_output out[TICK_INSTRUMENTS];
    uint32_t count = tick_instruments(&n->controller);
    for (uint32_t t = 0; t < TICK_INSTRUMENTS; t++) { /* bound: TICK_INSTRUMENTS */
        in[t] = n->instrument[t].input;
        n->instrument[t].input = (struct tick_input){.fresh = false};
    }
    tick(&n->controller, n->bank, in, out);
    for (uint32_t t = 0; t < count; t++) { /* bound: TICK_INSTRUMENTS */
        n->instrument[t].output = out[t];
        send_torques(n, t);
    }
    for (uint32_t t = 0; t < count; t++) /* bound: TICK_INSTRUMENTS */
        send_emergency(n, t);
    for (uint32_t t = 0; t < count; t++) /* bound: TICK_INSTRUMENTS */
        send_telemetry(n, t);
}
