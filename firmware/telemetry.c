#include "telemetry.h"

#include "state_hash.h"
#include "wire.h"

const struct telemetry_pace telemetry_paces[2] = {
    {.contact = 2, .set = 16, .pose = 10, .health = 10, .heartbeat = 100},
    {.contact = 5, .set = 20, .pose = 20, .health = 50, .heartbeat = 100},
};

/* In which tick of each turn, [pace][instrument], such that no two meet: modulo 2 (5) contacts have a rest of their own. */
struct phase {
    uint32_t contact, pose, health, heartbeat;
};
static const struct phase phases[2][2] = {
    {{0, 5, 1, 3}, {0, 5, 1, 3}},
    {{0, 2, 3, 4}, {1, 7, 13, 14}},
};

const struct telemetry_pace *telemetry_pace(const struct bank_view *bank)
{
    return &telemetry_paces[bank->tool_count > 1u ? 1 : 0];
}

static struct can_frame_t frame_of(uint32_t id, uint8_t node_id, uint8_t length)
{
    return (struct can_frame_t){.id = id + node_id, .length = length};
}

struct can_frame_t telemetry_heartbeat(uint8_t node_id, uint8_t nmt_state)
{
    struct can_frame_t frame = frame_of(WIRE_HEARTBEAT_ID, node_id, WIRE_HEARTBEAT_LENGTH);
    struct wire_heartbeat m = {.nmt_state = nmt_state};
    wire_heartbeat_pack(frame.data, &m);
    return frame;
}

static uint16_t saturate(uint32_t counter)
{
    return counter > 0xFFFFu ? 0xFFFFu : (uint16_t)counter;
}

static struct can_frame_t health(struct telemetry *t, const struct controller *c, uint32_t tool,
                                 const struct telemetry_counters *node, uint8_t node_id)
{
    const struct safety *s = &c->instrument[tool].safety;
    const struct coupling *coupling = &c->instrument[tool].coupling;
    struct wire_health m = {
        .page = (uint8_t)t->health_page,
        .state = (uint8_t)s->state,
        .missed = saturate(s->missed),
        .implausible = saturate(s->implausible),
        .out_of_sequence = saturate(s->out_of_sequence),
        .duplicates = saturate(s->duplicates),
        .overruns = saturate(s->overruns),
        .safe_entries = saturate(s->safe_entries),
        .clamps = saturate(coupling->clamps),
        .rate_limits = saturate(coupling->rate_limits),
        .passivity_interventions = saturate(coupling->passivity_interventions),
        .malformed = saturate(node->malformed),
        .queue_overflows = saturate(node->queue_overflows),
        .reason = (int16_t)s->reason,
        .tick = c->tick_count,
        .energy = (uint16_t)wire_quantise(coupling->energy_J, WIRE_HEALTH_ENERGY_SCALE, WIRE_HEALTH_ENERGY_BITS, false),
        .walks_cut = saturate(c->collide.walks_cut),
        .solver_cuts = saturate(c->contact.cut),
        .nonfinite = saturate(s->nonfinite),
        .receive_overflows = saturate(node->bus.receive_overflows),
        .error_passive = saturate(node->bus.error_passive),
        .bus_off = saturate(node->bus.bus_off),
        .contacts_held = saturate(c->contact.held),
        .contacts_waiting = saturate(c->contact.waiting),
        .rows_dropped = saturate(c->rows.rows_dropped),
        .row_work = c->rows.most_work,
        .worst_tick = saturate(node->worst_tick_us),
        .hash_tick = (uint16_t)c->tick_count,
    };
    if (t->health_page == TELEMETRY_HEALTH_PAGES - 1u)
        m.state_hash = state_hash(c);
    t->health_page = (t->health_page + 1u) % TELEMETRY_HEALTH_PAGES;
    struct can_frame_t frame = frame_of(WIRE_HEALTH_ID, node_id, WIRE_HEALTH_LENGTH);
    wire_health_pack(frame.data, &m);
    return frame;
}

