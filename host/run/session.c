#include "session.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "clock.h"
#include "device_node.h"
#include "fem_force.h"
#include "progress.h"
#include "torque_log.h"
#include "wire.h"

enum { NMT_START = 1, NMT_STOP = 2, NMT_OPERATIONAL = 5, HOST_PERIOD_TICKS = 100 };

struct session {
    const struct bank_file *bank;
    const struct body *body;
    struct session_options options;
    struct gesture gesture;
    struct hand hand;
    struct device_model model; /* the catalogue's mechanics with the bank's calibration */
    struct device_node device;
    struct node node;
    void *rows; /* the controller's memory for rows of the bank */
    struct link link;
    struct bus *bus;
    int node_port, device_port, host_port;
    struct torque_log log;
    struct fem_record record;
    uint64_t tick, gesture_tick; /* the hand moves from gesture_tick on */
    bool gesturing;
    bool wants_start, overrun;
    bool driven; /* the hand goes to drive_m */
    double drive_m[3];
    uint8_t command; /* NMT to send with the next tick, 0: none */
    double started_s;
    struct clock clock;
    struct session_result result;
};

/* ---- frames ---- */

static void node_hears(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    (void)time_us;
    struct session *s = context;
    node_receive(&s->node, frame);
}

static void device_hears(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    (void)time_us;
    struct session *s = context;
    struct can_frame_t reply;
    if (device_node_receive(&s->device, frame, &reply))
        bus_send(s->bus, s->device_port, &reply);
}

static void host_hears(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct session *s = context;
    link_receive(&s->link, frame, time_us);
    if (frame->id == (uint32_t)WIRE_TORQUES_ID + SESSION_NODE)
        torque_log_frame(&s->log, frame, time_us);
}

static void send_queued(struct session *s)
{
    struct can_frame_t frame;
    while (node_transmit(&s->node, &frame))
        bus_send(s->bus, s->node_port, &frame);
}

static void send_nmt(struct session *s, uint8_t command)
{
    const struct wire_nmt nmt = {.command = command, .node = SESSION_NODE};
    struct can_frame_t frame = {.id = WIRE_NMT_ID, .length = WIRE_NMT_LENGTH};
    wire_nmt_pack(frame.data, &nmt);
    bus_send(s->bus, s->host_port, &frame);
}

static void send_heartbeat(struct session *s)
{
    const struct wire_host_heartbeat beat = {.nmt_state = NMT_OPERATIONAL};
    struct can_frame_t frame = {.id = WIRE_HOST_HEARTBEAT_ID, .length = WIRE_HOST_HEARTBEAT_LENGTH};
    wire_host_heartbeat_pack(frame.data, &beat);
    bus_send(s->bus, s->host_port, &frame);
}

/* What a host does, from what it has heard. */
static void host_tick(struct session *s)
{
    if (s->command) {
        send_nmt(s, s->command);
        s->wants_start = s->command == NMT_START;
        s->result.stopped = s->command == NMT_STOP;
        s->command = 0;
    }
    if (s->link.state == SAFETY_RUN)
        s->wants_start = false; /* once is enough: after a doubt a person must decide */
    if (s->tick % HOST_PERIOD_TICKS == 0) {
        send_heartbeat(s);
        if (s->wants_start && s->link.state == SAFETY_READY)
            send_nmt(s, NMT_START);
    }
    if (!s->gesturing && (s->link.state == SAFETY_RUN || s->tick >= SESSION_WAIT_TICKS)) {
        s->gesturing = true;
        s->gesture_tick = s->tick;
    }
}

/* ---- start ---- */

static int read_gesture(struct session *s, struct failure *why)
{
    const char *name = s->options.gesture ? s->options.gesture : "press";
    char message[300] = "";
    long line = 0;
    int status = gesture_read(name, &s->gesture, message, sizeof message, &line);
    return status ? failure_at(why, (enum status)status, name, line, NULL, "%s", message) : STATUS_OK;
}

static int attach(struct session *s, struct failure *why)
{
    s->bus = bus_create(SESSION_BIT_RATE);
    if (!s->bus)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the bus");
    s->node_port = bus_attach(s->bus, node_hears, s);
    s->device_port = bus_attach(s->bus, device_hears, s);
    s->host_port = bus_attach(s->bus, host_hears, s);
    if (s->node_port < 0 || s->device_port < 0 || s->host_port < 0)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the bus");
    const struct bus_faults *f = &s->options.faults;
    if (f->drop > 0 || f->duplicate > 0 || f->delay > 0 || f->corrupt > 0 || f->reorder > 0)
        bus_inject(s->bus, f);
    return STATUS_OK;
}

