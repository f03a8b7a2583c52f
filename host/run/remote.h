/* The host of a controller that is out there on a bus, another program or a board: hears it (link.h), starts it when it reports READY, sends the host's
 * heartbeat at 10 Hz, keeps its torque frames. What it knows is what passed on the bus: a second instrument, node + 1, is there from its
 * first frame on, and is started like the first. */
#ifndef TROCAR_REMOTE_H
#define TROCAR_REMOTE_H

#include <stdbool.h>
#include <stdint.h>

#include "backend.h"
#include "failure.h"
#include "bank_format.h"
#include "link.h"
#include "mirror.h"
#include "torque_log.h"

enum {
    REMOTE_FIRST_US = 10000000, /* so long the first SYNC is waited for */
    REMOTE_SILENCE_US = 2000000 /* so long without SYNC, and the controller is given up */
};

struct remote_options {
    const char *bus, *torque_log; /* torque_log NULL: only its hash */
    uint8_t node;                 /* of the first instrument */
    uint64_t ticks;               /* SYNCs; 0: until interrupted */
    bool patient;                 /* a silent controller is waited for without end (view) */
    struct mirror *mirror;        /* gets every frame; NULL: none */
};

struct remote_instrument {
    struct link link;
    double peak_force_N;
    uint64_t torques; /* torque frames */
    bool wants_start, ran, answered;
};

struct remote {
    struct remote_options options;
    struct backend *backend;
    uint32_t instruments; /* heard of */
    struct remote_instrument instrument[BANK_MAX_INSTRUMENTS];
    struct torque_log log;
    uint64_t ticks, first_us, last_us,
        sync_us;         /* ticks: by SYNC's counter; times of arrival of the first and the newest frame */
    uint64_t unanswered; /* SYNCs that not every instrument's torque followed */
    uint8_t counter;
    bool stopped, mirrored; /* mirrored: the mirror agrees with what was heard last */
    uint64_t heard_us;      /* of the monotonic clock: when SYNC came last */
};

int remote_open(struct remote *r, const struct remote_options *options, struct failure *why);
/* Take what arrives within `wait_us`, at least one frame if there is one. 1 to go on, 0 when it is over or interrupted;
 * STATUS_BUS_LOST for a silent controller; what goes down and may come back is told by `say`. */
int remote_step(struct remote *r, int64_t wait_us, void (*say)(const struct failure *why), struct failure *why);
/* NMT to every instrument: 1 start (acknowledge), 2 stop. */
int remote_command(struct remote *r, uint8_t nmt_command, struct failure *why);
/* Close the log and the bus. */
int remote_finish(struct remote *r, char torque_log_sha256[65], struct failure *why);
void remote_free(struct remote *r);

#endif
