/* The wall clock for runs in real time: deadlines on the monotonic clock, absolute, so that no error adds up. Simulated
 * time needs no clock: it is the number of ticks. */
#ifndef TROCAR_CLOCK_H
#define TROCAR_CLOCK_H

#include <stdint.h>
#include <time.h>

struct clock {
    struct timespec deadline;
    uint64_t late; /* ticks that began more than one tick behind */
};

void clock_begin(struct clock *clock);
/* Wait until `tick_us` after the last deadline. More than CLOCK_FORGIVE_US behind (the program was stopped), the past is
 * let go instead of run through in a rush. */
enum { CLOCK_FORGIVE_US = 50000 };
void clock_wait(struct clock *clock, uint32_t tick_us);

#endif
