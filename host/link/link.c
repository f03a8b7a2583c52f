#include "link.h"

#include <string.h>

#include "bank_format.h"
#include "crc.h"
#include "wire.h"

/* In the order of `health`; energy is in steps of WIRE_HEALTH_ENERGY_SCALE. */
enum {
    HEALTH_MISSED,
    HEALTH_IMPLAUSIBLE,
    HEALTH_OUT_OF_SEQUENCE,
    HEALTH_DUPLICATES,
    HEALTH_OVERRUNS,
    HEALTH_SAFE_ENTRIES,
    HEALTH_CLAMPS,
    HEALTH_RATE_LIMITS,
    HEALTH_PASSIVITY_INTERVENTIONS,
    HEALTH_MALFORMED,
    HEALTH_QUEUE_OVERFLOWS,
    HEALTH_WALKS_CUT,
    HEALTH_SOLVER_CUTS,
    HEALTH_NONFINITE,
    HEALTH_RECEIVE_OVERFLOWS,
    HEALTH_ERROR_PASSIVE,
    HEALTH_BUS_OFF,
    HEALTH_CONTACTS_HELD,
    HEALTH_CONTACTS_WAITING,
    HEALTH_ROWS_DROPPED,
    HEALTH_ROW_WORK,
    HEALTH_WORST_TICK,
    HEALTH_STATE_HASH,
    HEALTH_HASH_TICK,
    HEALTH_TICK,
    HEALTH_ENERGY,
    HEALTH_COUNT
};

static const char *const health_names[] = {
    "missed",
    "implausible",
    "out_of_sequence",
    "duplicates",
    "overruns",
    "safe_entries",
    "clamps",
    "rate_limits",
    "passivity_interventions",
    "malformed",
    "queue_overflows",
    "walks_cut",
    "solver_cuts",
    "nonfinite",
    "receive_overflows",
    "error_passive",
    "bus_off",
    "contacts_held",
    "contacts_waiting",
    "rows_dropped",
    "row_work",
    "worst_tick_us",
    "state_hash",
    "hash_tick",
    "tick",
    "energy_100uJ",
};

_Static_assert(HEALTH_COUNT == sizeof((struct link *)0)->health / sizeof(uint32_t), "room for each");
_Static_assert(HEALTH_COUNT == sizeof health_names / sizeof health_names[0], "a name for each");

/* What became of a frame. */
enum verdict { USEFUL, MALFORMED, FOREIGN, LATE };

const char *link_health_name(unsigned index)
{
    return index < HEALTH_COUNT ? health_names[index] : NULL;
}

void link_start(struct link *link, uint8_t node_id)
{
    memset(link, 0, sizeof *link);
    link->node_id = node_id;
    link->roll = BANK_MIDDLE_ROLL;
}

/* Find the place of set number `set` (of `modulus`) in the order of sets. True when the frame belongs to the assembly,
 * which has then been started anew if *fresh; false when it is late. */
static bool place(struct link_assembly *a, unsigned set, unsigned modulus, uint64_t window_us, uint64_t time_us,
                  uint64_t *incomplete, bool *fresh)
{
    *fresh = false;
    if (a->known && time_us - a->first_us < window_us) {
        const unsigned age = (a->set - set) & (modulus - 1);
        if (age == 0)
            return a->open;
        if (age < modulus / 2)
            return false;
        *incomplete += modulus - age - 1; /* those between, of which nothing came */
    }
    *incomplete += a->open;
    *a = (struct link_assembly){.open = true, .known = true, .set = set, .first_us = time_us};
    *fresh = true;
    return true;
}

/* Frames of the set contradict each other: none of it can be trusted. */
static enum verdict reject(struct link *link, struct link_assembly *a)
{
    a->open = false;
    link->incomplete_sets++;
    return MALFORMED;
}

static bool contact_plausible(const struct wire_contact *m)
{
    if (m->part != 0)
        return true;
    /* the weights are rounded one by one, so their sum may pass 1 by one step */
    return m->count <= LINK_MAX_CONTACTS && (m->slot < m->count || (m->slot == 0 && m->count == 0)) &&
           (uint32_t)m->weight1 + m->weight2 <= 65536;
}

static bool same_contact(const struct link_contact *a, const struct link_contact *b)
{
    return a->triangle == b->triangle && memcmp(a->weights, b->weights, sizeof a->weights) == 0 &&
           memcmp(a->displacement_m, b->displacement_m, sizeof a->displacement_m) == 0;
}

