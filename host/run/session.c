#include "session.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "clock.h"
#include "fem_force.h"
#include "progress.h"
#include "torque_log.h"
#include "wire.h"

enum { NMT_START = 1, NMT_STOP = 2, NMT_OPERATIONAL = 5, HOST_PERIOD_TICKS = 100 };

/* One instrument with its hand, and what the host knows of it. */
struct station {
    struct session *session;
    struct bench_instrument bench;
    struct link link;
    int port; /* of the device */
    bool wants_start;
};

struct session {
    const struct bank_file *bank;
    const struct body *body;
    struct session_options options;
    uint32_t count;
    struct station station[SESSION_INSTRUMENTS];
    struct node node;
    void *rows; /* the controller's memory for rows of the bank */
    struct bus *bus;
    int node_port, host_port;
    struct torque_log log;
    struct fem_record record;
    uint64_t tick, gesture_tick; /* the hands move from gesture_tick on */
    bool gesturing, overrun;
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
    struct station *at = context;
    struct can_frame_t reply;
    if (device_node_receive(&at->bench.node, frame, &reply))
        bus_send(at->session->bus, at->port, &reply);
}

static void host_hears(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct session *s = context;
    for (uint32_t t = 0; t < s->count; t++) {
        link_receive(&s->station[t].link, frame, time_us);
        if (frame->id == (uint32_t)WIRE_TORQUES_ID + SESSION_NODE + t)
            torque_log_frame(&s->log, frame, time_us);
    }
}

static void send_queued(struct session *s)
{
    struct can_frame_t frame;
    while (node_transmit(&s->node, &frame))
        bus_send(s->bus, s->node_port, &frame);
}

static void send_nmt(struct session *s, uint32_t t, uint8_t command)
{
    const struct wire_nmt nmt = {.command = command, .node = (uint8_t)(SESSION_NODE + t)};
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
    bool all_run = true;
    for (uint32_t t = 0; t < s->count; t++) {
        struct station *at = &s->station[t];
        if (s->command) {
            send_nmt(s, t, s->command);
            at->wants_start = s->command == NMT_START;
            s->result.stopped = s->command == NMT_STOP;
        }
        if (at->link.state == SAFETY_RUN)
            at->wants_start = false; /* once is enough: after a doubt a person must decide */
        all_run = all_run && at->link.state == SAFETY_RUN;
    }
    s->command = 0;
    if (s->tick % HOST_PERIOD_TICKS == 0) {
        send_heartbeat(s);
        for (uint32_t t = 0; t < s->count; t++)
            if (s->station[t].wants_start && s->station[t].link.state == SAFETY_READY)
                send_nmt(s, t, NMT_START);
    }
    if (!s->gesturing && (all_run || s->tick >= SESSION_WAIT_TICKS)) {
        s->gesturing = true;
        s->gesture_tick = s->tick;
    }
}

/* ---- start ---- */

