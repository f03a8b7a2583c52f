/* What the host knows of a controller from the frames it hears: pose, force, contacts, health. Frames are decoded with
 * the generated wire code only; anything malformed is counted and ignored. */
#ifndef TROCAR_LINK_H
#define TROCAR_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "can_frame.h"

enum { LINK_MAX_CONTACTS = 16 };

struct link_contact {
    uint32_t triangle;
    double weights[2];       /* of the triangle's vertices 1 and 2 */
    double displacement_m[3];
};

struct link {
    uint8_t node_id;
    /* the last complete set of each kind */
    size_t contact_count;
    struct link_contact contact[LINK_MAX_CONTACTS];
    uint64_t contact_time_us, contact_sets;
    double tip_m[3], force_N[3];
    unsigned state;          /* enum safety_state */
    uint64_t pose_time_us;
    uint32_t health[16];     /* in the order of link_health_name */
    int reason;
    uint64_t heartbeat_time_us;
    uint64_t frames, malformed, foreign, incomplete_sets;
    /* assembly of the set under way */
    struct link_contact pending[LINK_MAX_CONTACTS];
    uint32_t pending_have;   /* two bits per slot */
    unsigned pending_set, pending_count;
    bool pending_known;
};

void link_start(struct link *link, uint8_t node_id);
void link_receive(struct link *link, const struct can_frame_t *frame, uint64_t time_us);
const char *link_health_name(unsigned index); /* NULL past the end */

#endif