static enum verdict receive_contact(struct link *link, const struct can_frame_t *frame, uint64_t time_us)
{
    struct wire_contact m = {0};
    if (!wire_contact_unpack(&m, frame->data, frame->length) || !contact_plausible(&m))
        return MALFORMED;
    struct link_assembly *a = &link->contact_assembly;
    bool fresh;
    if (!place(a, m.set, 32, LINK_CONTACT_WINDOW_US, time_us, &link->incomplete_sets, &fresh))
        return LATE;
    if (fresh) {
        link->pending_have = 0;
        link->pending_count_known = false;
    }
    struct link_contact decoded = link->pending[m.slot];
    if (m.part == 0) {
        if (link->pending_count_known && link->pending_count != m.count)
            return reject(link, a);
        link->pending_count_known = true;
        link->pending_count = m.count;
        decoded.triangle = m.triangle;
        decoded.weights[0] = m.weight1 * (double)WIRE_CONTACT_WEIGHT1_SCALE;
        decoded.weights[1] = m.weight2 * (double)WIRE_CONTACT_WEIGHT2_SCALE;
    } else {
        decoded.displacement_m[0] = m.displacement_x * (double)WIRE_CONTACT_DISPLACEMENT_X_SCALE;
        decoded.displacement_m[1] = m.displacement_y * (double)WIRE_CONTACT_DISPLACEMENT_Y_SCALE;
        decoded.displacement_m[2] = m.displacement_z * (double)WIRE_CONTACT_DISPLACEMENT_Z_SCALE;
    }
    const uint32_t bit = UINT32_C(1) << (2 * m.slot + m.part);
    if (link->pending_have & bit)
        return same_contact(&decoded, &link->pending[m.slot]) ? LATE : reject(link, a);
    link->pending[m.slot] = decoded;
    if (m.part == 1 || m.count > 0)
        link->pending_have |= bit;
    if (!link->pending_count_known)
        return USEFUL;
    const uint32_t whole = (uint32_t)((UINT64_C(1) << 2 * link->pending_count) - 1);
    if (link->pending_have & ~whole)
        return reject(link, a);
    if (link->pending_have == whole) {
        a->open = false;
        memcpy(link->contact, link->pending, sizeof link->contact);
        link->contact_count = link->pending_count;
        link->contact_time_us = time_us;
        link->contact_sets++;
    }
    return USEFUL;
}

static enum verdict receive_pose(struct link *link, const struct can_frame_t *frame, uint64_t time_us)
{
    struct wire_force_pose m = {0};
    if (!wire_force_pose_unpack(&m, frame->data, frame->length) || m.contacts > LINK_MAX_CONTACTS)
        return MALFORMED;
    struct link_assembly *a = &link->pose_assembly;
    bool fresh;
    if (!place(a, m.set, 8, LINK_POSE_WINDOW_US, time_us, &link->incomplete_sets, &fresh))
        return LATE;
    if (fresh)
        link->pending_pose_have = 0;
    const double tip_m[3] = {m.tip_x * (double)WIRE_FORCE_POSE_TIP_X_SCALE,
                             m.tip_y * (double)WIRE_FORCE_POSE_TIP_Y_SCALE,
                             m.tip_z * (double)WIRE_FORCE_POSE_TIP_Z_SCALE};
    const double force_N[3] = {m.force_x * (double)WIRE_FORCE_POSE_FORCE_X_SCALE,
                               m.force_y * (double)WIRE_FORCE_POSE_FORCE_Y_SCALE,
                               m.force_z * (double)WIRE_FORCE_POSE_FORCE_Z_SCALE};
    if (link->pending_pose_have & 1u << m.part) {
        const bool same = m.part == 0 ? memcmp(tip_m, link->pending_tip_m, sizeof tip_m) == 0
                                      : memcmp(force_N, link->pending_force_N, sizeof force_N) == 0 &&
                                            m.contacts == link->pending_contacts && m.state == link->pending_state;
        return same ? LATE : reject(link, a);
    }
    link->pending_pose_have |= 1u << m.part;
    if (m.part == 0) {
        memcpy(link->pending_tip_m, tip_m, sizeof tip_m);
    } else {
        memcpy(link->pending_force_N, force_N, sizeof force_N);
        link->pending_contacts = m.contacts;
        link->pending_state = m.state;
    }
    if (link->pending_pose_have == 3) {
        a->open = false;
        memcpy(link->tip_m, link->pending_tip_m, sizeof link->tip_m);
        memcpy(link->force_N, link->pending_force_N, sizeof link->force_N);
        link->contacts_reported = link->pending_contacts;
        link->state = link->pending_state;
        link->pose_time_us = time_us;
        link->pose_sets++;
    }
    return USEFUL;
}