static int attach(struct session *s, struct failure *why)
{
    s->bus = bus_create(SESSION_BIT_RATE);
    if (!s->bus)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the bus");
    s->node_port = bus_attach(s->bus, node_hears, s);
    bool attached = s->node_port >= 0;
    for (uint32_t t = 0; t < s->count; t++) {
        s->station[t].port = bus_attach(s->bus, device_hears, &s->station[t]);
        attached = attached && s->station[t].port >= 0;
    }
    s->host_port = bus_attach(s->bus, host_hears, s);
    if (!attached || s->host_port < 0)
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
    s->count = bank->view.tool_count;
    int status = STATUS_OK;
    for (uint32_t t = 0; t < s->count && !status; t++) {
        s->station[t].session = s;
        s->station[t].wants_start = true;
        link_start(&s->station[t].link, (uint8_t)(SESSION_NODE + t));
        status = bench_start(&s->station[t].bench, bank, t, options->gesture[t], options->device[t],
                             (uint8_t)(SESSION_NODE + t), why);
        if (options->repeat)
            s->station[t].bench.gesture.repeat = HAND_MAX_REPEAT;
    }
    for (uint32_t t = s->count; t < SESSION_INSTRUMENTS && !status; t++)
        if (options->gesture[t] || options->device[t])
            status = failure_set(why, STATUS_USAGE, NULL, "leave it out",
                                 "a gesture or device is given for instrument %u, and there are %u", t + 1, s->count);
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
    node_start(&s->node, &bank->view, SESSION_NODE, s->rows, rows);
    send_queued(s);
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
    for (uint32_t t = 0; t < s->count; t++) {
        struct session_instrument *i = &r->instrument[t];
        i->ran |= c->instrument[t].safety.state == SAFETY_RUN;
        i->peak_force_N = fmax(i->peak_force_N, length(c->instrument[t].coupling.force_N));
        i->peak_contact_force_N = fmax(i->peak_contact_force_N, length(c->contact.force_N[t]));
        unsigned contacts = 0;
        for (uint32_t k = 0; k < c->contact.count; k++) {
            if (c->contact.contact[k].tool != t)
                continue;
            contacts++;
            i->max_depth_m = fmax(i->max_depth_m, (double)c->contact.contact[k].depth_m);
        }
        i->contact_ticks += contacts > 0;
        i->max_contacts = contacts > i->max_contacts ? contacts : i->max_contacts;
    }
    r->max_contacts = c->contact.count > r->max_contacts ? c->contact.count : r->max_contacts;
    r->max_factors = c->contact.factors > r->max_factors ? c->contact.factors : r->max_factors;
    struct contact_set linear; /* what linear finite elements say is the force before it was corrected */
    const struct contact_set *contacts = &c->contact;
    const struct bank_view *bank = &s->bank->view;
    if (bank->neo_hookean || bank->quasi_nonlinear) {
        linear = c->contact;
        memcpy(linear.force_N, bank->neo_hookean ? c->neo_hookean.linear_N : c->quasi_nonlinear.linear_N,
               sizeof linear.force_N);
        contacts = &linear;
        for (uint32_t t = 0; t < s->count && c->contact.count > 0; t++) {
            float by[3];
            for (int a = 0; a < 3; a++)
                by[a] = c->contact.force_N[t][a] - linear.force_N[t][a];
            r->correction_N = fmax(r->correction_N, length(by));
        }
        r->beyond_range = bank->neo_hookean ? c->neo_hookean.beyond : c->quasi_nonlinear.beyond;
    }
    fem_record_tick(&s->record, contacts, s->bank->view.friction || s->bank->view.grasp ? &c->cone.system : NULL,
                    s->bank->view.viscoelastic ? &c->viscoelastic : NULL, s->tick);
}

double session_gesture_time_s(const struct session *s)
{
    return s->gesturing ? 1e-3 * (double)(s->tick - s->gesture_tick) : 0;
}

/* Of the longest gesture. */
static double end_s(const struct session *s)
{
    double longest_s = 0;
    for (uint32_t t = 0; t < s->count; t++)
        longest_s = fmax(longest_s, gesture_duration_s(&s->station[t].bench.gesture));
    return longest_s + 1e-3 * SESSION_SETTLE_TICKS;
}

static bool over(const struct session *s)
{
    if (interrupted())
        return true;
    if (s->options.endless)
        return false;
    if (s->options.ticks)
        return s->tick >= s->options.ticks;
    return s->gesturing && session_gesture_time_s(s) >= end_s(s);
}

