/* What the host knows of a controller from the frames it hears: pose, force, contacts, health. Frames are decoded with
 * the generated wire code only; anything malformed is counted and ignored.
 *
 * A set of contacts (or a pair of tip and force) comes in several frames with one set number. It is handed on when all
 * of it has arrived, in whatever order; frames may be lost, repeated or late. A frame that is older than the newest set
 * is ignored, a newer one ends the assembly under way. Numbers repeat after 32 sets (8 pairs), so an assembly is given
 * up LINK_CONTACT_WINDOW_US after its first frame: as a controller begins a set at most every 16 ms and a pair at most every
 * 10 ms, and takes at most 160 ms for a set and sends a pair at once, no two sets can be mixed as long as no frame is later
 * than 100 ms (pairs: 40 ms). Frames of one set
 * that contradict each other (a corrupted one among them) throw the set away. */
#ifndef TROCAR_LINK_H
#define TROCAR_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "can_frame.h"

enum { LINK_MAX_CONTACTS = 16, LINK_HEALTH = 26, LINK_CONTACT_WINDOW_US = 250000, LINK_POSE_WINDOW_US = 40000 };

struct link_contact {
    uint32_t triangle;
    double weights[2]; /* of the triangle's vertices 1 and 2 */
    double displacement_m[3];
};

/* A set that is being put together. */
struct link_assembly {
    bool open;  /* frames of it are still expected */
    bool known; /* `set` is the newest that was seen, within the window behind `first_us` */
    unsigned set;
    uint64_t first_us;
};

struct link {
    uint8_t node_id;
    /* the last complete set of each kind */
    size_t contact_count; /* 0: nothing is touched */
    struct link_contact contact[LINK_MAX_CONTACTS];
    uint64_t contact_time_us, contact_sets;
    double tip_m[3], force_N[3];
    unsigned contacts_reported; /* how many the controller says it has, with force_N */
    unsigned state;             /* enum safety_state; from the newest frame that carries it */
    uint64_t pose_time_us, pose_sets;
    unsigned grip, roll;          /* raw counts of the newest sample; 0, and BANK_MIDDLE_ROLL, before the first */
    uint32_t health[LINK_HEALTH]; /* in the order of link_health_name */
    uint64_t health_time_us;
    int reason;         /* 0 or the STATUS_LOOP_* of SAFE */
    unsigned nmt_state; /* of the last heartbeat: 0, 4, 5, 127 */
    uint64_t heartbeat_time_us;
    /* counters; frames = useful + malformed + foreign + late */
    uint64_t frames;
    uint64_t malformed;       /* of this controller, but with a length, page or value that cannot be */
    uint64_t foreign;         /* of another node, or not of this protocol */
    uint64_t late;            /* repeated, or of a set that is over */
    uint64_t incomplete_sets; /* contact sets and pairs of which a frame was lost, or all (unless a whole window was) */
    /* assembly of the sets under way */
    struct link_assembly contact_assembly, pose_assembly;
    struct link_contact pending[LINK_MAX_CONTACTS];
    uint32_t pending_have; /* two bits per slot */
    unsigned pending_count;
    bool pending_count_known;
    double pending_tip_m[3], pending_force_N[3];
    unsigned pending_contacts, pending_state, pending_pose_have; /* bit per part */
};

/* node_id 1..126. */
void link_start(struct link *link, uint8_t node_id);
/* Any frame; `time_us` is when it was received, from a clock that does not go back. */
void link_receive(struct link *link, const struct can_frame_t *frame, uint64_t time_us);
const char *link_health_name(unsigned index); /* NULL past the end */

#endif