static enum verdict receive_health(struct link *link, const struct can_frame_t *frame, uint64_t time_us)
{
    struct wire_health m = {0};
    uint32_t *h = link->health;
    if (!wire_health_unpack(&m, frame->data, frame->length) || (m.page == 3 && m.reason > 0))
        return MALFORMED;
    link->state = m.state;
    link->health_time_us = time_us;
    switch (m.page) {
    case 0:
        h[HEALTH_MISSED] = m.missed;
        h[HEALTH_IMPLAUSIBLE] = m.implausible;
        h[HEALTH_OUT_OF_SEQUENCE] = m.out_of_sequence;
        break;
    case 1:
        h[HEALTH_DUPLICATES] = m.duplicates;
        h[HEALTH_OVERRUNS] = m.overruns;
        h[HEALTH_SAFE_ENTRIES] = m.safe_entries;
        break;
    case 2:
        h[HEALTH_CLAMPS] = m.clamps;
        h[HEALTH_RATE_LIMITS] = m.rate_limits;
        h[HEALTH_PASSIVITY_INTERVENTIONS] = m.passivity_interventions;
        break;
    case 3:
        h[HEALTH_MALFORMED] = m.malformed;
        h[HEALTH_QUEUE_OVERFLOWS] = m.queue_overflows;
        link->reason = m.reason;
        break;
    case 4:
        h[HEALTH_TICK] = m.tick;
        h[HEALTH_ENERGY] = m.energy;
        break;
    case 5:
        h[HEALTH_WALKS_CUT] = m.walks_cut;
        h[HEALTH_SOLVER_CUTS] = m.solver_cuts;
        h[HEALTH_NONFINITE] = m.nonfinite;
        break;
    case 6:
        h[HEALTH_RECEIVE_OVERFLOWS] = m.receive_overflows;
        h[HEALTH_ERROR_PASSIVE] = m.error_passive;
        h[HEALTH_BUS_OFF] = m.bus_off;
        break;
    case 7:
        h[HEALTH_CONTACTS_HELD] = m.contacts_held;
        h[HEALTH_CONTACTS_WAITING] = m.contacts_waiting;
        h[HEALTH_ROWS_DROPPED] = m.rows_dropped;
        break;
    case 8:
        h[HEALTH_ROW_WORK] = m.row_work;
        h[HEALTH_WORST_TICK] = m.worst_tick;
        break;
    default: /* 9; others were refused */
        h[HEALTH_STATE_HASH] = m.state_hash;
        h[HEALTH_HASH_TICK] = m.hash_tick;
        break;
    }
    return USEFUL;
}

static enum verdict receive_emergency(struct link *link, const struct can_frame_t *frame)
{
    struct wire_emergency m = {0};
    if (!wire_emergency_unpack(&m, frame->data, frame->length) || m.state > 3 || m.reason > 0)
        return MALFORMED;
    link->state = m.state;
    link->reason = m.reason;
    return USEFUL;
}

static enum verdict receive_heartbeat(struct link *link, const struct can_frame_t *frame, uint64_t time_us)
{
    struct wire_heartbeat m = {0};
    if (!wire_heartbeat_unpack(&m, frame->data, frame->length) ||
        (m.nmt_state != 0 && m.nmt_state != 4 && m.nmt_state != 5 && m.nmt_state != 127))
        return MALFORMED;
    link->nmt_state = m.nmt_state;
    link->heartbeat_time_us = time_us;
    return USEFUL;
}

/* Frames that the controller does not send, or that tell the host little new. */
static enum verdict receive_other(struct link *link, const struct can_frame_t *frame, uint32_t base)
{
    struct wire_encoders encoders;
    struct wire_torques torques;
    bool good;
    if (base == WIRE_ENCODERS_ID) {
        good = wire_encoders_unpack(&encoders, frame->data, frame->length);
        link->grip = good ? encoders.grip : link->grip;
        link->roll = good ? encoders.roll : link->roll;
    } else if (base == WIRE_TORQUES_ID) {
        good = wire_torques_unpack(&torques, frame->data, frame->length) &&
               crc8_frame(frame->id, frame->data, WIRE_TORQUES_LENGTH - 1) == torques.crc;
    } else {
        return FOREIGN;
    }
    return good ? USEFUL : MALFORMED;
}

static enum verdict receive_unnumbered(const struct can_frame_t *frame)
{
    switch (frame->id) {
    case WIRE_NMT_ID:
        return frame->length == WIRE_NMT_LENGTH ? USEFUL : MALFORMED;
    case WIRE_SYNC_ID:
        return frame->length == WIRE_SYNC_LENGTH ? USEFUL : MALFORMED;
    case WIRE_HOST_HEARTBEAT_ID:
        return frame->length == WIRE_HOST_HEARTBEAT_LENGTH ? USEFUL : MALFORMED;
    default:
        return FOREIGN;
    }
}

static enum verdict receive(struct link *link, const struct can_frame_t *frame, uint64_t time_us)
{
    if (frame->flags != 0 || frame->id > 0x7ff)
        return FOREIGN; /* the protocol has only classic data frames with 11-bit identifiers */
    if ((frame->id & 0x7f) != link->node_id)
        return receive_unnumbered(frame);
    const uint32_t base = frame->id - link->node_id;
    switch (base) {
    case WIRE_EMERGENCY_ID:
        return receive_emergency(link, frame);
    case WIRE_CONTACT_ID:
        return receive_contact(link, frame, time_us);
    case WIRE_FORCE_POSE_ID:
        return receive_pose(link, frame, time_us);
    case WIRE_HEALTH_ID:
        return receive_health(link, frame, time_us);
    case WIRE_HEARTBEAT_ID:
        return receive_heartbeat(link, frame, time_us);
    default:
        return receive_other(link, frame, base);
    }
}

void link_receive(struct link *link, const struct can_frame_t *frame, uint64_t time_us)
{
    link->frames++;
    switch (receive(link, frame, time_us)) {
    case USEFUL:
        break;
    case MALFORMED:
        link->malformed++;
        break;
    case FOREIGN:
        link->foreign++;
        break;
    case LATE:
        link->late++;
        break;
    }
}
