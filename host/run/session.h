/* One run: simulated device and hand, controller, host link on a soft bus, in lockstep. Device, controller and host share
 * nothing but frames; the session reads the controller's state only to log and to compare. */
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

struct session_options {
    const char *gesture; /* name or file; NULL: press */
    uint64_t ticks;      /* 0: the gesture's length */
    bool realtime;       /* pace to the wall clock (view); else as fast as it goes */
    bool fem;            /* compare with the full finite-element solve when the mesh can be found */
    uint32_t fem_every;  /* contact ticks between comparisons; 0: 8 of them spread over the run, and the peak */
    struct bus_faults faults;
    const char *torque_log; /* file for the torque frames as candump log, NULL: none */
};

struct session_result {
    uint64_t ticks, missed;
    double peak_force_N;
    bool fem_known;
    double force_error_vs_fem; /* largest |f - f_fem| / peak |f_fem| over the compared ticks */
    char fem_reason[200];      /* why it is not known */
    uint32_t fem_compared;
    char torque_log_sha256[65];
    unsigned max_contacts;
    uint32_t max_factors;
    unsigned final_state;
    int reason;
    struct bus_statistics bus;
    double seconds;
};

struct session;

int session_create(const struct bank_file *bank, const struct body *body /* or NULL */,
                   const struct session_options *options, struct session **session, struct failure *why);
/* One tick (1 ms). False when the run is over. */
bool session_tick(struct session *session);
const struct link *session_link(const struct session *session);
struct hand *session_hand(struct session *session);
const struct node *session_node(const struct session *session);
const struct device *session_device(const struct session *session);
double session_time_s(const struct session *session);
/* Ask as the host: acknowledge (NMT start) or stop. */
void session_command(struct session *session, uint8_t nmt_command);
int session_finish(struct session *session, struct session_result *result, struct failure *why);
void session_free(struct session *session);

#endif
