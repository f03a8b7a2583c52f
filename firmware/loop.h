/* The controller's main loop on a HAL: one tick per millisecond of hal_time_us, as shared/SPEC.md's "Wire" draws it. */
#ifndef TROCAR_LOOP_H
#define TROCAR_LOOP_H

#include <stdint.h>

enum {
    LOOP_MAX_NODE = 126, /* 0 is everybody's, 127 the host's */
    LOOP_TICK_US = 1000,
    LOOP_SAMPLE_WAIT_US = 500, /* after SYNC: the encoder frame takes 195 us on an idle bus, 330 us behind one other */
    LOOP_FRAMES_PER_TICK = 32  /* more than a bus at 1 Mbit/s carries in a millisecond */
};

/* Check the bank, then tick until hal_running says no. Returns STATUS_OK, STATUS_USAGE for a node that cannot be, or the STATUS_BANK_* for which the bank was
 * refused: then no tick ran, and the refusal was sent as an emergency frame (code 0x6300, CiA 301 "data set"); with
 * STATUS_BANK_EFFECT its tick is the bits of the effects that this image lacks (shared/effects.def). */
int loop_run(uint8_t node_id);

#endif
