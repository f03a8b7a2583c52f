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

static void send_heartbeat(struct node *n, uint8_t nmt_state)
{
    struct wire_heartbeat m = {.nmt_state = nmt_state};
    wire_heartbeat_pack(enqueue(n, WIRE_HEARTBEAT_ID + n->node_id, WIRE_HEARTBEAT_LENGTH)->data, &m);
}

int node_start(struct node *n, const struct bank_view *bank, uint32_t instrument, uint8_t node_id, void *memory,
               size_t bytes)
{
    *n = (struct node){.bank = bank, .node_id = node_id};
    int status = controller_start(&n->controller, bank, instrument, memory, bytes);
    send_heartbeat(n, 0);
    return status;
}

void node_begin_tick(struct node *n)
{
    n->queue_overflows += n->queue_count - n->queue_taken;
    n->queue_count = n->queue_taken = 0;
    n->answered = false;
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

static uint16_t saturate(uint32_t counter)
{
    return counter > 0xFFFFu ? 0xFFFFu : (uint16_t)counter;
}

static void send_health(struct node *n)
{
    const struct controller *c = &n->controller;
    const struct safety *s = &c->safety;
    struct wire_health m = {
        .page = (uint8_t)n->health_page,
        .state = (uint8_t)s->state,
        .missed = saturate(s->missed),
        .implausible = saturate(s->implausible),
        .out_of_sequence = saturate(s->out_of_sequence),
        .duplicates = saturate(s->duplicates),
        .overruns = saturate(s->overruns),
        .safe_entries = saturate(s->safe_entries),
        .clamps = saturate(c->coupling.clamps),
        .rate_limits = saturate(c->coupling.rate_limits),
        .passivity_interventions = saturate(c->coupling.passivity_interventions),
        .malformed = saturate(n->frames_malformed),
        .queue_overflows = saturate(n->queue_overflows),
        .reason = (int16_t)s->reason,
        .tick = c->tick_count,
        .energy =
            (uint16_t)wire_quantise(c->coupling.energy_J, WIRE_HEALTH_ENERGY_SCALE, WIRE_HEALTH_ENERGY_BITS, false),
        .walks_cut = saturate(c->collide.walks_cut),
        .solver_cuts = saturate(c->contact.cut),
        .nonfinite = saturate(s->nonfinite),
        .receive_overflows = saturate(n->bus.receive_overflows),
        .error_passive = saturate(n->bus.error_passive),
        .bus_off = saturate(n->bus.bus_off),
    };
    wire_health_pack(enqueue(n, WIRE_HEALTH_ID + n->node_id, WIRE_HEALTH_LENGTH)->data, &m);
    n->health_page = (n->health_page + 1u) % NODE_HEALTH_PAGES;
}

static void send_force_pose(struct node *n)
{
    const float *tip = n->controller.kinematics.tip_m, *force = n->controller.coupling.force_N;
    n->pose_set = (n->pose_set + 1u) & 7u;
    for (uint8_t part = 0; part < 2; part++) { /* bound: 2 */
        struct wire_force_pose m = {
            .part = part,
            .set = (uint8_t)n->pose_set,
            .tip_x = wire_quantise(tip[0], WIRE_FORCE_POSE_TIP_X_SCALE, WIRE_FORCE_POSE_TIP_X_BITS, true),
            .tip_y = wire_quantise(tip[1], WIRE_FORCE_POSE_TIP_Y_SCALE, WIRE_FORCE_POSE_TIP_Y_BITS, true),
            .tip_z = wire_quantise(tip[2], WIRE_FORCE_POSE_TIP_Z_SCALE, WIRE_FORCE_POSE_TIP_Z_BITS, true),
            .force_x =
                (int16_t)wire_quantise(force[0], WIRE_FORCE_POSE_FORCE_X_SCALE, WIRE_FORCE_POSE_FORCE_X_BITS, true),
            .force_y =
                (int16_t)wire_quantise(force[1], WIRE_FORCE_POSE_FORCE_Y_SCALE, WIRE_FORCE_POSE_FORCE_Y_BITS, true),
            .force_z =
                (int16_t)wire_quantise(force[2], WIRE_FORCE_POSE_FORCE_Z_SCALE, WIRE_FORCE_POSE_FORCE_Z_BITS, true),
            .contacts = (uint8_t)n->controller.contact.count,
            .state = (uint8_t)n->controller.safety.state,
        };
        wire_force_pose_pack(enqueue(n, WIRE_FORCE_POSE_ID + n->node_id, WIRE_FORCE_POSE_LENGTH)->data, &m);
    }
}

/* Copy the contacts that push, as wire integers; those that only touch displace nothing. */
static void take_contact_report(struct node *n)
{
    const struct contact_set *s = &n->controller.contact;
    n->report_count = n->report_sent = 0;
    n->report_set = (n->report_set + 1u) & 31u;
    for (uint32_t i = 0; i < s->count; i++) { /* bound: CONTACT_MAX */
        const struct contact *c = &s->contact[i];
        if (!(c->pressure_N > 0.0f))
            continue;
        struct node_contact_report *r = &n->report[n->report_count++];
        r->triangle = c->triangle;
        r->weight1 =
            (uint16_t)wire_quantise(c->weights[1], WIRE_CONTACT_WEIGHT1_SCALE, WIRE_CONTACT_WEIGHT1_BITS, false);
        r->weight2 =
            (uint16_t)wire_quantise(c->weights[2], WIRE_CONTACT_WEIGHT2_SCALE, WIRE_CONTACT_WEIGHT2_BITS, false);
        for (int k = 0; k < 3; k++) /* bound: 3 */
            r->displacement[k] = wire_quantise(c->displacement_m[k], WIRE_CONTACT_DISPLACEMENT_X_SCALE,
                                               WIRE_CONTACT_DISPLACEMENT_X_BITS, true);
    }
}

/* The next contact of the set being sent, in two frames; without contact, one frame that says so. */
static void send_contact(struct node *n)
{
    if (n->report_sent >= n->report_count)
        take_contact_report(n);
    const struct node_contact_report *r = &n->report[n->report_sent];
    struct wire_contact m = {
        .slot = (uint8_t)n->report_sent, .set = (uint8_t)n->report_set, .count = (uint8_t)n->report_count};
    if (n->report_count > 0) {
        m.triangle = r->triangle;
        m.weight1 = r->weight1;
        m.weight2 = r->weight2;
    }
    wire_contact_pack(enqueue(n, WIRE_CONTACT_ID + n->node_id, WIRE_CONTACT_LENGTH)->data, &m);
    n->report_sent++;
    if (n->report_count == 0)
        return;
    m.part = 1;
    m.displacement_x = r->displacement[0];
    m.displacement_y = r->displacement[1];
    m.displacement_z = r->displacement[2];
    wire_contact_pack(enqueue(n, WIRE_CONTACT_ID + n->node_id, WIRE_CONTACT_LENGTH)->data, &m);
}

/* At most NODE_TELEMETRY_FRAMES frames; the turns do not collide but for heartbeat and health, which share a tick. */
static void send_telemetry(struct node *n)
{
    static const uint8_t nmt_state[4] = {
        [SAFETY_INIT] = 127, [SAFETY_READY] = 127, [SAFETY_RUN] = 5, [SAFETY_SAFE] = 4};
    uint32_t now = n->controller.tick_count;
    bool heartbeat = now % 100u == 50u, health = now % 16u == 8u;
    if (heartbeat)
        send_heartbeat(n, nmt_state[n->controller.safety.state]);
    if (health)
        send_health(n);
    if (heartbeat || health)
        return;
    if (now % 10u == 5u)
        send_force_pose(n);
    else
        send_contact(n);
}

void node_finish_tick(struct node *n)
{
    tick(&n->controller, n->bank, &n->input, &n->output);
    n->input = (struct tick_input){.fresh = false};
    send_torques(n);
    send_emergency(n);
    send_telemetry(n);
}
