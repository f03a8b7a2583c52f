/* One run: simulated devices and hands, one controller, host links on a soft bus, in lockstep. Devices, controller and host share
 * nothing but frames; the session reads the controller's state only to count and to compare. Instrument t of the bank is
 * node SESSION_NODE + t.
 *
 * Time of one tick, us after its start: 0 SYNC goes out; about 60 the devices sample; about 200 (of two, 330) their encoders have
 * arrived; at SESSION_COMPUTE_US (SESSION_COMPUTE_TWO_US) the controller computes; about 600 (800) the torques reach the devices. Bus and mechanics advance
 * together in steps of DEVICE_SUBSTEP_US. The host, as any host would from frames alone, starts each instrument when it reports READY,
 * and sends its heartbeat at 10 Hz. The hands begin their gestures when the host has seen RUN of all, or after a second.
 *
 * Everything but the pacing of `realtime` is deterministic: the same bank and options give the same torque log. */
#ifndef TROCAR_SESSION_H
#define TROCAR_SESSION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bank.h"
#include "bench.h"
#include "bus.h"
#include "failure.h"
#include "link.h"
#include "node.h"
#include "session_result.h"

enum {
    SESSION_BIT_RATE = 1000000,
    SESSION_TICK_US = 1000,
    SESSION_COMPUTE_US =
        400, /* SYNC, one frame that was on the bus before it, and encoders fit; one later waits a tick */
    SESSION_COMPUTE_TWO_US = 500, /* the same with the encoders of two */
    SESSION_NODE = 1,
    SESSION_WAIT_TICKS = 1000, /* the hands wait so long for RUN */
    SESSION_SETTLE_TICKS = 200 /* after the longest gesture's end, when `ticks` is 0 */
};

struct session_options {
    const char *gesture[SESSION_INSTRUMENTS]; /* name or file; NULL: press */
    uint64_t ticks;     /* 0: the gesture's length and what SESSION_WAIT_TICKS and SESSION_SETTLE_TICKS add */
    bool realtime;      /* pace to the wall clock (view); else as fast as it goes */
    bool endless;       /* never over by itself (view) */
    bool repeat;        /* gestures over and over */
    bool fem;           /* compare with the full finite-element solve; needs `body` */
    uint32_t fem_every; /* contact ticks between comparisons; 0: 8 to 16 of them spread over the run, and the peak */
    const char *device[SESSION_INSTRUMENTS]; /* name of a model; NULL: the bank's scene's, else the reference device */
    struct bus_faults faults;                /* all probabilities 0: none */
    const char *torque_log;                  /* file for the torque frames as candump log, NULL: none */
};

struct session;

/* `body` may be NULL: no comparison. `bank` and `body` must outlive the session. Refuses a gesture that cannot be read and
 * an instrument whose axis does not meet the body within its range. STATUS_USAGE: a gesture or device for an instrument
 * that the bank has not. */
int session_create(const struct bank_file *bank, const struct body *body, const struct session_options *options,
                   struct session **session, struct failure *why);
/* One tick (1 ms). False when the run is over or interrupted; then nothing has moved. */
bool session_tick(struct session *session);
uint32_t session_instruments(const struct session *session); /* 1 .. SESSION_INSTRUMENTS; `t` below is less */
const struct link *session_link(const struct session *session, uint32_t t);
struct hand *session_hand(struct session *session, uint32_t t);
const struct node *session_node(const struct session *session);
const struct device *session_device(const struct session *session, uint32_t t);
struct bus *session_bus(struct session *session); /* to inject faults, listen, or attach more nodes */
double session_time_s(const struct session *session);
double session_gesture_time_s(const struct session *session); /* 0 until the hands begin */
double session_progress(const struct session *session);       /* 0..1 */
/* As bench_drive says. */
void session_drive(struct session *session, uint32_t t, bool driven, const double target_m[3]);
/* From now on it is never over by itself; allowed after session_finish, which has closed the log. */
void session_continue(struct session *session);
/* Ask all instruments as the host: wire's NMT command, 1 start (acknowledge), 2 stop. */
void session_command(struct session *session, uint8_t nmt_command);
/* Tell the controller, as its port would, that its last tick ended late. */
void session_overrun(struct session *session);
/* Compare, close the log, fill the result. STATUS_INTERRUPTED when the comparison was interrupted. Once only. */
int session_finish(struct session *session, struct session_result *result, struct failure *why);
void session_free(struct session *session); /* NULL is nothing; without session_finish no torque log is left */

#endif
