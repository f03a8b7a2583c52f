/* Which faults befall the next frame on the simulated bus: decided from a seed alone, so that a run can be repeated.
 *
 * Every frame in the identifier range takes the same number of draws whatever the probabilities are: raising one kind
 * of fault does not change which frames suffer another. A dropped frame suffers nothing else; of delay and reorder only
 * the first applies. */
#ifndef TROCAR_FAULTS_H
#define TROCAR_FAULTS_H

#include <stdbool.h>
#include <stdint.h>

#include "bus.h"

struct faults {
    struct bus_faults setting;
    uint64_t choice_state, bit_state; /* of the two generators: which frames, which bits */
};

struct fault {
    bool drop, duplicate, delay, corrupt, reorder;
};

void faults_start(struct faults *faults, const struct bus_faults *setting);
struct fault faults_next(struct faults *faults, const struct can_frame_t *frame);

/* Flip one to three different bits of identifier and data. The frame stays one that CAN's own CRC would pass, so that
 * the receivers' checks are what stands against it. */
void faults_corrupt(struct faults *faults, struct can_frame_t *frame);

#endif
