/* A recording given to a controller on a bus, in the place of its device: at each of its SYNC frames it gets the frames that
 * the recorded controller got in the next recorded tick, and its torque frame is compared byte for byte with the recorded one.
 *
 * The controller must have been started afresh, and the recording be from a controller's start. What came before the recorded
 * torque frame is sent when SYNC is heard, what came behind it when the torque frame is heard. A sample that
 * is too late for the controller's tick makes it differ; the controller then counts a missed tick. */
#ifndef TROCAR_REPLAY_BUS_H
#define TROCAR_REPLAY_BUS_H

#include <stdio.h>

#include "backend.h"
#include "replay.h"

struct replay_bus_tick {
    size_t first, before, after; /* frames for the controller, before and behind its torque frame */
    struct {
        bool there; /* in the recording */
        uint8_t data[8];
        long line;
    } torques[BANK_MAX_INSTRUMENTS];
};

struct replay_bus {
    unsigned node;  /* of the first instrument */
    uint32_t count; /* instruments that the recording has torques of */
    size_t tick_count, frame_count;
    struct replay_bus_tick *tick;
    struct can_frame_t *frame;
    /* so far */
    size_t at; /* the tick that is next, or under way */
    bool open; /* its SYNC was heard */
    bool heard_torques[BANK_MAX_INSTRUMENTS];
    uint64_t agreed, differed, not_recorded;
    uint64_t unanswered; /* torque frames that the next SYNC came before */
    uint64_t no_room;    /* frames that the bus did not take */
    long line;           /* of the first torque frame that differs; 0: none */
    uint8_t heard[8];
};

/* Read the whole recording. As replay_log says; also STATUS_MEMORY. */
int replay_bus_open(struct replay_bus *replay, FILE *in, const char *file, const struct replay_options *options,
                    struct failure *why);
/* What was heard on the bus; frames are sent in answer. 1: the recording is through; else 0, or what backend_send says. */
int replay_bus_receive(struct replay_bus *replay, struct backend *backend, const struct backend_received *received,
                       struct failure *why);
void replay_bus_close(struct replay_bus *replay); /* zeros are nothing */

#endif