int session_create(const struct bank_file *bank, const struct body *body, const struct session_options *options,
                   struct session **session, struct failure *why)
{
    *session = NULL;
    struct session *s = calloc(1, sizeof *s);
    if (!s)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the session");
    s->bank = bank;
    s->body = body;
    s->options = *options;
    s->wants_start = true;
    int status = read_gesture(s, why);
    if (!status)
        status = bench_choose(s->options.device, bank, &s->model, why);
    if (!status)
        status = bench_hand(&bank->view, &s->hand, why);
    s->hand.gesture = &s->gesture;
    if (!status)
        status = attach(s, why);
    size_t rows = row_cache_memory(&bank->view);
    s->rows = rows ? malloc(rows) : NULL;
    if (!status && rows && !s->rows)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the controller's rows (%zu bytes)", rows);
    if (!status)
        status = torque_log_open(&s->log, options->torque_log, why);
    if (status) {
        session_free(s);
        return status;
    }
    fem_record_start(&s->record, options->fem_every);
    node_start(&s->node, &bank->view, 0, SESSION_NODE, s->rows, rows);
    send_queued(s);
    device_node_start(&s->device, &s->model, &s->hand, SESSION_NODE);
    bench_gravity(&bank->view.tools[0], s->device.device.gravity_direction);
    link_start(&s->link, SESSION_NODE);
    s->started_s = seconds_now();
    clock_begin(&s->clock);
    *session = s;
    return STATUS_OK;
}

/* ---- tick ---- */

static double length(const float v[3])
{
    return sqrt((double)v[0] * (double)v[0] + (double)v[1] * (double)v[1] + (double)v[2] * (double)v[2]);
}

static void account(struct session *s)
{
    const struct controller *c = &s->node.controller;
    struct session_result *r = &s->result;
    r->ran |= c->safety.state == SAFETY_RUN;
    r->peak_force_N = fmax(r->peak_force_N, length(c->coupling.force_N));
    r->peak_contact_force_N = fmax(r->peak_contact_force_N, length(c->contact.force_N));
    r->max_contacts = c->contact.count > r->max_contacts ? c->contact.count : r->max_contacts;
    r->max_factors = c->contact.factors > r->max_factors ? c->contact.factors : r->max_factors;
    for (uint32_t i = 0; i < c->contact.count; i++)
        r->max_depth_m = fmax(r->max_depth_m, (double)c->contact.contact[i].depth_m);
    fem_record_tick(&s->record, &c->contact,
                    s->bank->view.friction ? &c->friction.system
                    : s->bank->view.grasp  ? &c->grasp.system
                                           : NULL,
                    s->bank->view.viscoelastic ? &c->viscoelastic : NULL, s->tick);
}

/* One tick's way of the hand's own target towards where it is driven, or back to the gesture. */
static void drive_tick(struct session *s)
{
    struct hand *hand = &s->hand;
    double goal[3], distance = 0;
    if (!s->driven && !hand->overridden)
        return;
    hand->overridden = 0;
    hand_target(hand, session_gesture_time_s(s), goal);
    hand->overridden = 1;
    if (s->driven)
        memcpy(goal, s->drive_m, sizeof goal);
    for (int i = 0; i < 3; i++)
        distance += (goal[i] - hand->override_m[i]) * (goal[i] - hand->override_m[i]);
    distance = sqrt(distance);
    double step = SESSION_DRIVE_m_s * 1e-6 * SESSION_TICK_US, part = distance > step ? step / distance : 1;
    for (int i = 0; i < 3; i++)
        hand->override_m[i] += part * (goal[i] - hand->override_m[i]);
    if (part == 1 && !s->driven)
        hand->overridden = 0;
}

double session_gesture_time_s(const struct session *s)
{
    return s->gesturing ? 1e-3 * (double)(s->tick - s->gesture_tick) : 0;
}

static bool over(const struct session *s)
{
    if (interrupted())
        return true;
    if (s->options.endless)
        return false;
    if (s->options.ticks)
        return s->tick >= s->options.ticks;
    double end_s = gesture_duration_s(&s->gesture) + 1e-3 * SESSION_SETTLE_TICKS;
    return s->gesturing && session_gesture_time_s(s) >= end_s;
}

bool session_tick(struct session *s)
{
    if (over(s))
        return false;
    if (s->options.realtime)
        clock_wait(&s->clock, SESSION_TICK_US);
    uint64_t start_us = s->tick * SESSION_TICK_US;
    host_tick(s);
    drive_tick(s);
    node_begin_tick(&s->node);
    s->node.input.overrun = s->overrun;
    s->overrun = false;
    send_queued(s);
    for (uint32_t t = 0; t < SESSION_TICK_US; t += DEVICE_SUBSTEP_US) {
        if (t == SESSION_COMPUTE_US) {
            node_finish_tick(&s->node);
            send_queued(s);
        }
        bus_run(s->bus, start_us + t + DEVICE_SUBSTEP_US);
        device_step(&s->device.device, &s->hand, session_gesture_time_s(s) + 1e-6 * t, DEVICE_SUBSTEP_US);
    }
    account(s);
    s->tick++;
    return true;
}

