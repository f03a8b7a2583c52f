#include "remote.h"

#include <math.h>
#include <string.h>

#include "progress.h"
#include "safety.h"
#include "wire.h"

enum { NMT_START = 1, NMT_STOP = 2, NMT_OPERATIONAL = 5, HOST_PERIOD_TICKS = 100, SEND_US = 10000 };

int remote_open(struct remote *r, const struct remote_options *options, struct failure *why)
{
    memset(r, 0, sizeof *r);
    r->options = *options;
    r->instruments = 1;
    for (uint32_t t = 0; t < BANK_MAX_INSTRUMENTS; t++) {
        r->instrument[t].wants_start = r->instrument[t].answered = true;
        link_start(&r->instrument[t].link, (uint8_t)(options->node + t));
    }
    int status = backend_open(options->bus, NULL, &r->backend, why);
    if (!status)
        status = torque_log_open(&r->log, options->torque_log, why);
    if (!status)
        r->log.interface = backend_interface(r->backend);
    r->heard_us = (uint64_t)(1e6 * seconds_now());
    return status;
}

static int send(struct remote *r, const struct can_frame_t *frame, struct failure *why)
{
    const int status = backend_send(r->backend, frame, SEND_US, why);
    return status < 0 ? status : STATUS_OK;
}

static int send_nmt(struct remote *r, uint32_t t, uint8_t command, struct failure *why)
{
    const struct wire_nmt nmt = {.command = command, .node = (uint8_t)(r->options.node + t)};
    struct can_frame_t frame = {.id = WIRE_NMT_ID, .length = WIRE_NMT_LENGTH};
    wire_nmt_pack(frame.data, &nmt);
    return send(r, &frame, why);
}

int remote_command(struct remote *r, uint8_t command, struct failure *why)
{
    int status = STATUS_OK;
    r->stopped = command == NMT_STOP;
    for (uint32_t t = 0; t < r->instruments && !status; t++)
        status = send_nmt(r, t, command, why);
    return status;
}

static int heartbeat(struct remote *r, struct failure *why)
{
    const struct wire_host_heartbeat beat = {.nmt_state = NMT_OPERATIONAL};
    struct can_frame_t frame = {.id = WIRE_HOST_HEARTBEAT_ID, .length = WIRE_HOST_HEARTBEAT_LENGTH};
    wire_host_heartbeat_pack(frame.data, &beat);
    return send(r, &frame, why);
}

static bool all_answered(const struct remote *r)
{
    bool all = true;
    for (uint32_t t = 0; t < r->instruments; t++)
        all = all && r->instrument[t].answered;
    return all;
}

/* A tick of the controller has begun. */
static int begin_tick(struct remote *r, uint8_t counter, struct failure *why)
{
    const unsigned step = r->ticks ? (uint8_t)(counter - r->counter) : 1;
    const uint64_t before = r->ticks;
    r->ticks += step;
    r->counter = counter;
    r->unanswered += !all_answered(r);
    r->heard_us = (uint64_t)(1e6 * seconds_now());
    for (uint32_t t = 0; t < r->instruments; t++) {
        struct remote_instrument *i = &r->instrument[t];
        i->answered = false;
        if (i->link.state == SAFETY_RUN) {
            i->wants_start = false; /* once is enough: after a doubt a person must decide */
            i->ran = true;
        }
    }
    if (before / HOST_PERIOD_TICKS == r->ticks / HOST_PERIOD_TICKS)
        return STATUS_OK;
    int status = heartbeat(r, why);
    for (uint32_t t = 0; t < r->instruments && !status; t++)
        if (r->instrument[t].wants_start && r->instrument[t].link.state == SAFETY_READY)
            status = send_nmt(r, t, NMT_START, why);
    return status;
}

/* A frame of the controller's for instrument `t`, which may be its first. */
static void hear_instrument(struct remote *r, uint32_t t, const struct backend_received *received)
{
    const struct can_frame_t *f = &received->frame;
    struct remote_instrument *i = &r->instrument[t];
    const uint32_t torque_id = WIRE_TORQUES_ID + r->options.node + t;
    link_receive(&i->link, f, received->time_us);
    const double *n = i->link.force_N;
    i->peak_force_N = fmax(i->peak_force_N, sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]));
    if (f->flags != 0 || f->id != torque_id)
        return;
    r->instruments = t >= r->instruments ? t + 1 : r->instruments;
    torque_log_frame(&r->log, f, received->time_us);
    i->torques++;
    i->answered = true;
}

static int hear(struct remote *r, const struct backend_received *received, struct failure *why)
{
    const struct can_frame_t *f = &received->frame;
    struct wire_sync sync;
    r->first_us = r->first_us ? r->first_us : received->time_us;
    r->last_us = received->time_us;
    for (uint32_t t = 0; t < BANK_MAX_INSTRUMENTS; t++)
        hear_instrument(r, t, received);
    if (r->options.mirror) {
        const enum mirror_verdict verdict = mirror_receive(r->options.mirror, f, received->time_us);
        r->mirrored = verdict == MIRROR_AGREES || (r->mirrored && verdict != MIRROR_DIFFERS);
    }
    if (f->flags == 0 && f->id == WIRE_SYNC_ID && wire_sync_unpack(&sync, f->data, f->length))
        return begin_tick(r, sync.counter, why);
    return STATUS_OK;
}

static bool over(const struct remote *r)
{
    const uint64_t end = r->options.ticks; /* with the torques of the last tick, or at the next SYNC when one is lost */
    return interrupted() || (end && (r->ticks > end || (r->ticks == end && all_answered(r))));
}

int remote_step(struct remote *r, int64_t wait_us, void (*say)(const struct failure *why), struct failure *why)
{
    int status;
    do {
        struct backend_received received;
        status = backend_receive(r->backend, &received, wait_us, why);
        const bool heard = status == 1;
        if (heard)
            status = hear(r, &received, why);
        if (status == STATUS_BUS_DOWN || status == STATUS_BUS_LOST)
            say(why);
        else if (status < 0)
            return status;
        if (!heard)
            break;
        wait_us = 0;
    } while (!over(r));
    if (over(r))
        return 0;
    const int limit_us = r->ticks ? REMOTE_SILENCE_US : REMOTE_FIRST_US;
    if (!r->options.patient && 1e6 * seconds_now() - (double)r->heard_us > limit_us)
        return failure_set(why, STATUS_BUS_LOST, backend_name(r->backend), "start it, or look at its power and cable",
                           "no controller sends SYNC: nothing for %d s", limit_us / 1000000);
    return 1;
}

int remote_finish(struct remote *r, char torque_log_sha256[65], struct failure *why)
{
    r->log.interface = NULL;
    backend_close(r->backend);
    r->backend = NULL;
    return torque_log_close(&r->log, torque_log_sha256, why);
}

void remote_free(struct remote *r)
{
    torque_log_discard(&r->log);
    backend_close(r->backend);
    r->backend = NULL;
}
