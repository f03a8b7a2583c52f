/* One run: simulated device and hand, controller, host link on a soft bus, in lockstep. Device, controller and host share
 * nothing but frames; the session reads the controller's state only to count and to compare.
 *
 * Time of one tick, us after its start: 0 SYNC goes out; about 60 the device samples; about 200 its encoders arrive; at
 * SESSION_COMPUTE_US the controller computes; about 600 the torques reach the device. Bus and mechanics advance together in
 * steps of DEVICE_SUBSTEP_US. The host, as any host would from frames alone, starts the controller when it reports READY,
 * and sends its heartbeat at 10 Hz. The hand begins its gesture when the host has seen RUN, or after a second.
 *
 * Everything but the pacing of `realtime` is deterministic: the same bank and options give the same torque log. */
#ifndef TROCAR_SESSION_H
#define TROCAR_SESSION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bank.h"
#include "bus.h"
#include "device.h"
#include "failure.h"
#include "hand.h"
#include "link.h"
#include "node.h"

enum {
    SESSION_BIT_RATE = 1000000,
    SESSION_TICK_US = 1000,
    SESSION_COMPUTE_US =
        400, /* SYNC, one frame that was on the bus before it, and encoders fit; one later waits a tick */
    SESSION_NODE = 1,
    SESSION_WAIT_TICKS = 1000, /* the hand waits so long for RUN */
    SESSION_SETTLE_TICKS = 200 /* after the gesture's end, when `ticks` is 0 */
};

#define SESSION_DRIVE_m_s 0.5

struct session_options {
    const char *gesture; /* name or file; NULL: press */
    uint64_t ticks;      /* 0: the gesture's length and what SESSION_WAIT_TICKS and SESSION_SETTLE_TICKS add */
    bool realtime;       /* pace to the wall clock (view); else as fast as it goes */
    bool endless;        /* never over by itself (view) */
    bool fem;            /* compare with the full finite-element solve; needs `body` */
    uint32_t fem_every;  /* contact ticks between comparisons; 0: 8 to 16 of them spread over the run, and the peak */
    const char *device;  /* name of a device model; NULL: the bank's scene's, else the reference device */
    struct bus_faults faults; /* all probabilities 0: none */
    const char *torque_log;   /* file for the torque frames as candump log, NULL: none */
};

struct session_result {
    uint64_t ticks, missed; /* missed: ticks without a usable encoder sample, after the first good ones */
    uint64_t
        late_ticks; /* in real time: ticks that the machine began more than a tick late; no matter for the result */
    uint64_t contact_ticks;
    double peak_force_N;         /* of the force rendered: after damping, clamp, rate limit */
    double peak_contact_force_N; /* of the contact system's */
    double max_depth_m;          /* of a tool point below the rest surface */
    bool fem_known;
    double
        force_error_vs_fem; /* largest |f - f_fem| / peak |f_fem| over the compared ticks; fem_force.h says of what */
    char fem_reason[400];   /* why it is not known */
    uint32_t fem_compared;
    double peak_fem_force_N;
    char torque_log_sha256[65];
    uint64_t torque_frames;
    unsigned max_contacts;
    uint32_t max_factors;
    unsigned final_state; /* enum safety_state */
    int reason;           /* STATUS_LOOP_* when that is SAFE */
    bool stopped;         /* the host asked for SAFE, so it is no surprise */
    bool ran;             /* RUN was reached */
    struct safety safety; /* counters */
    uint32_t clamps, rate_limits, passivity_interventions, walks_cut, solver_cuts;
    uint32_t frames_malformed, queue_overflows;             /* controller */
    uint32_t device_rejected, device_late, device_silences; /* torque frames; motors dropped */
    uint64_t link_malformed, link_incomplete;               /* host */
    struct bus_statistics bus;
    double bus_load; /* share of the simulated time that the bus was busy */
    double seconds;  /* wall clock, without the finite-element comparison */
};

struct session;

/* `body` may be NULL: no comparison. `bank` and `body` must outlive the session. Refuses a gesture that cannot be read and
 * an instrument whose axis does not meet the body within its range. */
int session_create(const struct bank_file *bank, const struct body *body, const struct session_options *options,
                   struct session **session, struct failure *why);
/* One tick (1 ms). False when the run is over or interrupted; then nothing has moved. */
bool session_tick(struct session *session);
const struct link *session_link(const struct session *session);
struct hand *session_hand(struct session *session);
const struct node *session_node(const struct session *session);
const struct device *session_device(const struct session *session);
struct bus *session_bus(struct session *session); /* to inject faults, listen, or attach more nodes */
double session_time_s(const struct session *session);
double session_gesture_time_s(const struct session *session); /* 0 until the hand begins */
double session_progress(const struct session *session);       /* 0..1 */
/* Somebody drives the hand (`driven`): it goes to `target_m` (trocar's frame) at no more than SESSION_DRIVE_m_s, so a jump
 * of the mouse is none of the hand; let go, it goes back to its gesture in the same way. */
void session_drive(struct session *session, bool driven, const double target_m[3]);
/* From now on it is never over by itself; allowed after session_finish, which has closed the log. */
void session_continue(struct session *session);
/* Ask as the host: wire's NMT command, 1 start (acknowledge), 2 stop. */
void session_command(struct session *session, uint8_t nmt_command);
/* Tell the controller, as its port would, that its last tick ended late. */
void session_overrun(struct session *session);
/* Compare, close the log, fill the result. STATUS_INTERRUPTED when the comparison was interrupted. Once only. */
int session_finish(struct session *session, struct session_result *result, struct failure *why);
void session_free(struct session *session); /* NULL is nothing; without session_finish no torque log is left */

#endif