/* ---- the outside ---- */

const struct link *session_link(const struct session *s)
{
    return &s->link;
}

struct hand *session_hand(struct session *s)
{
    return &s->hand;
}

const struct node *session_node(const struct session *s)
{
    return &s->node;
}

const struct device *session_device(const struct session *s)
{
    return &s->device.device;
}

struct bus *session_bus(struct session *s)
{
    return s->bus;
}

double session_time_s(const struct session *s)
{
    return 1e-6 * SESSION_TICK_US * (double)s->tick;
}

double session_progress(const struct session *s)
{
    if (s->options.ticks)
        return (double)s->tick / (double)s->options.ticks;
    double end_s = gesture_duration_s(&s->gesture) + 1e-3 * SESSION_SETTLE_TICKS;
    return fmin(session_gesture_time_s(s) / end_s, 1);
}

void session_drive(struct session *s, bool driven, const double target_m[3])
{
    if (driven && !s->driven && !s->hand.overridden)
        hand_target(&s->hand, session_gesture_time_s(s), s->hand.override_m); /* from where it is */
    s->driven = driven;
    if (driven) {
        memcpy(s->drive_m, target_m, sizeof s->drive_m);
        s->hand.overridden = 1;
    }
}

void session_continue(struct session *s)
{
    s->options.endless = true;
}

void session_command(struct session *s, uint8_t nmt_command)
{
    s->command = nmt_command;
}

void session_overrun(struct session *s)
{
    s->overrun = true;
}

/* ---- end ---- */

static int compare(struct session *s, struct failure *why)
{
    struct session_result *r = &s->result;
    if (!s->options.fem || !s->body) {
        snprintf(r->fem_reason, sizeof r->fem_reason, "%s",
                 s->options.fem ? "the body's mesh is not at hand" : "it was not asked for");
        return STATUS_OK;
    }
    if (s->record.contact_ticks == 0) {
        snprintf(r->fem_reason, sizeof r->fem_reason, "the instrument never touched the body");
        return STATUS_OK;
    }
    struct fem_comparison comparison;
    struct failure reason = {0};
    int status = fem_compare(&s->bank->view, s->body, &s->record, &comparison, &reason);
    if (status == STATUS_INTERRUPTED || status == STATUS_MEMORY) {
        *why = reason;
        return status;
    }
    if (status) {
        snprintf(r->fem_reason, sizeof r->fem_reason, "%s", reason.cause);
        return STATUS_OK;
    }
    r->fem_known = true;
    r->force_error_vs_fem = comparison.error;
    r->fem_compared = comparison.compared;
    r->peak_fem_force_N = comparison.peak_force_N;
    return STATUS_OK;
}

int session_finish(struct session *s, struct session_result *result, struct failure *why)
{
    struct session_result *r = &s->result;
    const struct controller *c = &s->node.controller;
    r->seconds = seconds_now() - s->started_s;
    r->ticks = s->tick;
    r->missed = c->safety.missed;
    r->safety = c->safety;
    r->final_state = c->safety.state;
    r->reason = c->safety.reason;
    r->contact_ticks = s->record.contact_ticks;
    r->clamps = c->coupling.clamps;
    r->rate_limits = c->coupling.rate_limits;
    r->passivity_interventions = c->coupling.passivity_interventions;
    r->walks_cut = c->collide.walks_cut;
    r->solver_cuts = c->contact.cut;
    r->frames_malformed = s->node.frames_malformed;
    r->queue_overflows = s->node.queue_overflows;
    r->device_rejected = s->device.device.commands_rejected;
    r->device_late = s->device.late;
    r->device_silences = s->device.device.silences;
    r->link_malformed = s->link.malformed;
    r->link_incomplete = s->link.incomplete_sets;
    r->bus = *bus_statistics(s->bus);
    r->bus_load = s->tick ? (double)r->bus.busy_us / (double)(s->tick * SESSION_TICK_US) : 0;
    r->torque_frames = s->log.frames;
    r->late_ticks = s->clock.late;
    int status = torque_log_close(&s->log, r->torque_log_sha256, why);
    if (!status)
        status = compare(s, why);
    *result = *r;
    return status;
}

void session_free(struct session *s)
{
    if (!s)
        return;
    torque_log_discard(&s->log);
    fem_record_free(&s->record);
    bus_free(s->bus);
    free(s->rows);
    free(s);
}
