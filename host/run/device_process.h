/* The simulated instrument and its hand as a node on a bus, for a controller that is another program or a board.
 *
 * Time is the controller's: every SYNC is one millisecond of the mechanics (several when frames were lost: its counter tells),
 * so nothing depends on how promptly this process runs. As on the simulated bus the sample is taken at the SYNC, and a torque
 * acts from DEVICE_PROCESS_TORQUE_US after it. Without SYNC for DEVICE_PROCESS_SILENCE_US of the clock on the wall the motors are dropped, and
 * it is waited for the next one. */
#ifndef TROCAR_DEVICE_PROCESS_H
#define TROCAR_DEVICE_PROCESS_H

#include <stdbool.h>
#include <stdint.h>

#include "backend.h"
#include "bench.h"

enum {
    DEVICE_PROCESS_TORQUE_US = 550, /* SPEC.md, one tick: torque arrives by 635, SYNC by 65 */
    DEVICE_PROCESS_SILENCE_US =
        500000, /* a controller that is slowed down shows SYNC less often than every millisecond */
    DEVICE_PROCESS_SETTLE_TICKS = 200, /* after the gesture */
    DEVICE_PROCESS_WAIT_TICKS = 1000   /* the hand waits so long for torque */
};

struct device_process_options {
    const char *gesture; /* name or file; NULL: press */
    const char *device;  /* NULL: the bank's */
    uint32_t instrument; /* of the bank, from 0 */
    uint8_t node;
    uint64_t ticks; /* SYNCs; 0: until the gesture is over */
    bool repeat;    /* the gesture over and over */
};

struct device_process {
    struct device_process_options options;
    struct bench_instrument bench;
    struct backend *backend;
    uint64_t ticks, gesture_tick, unsent; /* unsent: encoder frames that the bus had no room for */
    uint64_t skipped;                     /* ticks whose SYNC was lost */
    uint32_t since_sample_us;
    uint8_t counter;
    bool moving; /* the hand */
};

/* Open the bus and put the instrument on it. STATUS_* of backend_open, gestures, bench_hand. */
int device_process_start(struct device_process *p, const struct bank_file *bank, const char *bus,
                         const struct device_process_options *options, struct failure *why);
/* Until the end, or interrupted. STATUS_BUS_* when the bus fails for good; one that goes down is printed on stderr by `say`. */
int device_process_run(struct device_process *p, void (*say)(const struct failure *why), struct failure *why);
void device_process_end(struct device_process *p);

#endif