bool session_tick(struct session *s)
{
    if (over(s))
        return false;
    if (s->options.realtime)
        clock_wait(&s->clock, SESSION_TICK_US);
    uint64_t start_us = s->tick * SESSION_TICK_US;
    host_tick(s);
    for (uint32_t t = 0; t < s->count; t++)
        bench_drive_tick(&s->station[t].bench, session_gesture_time_s(s));
    node_begin_tick(&s->node);
    if (s->overrun)
        node_overrun(&s->node);
    s->overrun = false;
    send_queued(s);
    for (uint32_t t = 0; t < SESSION_TICK_US; t += DEVICE_SUBSTEP_US) {
        if (t == (s->count > 1 ? SESSION_COMPUTE_TWO_US : SESSION_COMPUTE_US)) {
            node_finish_tick(&s->node);
            send_queued(s);
        }
        bus_run(s->bus, start_us + t + DEVICE_SUBSTEP_US);
        for (uint32_t i = 0; i < s->count; i++) {
            struct bench_instrument *bench = &s->station[i].bench;
            device_step(&bench->node.device, &bench->hand, session_gesture_time_s(s) + 1e-6 * t, DEVICE_SUBSTEP_US);
        }
    }
    account(s);
    s->tick++;
    return true;
}

/* ---- the outside ---- */

uint32_t session_instruments(const struct session *s)
{
    return s->count;
}

const struct link *session_link(const struct session *s, uint32_t t)
{
    return &s->station[t].link;
}

struct hand *session_hand(struct session *s, uint32_t t)
{
    return &s->station[t].bench.hand;
}

const struct node *session_node(const struct session *s)
{
    return &s->node;
}

const struct device *session_device(const struct session *s, uint32_t t)
{
    return &s->station[t].bench.node.device;
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
    return fmin(session_gesture_time_s(s) / end_s(s), 1);
}

void session_drive(struct session *s, uint32_t t, bool driven, const double target_m[3])
{
    bench_drive(&s->station[t].bench, driven, target_m, session_gesture_time_s(s));
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
    r->fem_reference = s->bank->view.neo_hookean || s->bank->view.quasi_nonlinear
                           ? "linear finite elements, the force before it is corrected"
                           : "linear finite elements";
    r->force_error_vs_fem = comparison.error;
    r->fem_compared = comparison.compared;
    for (uint32_t t = 0; t < s->count; t++) {
        r->instrument[t].force_error_vs_fem = comparison.instrument[t].error;
        r->instrument[t].peak_fem_force_N = comparison.instrument[t].peak_force_N;
        r->instrument[t].from_other_N = comparison.instrument[t].from_other_N;
    }
    r->peak_fem_force_N = comparison.peak_force_N;
    return STATUS_OK;
}

/* Names of the scene that the bank was built from. */
static void name_instruments(struct session *s)
{
    struct scene *scene = bank_scene(s->bank);
    for (size_t t = 0; scene && t < s->count && t < scene->instrument_count; t++)
        memcpy(s->result.instrument[t].name, scene->instrument[t].name, sizeof s->result.instrument[t].name);
    free(scene);
}

static void finish_instrument(struct session *s, uint32_t t)
{
    const struct controller *c = &s->node.controller;
    const struct station *at = &s->station[t];
    struct session_instrument *i = &s->result.instrument[t];
    i->safety = c->instrument[t].safety;
    i->clamps = c->instrument[t].coupling.clamps;
    i->rate_limits = c->instrument[t].coupling.rate_limits;
    i->passivity_interventions = c->instrument[t].coupling.passivity_interventions;
    i->device_rejected = at->bench.node.device.commands_rejected;
    i->device_late = at->bench.node.late;
    i->device_silences = at->bench.node.device.silences;
    i->link_malformed = at->link.malformed;
    i->link_incomplete = at->link.incomplete_sets;
}

int session_finish(struct session *s, struct session_result *result, struct failure *why)
{
    struct session_result *r = &s->result;
    const struct controller *c = &s->node.controller;
    r->seconds = seconds_now() - s->started_s;
    name_instruments(s);
    r->ticks = s->tick;
    r->contact_ticks = s->record.contact_ticks;
    r->walks_cut = c->collide.walks_cut;
    r->solver_cuts = c->contact.cut;
    r->frames_malformed = s->node.frames_malformed;
    r->queue_overflows = s->node.queue_overflows;
    for (uint32_t t = 0; t < s->count; t++)
        finish_instrument(s, t);
    r->instruments = s->count;
    session_result_sum(r);
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
