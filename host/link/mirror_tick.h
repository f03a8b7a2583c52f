/* One tick of the mirror: the controller's objects on the frames that wait for it, as many of them as agree with the torques that were
 * heard; and the way back. Which frames are of which tick is mirror.c's. */
#ifndef TROCAR_MIRROR_TICK_H
#define TROCAR_MIRROR_TICK_H

#include "mirror.h"
#include "wire.h"

/* A copy of the whole mirror, and back to it. */
void mirror_keep(struct mirror *mirror);
void mirror_turn_back(struct mirror *mirror);

void mirror_begin(struct mirror *mirror);
/* A frame that waits for the controller. */
void mirror_pend(struct mirror *mirror, const struct can_frame_t *frame, uint64_t time_us);
/* End the tick with the torque frames that were heard: the longest part of the frames from before them with which they all agree,
 * else all; without any, those that came in time for a sample. Counts what agrees. */
bool mirror_end(struct mirror *mirror);

bool mirror_same(const struct can_frame_t *a, const struct can_frame_t *b);
uint32_t mirror_heard(const struct mirror *mirror); /* torque frames of the tick that is open */
/* Which instrument's sample is this? `count` when it is none. */
uint32_t mirror_sample_of(const struct mirror *mirror, const struct can_frame_t *frame, struct wire_encoders *sample);

#endif
