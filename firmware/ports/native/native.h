/* The parts of the native port: two buses behind one hal.h, and real time on Linux.
 *
 *   stdio   frames and time in lockstep on standard input and output (../lockstep.h): simulated time
 *   live    a bus of this machine (host/link/backend.h), time from the clock or from another's SYNC */
#ifndef TROCAR_NATIVE_H
#define TROCAR_NATIVE_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "can_frame.h"

struct backend;

/* hal.h's functions of the same names. */
struct native_bus {
    uint64_t (*time_us)(void);
    uint64_t (*wait_us)(uint64_t until_us);
    bool (*receive)(struct can_frame_t *frame);
    bool (*transmit)(const struct can_frame_t *frame);
    struct can_errors (*errors)(void);
};

extern const struct native_bus stdio_bus, live_bus;

struct native_options {
    const char *bank, *bus; /* bus NULL: stdio */
    uint8_t node;           /* of the first instrument */
    uint32_t instruments;   /* of the bank: nodes from `node` on */
    bool follow;            /* SYNC comes from somebody else on the bus, a recording, and gives the time */
    uint32_t slow;  /* a tick takes so many milliseconds at least, and until its samples are there; 1: real time */
    uint64_t ticks; /* 0: until SIGINT or SIGTERM */
};

bool native_running(void);
void native_stop(void); /* at the next opportunity; safe in a signal handler */

/* Open the bus; an exit code, 0 when it is open (the message is on stderr). live_close says on `out` what the run was like. */
int live_open(const struct native_options *options);
void live_close(FILE *out);

/* Lateness: how long after the time for which it asked a thread goes on, as cyclictest measures it. In bins of 1 us. */
enum { LATENESS_BINS = 20000 };
struct lateness {
    uint64_t count, beyond; /* beyond: later than the last bin */
    uint64_t total_ns, worst_ns;
    uint32_t bin[LATENESS_BINS];
};
void lateness_add(struct lateness *l, int64_t ns);
/* Below this lie `share` of all, us; the next whole one. */
double lateness_quantile_us(const struct lateness *l, double share);
/* "NAME: max 812 us, 99.9 % below 97 us, mean 11.2 us, of 60000" */
void lateness_print(FILE *out, const char *name, const struct lateness *l);

/* SCHED_FIFO, locked memory, a timer slack of 1 ns: what of it this process may have; one line on stderr for what it may not. */
void realtime_enter(void);
/* "SCHED_FIFO 80, memory locked; Linux 6.1.0 (not PREEMPT_RT), 2 processors" */
void realtime_print(FILE *out);
/* Sleep on absolute times every millisecond with no work in between: the machine's own limit, beside which the loop's
 * lateness is to be read. */
void realtime_bare(uint32_t seconds, struct lateness *l);
/* Sleep until an absolute time of the monotonic clock, or a signal; returns how late it is, ns, or -1 for a signal. */
int64_t realtime_sleep(uint64_t until_ns);
uint64_t realtime_now_ns(void);

#endif
