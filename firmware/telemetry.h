/* What a controller tells beside its torques, and when: heartbeat, health, force and pose, contacts. None of it moves a
 * motor; it waits for the torque frame by its identifier.
 *
 * The turns are fixed numbers of ticks, chosen so that two instruments with all of their telemetry stay below 70 % of 1 Mbit/s
 * even if every frame had as many stuff bits as can be (SPEC.md, Bus load; `trocar busload`). On a bus of two no turn of
 * one instrument meets one of the other: no tick has more than TELEMETRY_FRAMES frames of telemetry in all.
 *
 * Contacts go one frame at a turn, so a set of m pushing contacts takes 2 m turns, and is of one instant: it is copied when it
 * begins. So are tip and force. */
#ifndef TROCAR_TELEMETRY_H
#define TROCAR_TELEMETRY_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "tick.h"

/* Ticks from one to the next. */
struct telemetry_pace {
    uint32_t contact;   /* frame of contacts */
    uint32_t set;       /* beginning of a set, at the soonest */
    uint32_t pose;      /* pair of force and pose */
    uint32_t health;    /* page */
    uint32_t heartbeat; /* frame */
};

/* [0]: the bus is this instrument's; [1]: it is shared by two, each at this pace. */
extern const struct telemetry_pace telemetry_paces[2];

enum {
    TELEMETRY_FRAMES = 2, /* of one instrument in a tick */
    TELEMETRY_HEALTH_PAGES = 10
};

struct telemetry_contact { /* one contact as it goes on the wire: raw integers of wire.dbc */
    uint32_t triangle;
    uint16_t weight1, weight2;
    int32_t displacement[3];
};

struct telemetry {
    /* set of contacts being sent, so that its frames belong together */
    uint32_t count, sent, set; /* contacts; frames of it; its number */
    uint32_t set_tick;         /* when it began */
    struct telemetry_contact contact[CONTACT_MAX];
    uint32_t health_page, pose_set;
};

/* Counters that are the node's or the port's. */
struct telemetry_counters {
    uint32_t malformed, queue_overflows, worst_tick_us;
    struct can_errors bus;
};

/* The pace of a controller on its bus: shared when the bank has two instruments. */
const struct telemetry_pace *telemetry_pace(const struct bank_view *bank);

/* The frames of an instrument in this tick, after tick(); returns how many. `t`, `node_id`: the instrument's. */
uint32_t telemetry_tick(struct telemetry *t, const struct controller *c, uint32_t tool, const struct bank_view *bank,
                        const struct telemetry_counters *counters, uint8_t node_id,
                        struct can_frame_t frame[TELEMETRY_FRAMES]);

/* The heartbeat frame with this CANopen state: 0 at boot-up. */
struct can_frame_t telemetry_heartbeat(uint8_t node_id, uint8_t nmt_state);

#endif
