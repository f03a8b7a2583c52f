/* The host's own controller: the same objects on the same bank, run on the frames that pass on the bus. It computes what the
 * real one computes, bit for bit, so the host holds the controller's whole state (every contact of every tick) at no
 * bandwidth, and a recording can be replayed.
 *
 * A tick begins with SYNC (or, when that was lost, with a torque frame) and ends with the controller's torque frame, of two
 * instruments with the second, with which the mirror's own are compared. Frames for the controller that came in between are given to it in their order. Which of
 * them came too late for it is not seen on the bus; where there is a choice (no sample, several, or a command), the longest
 * part of them is taken with which the torques agree, and the rest waits for the next tick. Without a torque frame, what came
 * later than a controller waits for its sample is left. SYNC's counter tells of ticks that
 * were lost altogether.
 *
 * A boot-up heartbeat starts the mirror anew. One that joins a controller in the middle of its run knows neither its contacts
 * nor its state: it follows the state that is heard, and agrees once the instrument has left the tissue.
 *
 * Agreement is told by the torque frames of every tick and by the state hash in Health. What the bus does not carry (a
 * tick that the port saw end late) the mirror cannot know; then it differs, and says so. */
#ifndef TROCAR_MIRROR_H
#define TROCAR_MIRROR_H

#include <stdbool.h>
#include <stdint.h>

#include "failure.h"
#include "node.h"

enum { MIRROR_PENDING = 16, MIRROR_PAST = 8 };

enum mirror_verdict {
    MIRROR_NOTHING, /* the frame compares nothing */
    MIRROR_AGREES,
    MIRROR_DIFFERS,
    MIRROR_DAMAGED /* a torque frame whose length or CRC is wrong: no device takes it */
};

struct mirror {
    struct node node;
    uint32_t count;                                   /* instruments, as many as the bank has */
    struct can_frame_t torques[BANK_MAX_INSTRUMENTS]; /* its own of the last tick that ended */
    struct can_frame_t recorded, computed; /* the last torque frame that differed; the same twice when it was a hash */
    uint64_t ticks;
    uint64_t agreed, differed, damaged; /* torque frames */
    uint64_t unanswered; /* torque frames that were not heard; agreed + differed + unanswered = ticks x instruments */
    uint64_t lost_ticks; /* of these, ticks of which nothing was heard; run without a sample */
    uint64_t hashes_agreed, hashes_differed;
    uint64_t late;   /* frames that the controller took one tick after they were heard */
    uint64_t starts; /* boot-up heartbeats: the mirror starts again with the controller */
    bool joined;     /* the first SYNC was not a controller's first: until torque and contact are new, it may differ */
    /* own */
    const struct bank_view *bank;
    bool open; /* a tick has begun */
    bool any_sync;
    bool
        doubtful; /* the last tick was ended by SYNC with the torques of one instrument only; `before` is before that */
    size_t old_pending;         /* of the frames that wait, those from before SYNC */
    int8_t sync_off;            /* SYNC's counter less the mirror's, and how often it has been so in a row */
    unsigned same_off, ignored; /* ignored: SYNCs that were behind, in a row */
    uint64_t sync_us, torques_us[BANK_MAX_INSTRUMENTS]; /* when the last of each was heard */
    bool heard[BANK_MAX_INSTRUMENTS];                   /* the controller's torques of the tick that is open */
    struct can_frame_t heard_torques[BANK_MAX_INSTRUMENTS];
    size_t before_torques;                                      /* of the frames that wait, those before the first */
    struct can_frame_t past[MIRROR_PAST][BANK_MAX_INSTRUMENTS]; /* own torque frames of tick n at n mod MIRROR_PAST */
    bool missing[MIRROR_PAST][BANK_MAX_INSTRUMENTS];            /* the controller's was not heard */
    size_t pending_count, row_bytes;
    struct can_frame_t pending[MIRROR_PENDING];
    uint64_t pending_us[MIRROR_PENDING];
    unsigned char *rows, *saved_rows, *before_rows;
    struct node saved;
    struct mirror *before; /* a copy to turn back to */
};

/* A controller that starts on the bank, which must outlive it; its first instrument is node `node_id`. STATUS_MEMORY, or what
 * node_start says. */
int mirror_open(struct mirror *mirror, const struct bank_view *bank, uint8_t node_id, struct failure *why);
void mirror_close(struct mirror *mirror); /* zeros are nothing */

/* The next frame of the bus, with the time at which it was heard, us. */
enum mirror_verdict mirror_receive(struct mirror *mirror, const struct can_frame_t *frame, uint64_t time_us);

/* Nothing follows: end the tick that is open. */
void mirror_finish(struct mirror *mirror);

#endif
