/* Time in lockstep, in memory that the R5F and the bridge on the A53 share. The R5F says until when it idles and then counts
 * `asked` up; the bridge takes the frames that it has sent off the bus, fetches what the host answers, puts those frames on
 * the bus, says what time it then is, and sets `granted` to `asked`. So frames go by the CAN controllers alone, and nothing
 * but the time by this memory. All 0 at start. */
#ifndef TROCAR_ZCU102_MAILBOX_H
#define TROCAR_ZCU102_MAILBOX_H

#include <stdint.h>

#define MAILBOX_ADDRESS 0xFFFC0000u

struct mailbox {
    volatile uint64_t until_us; /* the R5F's */
    volatile uint64_t time_us;  /* the bridge's, as the rest */
    volatile uint32_t asked;    /* the R5F's */
    volatile uint32_t granted;
    volatile uint32_t ended; /* the input has come to its end */
};

#endif