static uint32_t force_pose(struct telemetry *t, const struct controller *c, uint32_t tool, uint8_t node_id,
                           struct can_frame_t *frame)
{
    const struct instrument *own = &c->instrument[tool];
    const float *tip = own->kinematics.tip_m, *force = own->coupling.force_N;
    uint32_t contacts = 0;
    for (uint32_t i = 0; i < c->contact.count; i++) /* bound: CONTACT_MAX */
        contacts += contact_tool(&c->contact.contact[i]) == tool;
    t->pose_set = (t->pose_set + 1u) & 7u;
    for (uint8_t part = 0; part < 2; part++) { /* bound: 2 */
        struct wire_force_pose m = {
            .part = part,
            .set = (uint8_t)t->pose_set,
            .tip_x = wire_quantise(tip[0], WIRE_FORCE_POSE_TIP_X_SCALE, WIRE_FORCE_POSE_TIP_X_BITS, true),
            .tip_y = wire_quantise(tip[1], WIRE_FORCE_POSE_TIP_Y_SCALE, WIRE_FORCE_POSE_TIP_Y_BITS, true),
            .tip_z = wire_quantise(tip[2], WIRE_FORCE_POSE_TIP_Z_SCALE, WIRE_FORCE_POSE_TIP_Z_BITS, true),
            .force_x =
                (int16_t)wire_quantise(force[0], WIRE_FORCE_POSE_FORCE_X_SCALE, WIRE_FORCE_POSE_FORCE_X_BITS, true),
            .force_y =
                (int16_t)wire_quantise(force[1], WIRE_FORCE_POSE_FORCE_Y_SCALE, WIRE_FORCE_POSE_FORCE_Y_BITS, true),
            .force_z =
                (int16_t)wire_quantise(force[2], WIRE_FORCE_POSE_FORCE_Z_SCALE, WIRE_FORCE_POSE_FORCE_Z_BITS, true),
            .contacts = (uint8_t)contacts,
            .state = (uint8_t)own->safety.state,
        };
        frame[part] = frame_of(WIRE_FORCE_POSE_ID, node_id, WIRE_FORCE_POSE_LENGTH);
        wire_force_pose_pack(frame[part].data, &m);
    }
    return 2;
}

/* Copy the contacts that push, as wire integers; those that only touch displace nothing. */
static void take_contacts(struct telemetry *t, const struct controller *c, uint32_t tool)
{
    const struct contact_set *s = &c->contact;
    t->count = t->sent = 0;
    t->set = (t->set + 1u) & 31u;
    t->set_tick = c->tick_count;
    for (uint32_t i = 0; i < s->count; i++) { /* bound: CONTACT_MAX */
        const struct contact *from = &s->contact[i];
        if (contact_tool(from) != tool || !(from->pressure_N > 0.0f))
            continue;
        struct telemetry_contact *to = &t->contact[t->count++];
        to->triangle = from->triangle;
        to->weight1 =
            (uint16_t)wire_quantise(from->weights[1], WIRE_CONTACT_WEIGHT1_SCALE, WIRE_CONTACT_WEIGHT1_BITS, false);
        to->weight2 =
            (uint16_t)wire_quantise(from->weights[2], WIRE_CONTACT_WEIGHT2_SCALE, WIRE_CONTACT_WEIGHT2_BITS, false);
        for (int k = 0; k < 3; k++) /* bound: 3 */
            to->displacement[k] = wire_quantise(from->displacement_m[k], WIRE_CONTACT_DISPLACEMENT_X_SCALE,
                                                WIRE_CONTACT_DISPLACEMENT_X_BITS, true);
    }
}

/* The next frame of the set being sent: of each contact where it is, then how far it is displaced. Without contact, one
 * frame that says so. False while the next set is not due. */
static bool contact(struct telemetry *t, const struct controller *c, uint32_t tool, const struct telemetry_pace *pace,
                    uint8_t node_id, struct can_frame_t *frame)
{
    if (t->sent >= 2u * t->count) {
        if (t->sent > 0 && c->tick_count - t->set_tick < pace->set)
            return false;
        take_contacts(t, c, tool);
    }
    uint32_t slot = t->sent / 2u;
    const struct telemetry_contact *r = &t->contact[slot];
    struct wire_contact m = {.slot = (uint8_t)slot, .set = (uint8_t)t->set, .count = (uint8_t)t->count};
    if (t->sent & 1u) {
        m.part = 1;
        m.displacement_x = r->displacement[0];
        m.displacement_y = r->displacement[1];
        m.displacement_z = r->displacement[2];
    } else if (t->count > 0) {
        m.triangle = r->triangle;
        m.weight1 = r->weight1;
        m.weight2 = r->weight2;
    }
    *frame = frame_of(WIRE_CONTACT_ID, node_id, WIRE_CONTACT_LENGTH);
    wire_contact_pack(frame->data, &m);
    t->sent++;
    return true;
}

uint32_t telemetry_tick(struct telemetry *t, const struct controller *c, uint32_t tool, const struct bank_view *bank,
                        const struct telemetry_counters *counters, uint8_t node_id,
                        struct can_frame_t frame[TELEMETRY_FRAMES])
{
    static const uint8_t nmt_state[4] = {
        [SAFETY_INIT] = 127, [SAFETY_READY] = 127, [SAFETY_RUN] = 5, [SAFETY_SAFE] = 4};
    const struct telemetry_pace *pace = telemetry_pace(bank);
    const struct phase *phase = &phases[pace - telemetry_paces][tool & 1u];
    uint32_t now = c->tick_count;
    if (now % pace->pose == phase->pose)
        return force_pose(t, c, tool, node_id, frame);
    if (now % pace->health == phase->health) {
        frame[0] = health(t, c, tool, counters, node_id);
        return 1;
    }
    if (now % pace->heartbeat == phase->heartbeat) {
        frame[0] = telemetry_heartbeat(node_id, nmt_state[c->instrument[tool].safety.state]);
        return 1;
    }
    if (now % pace->contact == phase->contact)
        return contact(t, c, tool, pace, node_id, &frame[0]) ? 1 : 0;
    return 0;
}
