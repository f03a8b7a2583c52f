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
    r->wants_start = r->answered = true;
    link_start(&r->link, options->node);
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

int remote_command(struct remote *r, uint8_t command, struct failure *why)
{
    const struct wire_nmt nmt = {.command = command, .node = r->options.node};
    struct can_frame_t frame = {.id = WIRE_NMT_ID, .length = WIRE_NMT_LENGTH};
    wire_nmt_pack(frame.data, &nmt);
    r->stopped = command == NMT_STOP;
    return send(r, &frame, why);
}

static int heartbeat(struct remote *r, struct failure *why)
{
    const struct wire_host_heartbeat beat = {.nmt_state = NMT_OPERATIONAL};
    struct can_frame_t frame = {.id = WIRE_HOST_HEARTBEAT_ID, .length = WIRE_HOST_HEARTBEAT_LENGTH};
    wire_host_heartbeat_pack(frame.data, &beat);
    return send(r, &frame, why);
}

/* A tick of the controller has begun. */
static int tick(struct remote *r, uint8_t counter, struct failure *why)
{
    const unsigned step = r->ticks ? (uint8_t)(counter - r->counter) : 1;
    const uint64_t before = r->ticks;
    int status = STATUS_OK;
    r->ticks += step;
    r->counter = counter;
    r->unanswered += !r->answered;
    r->answered = false;
    r->heard_us = (uint64_t)(1e6 * seconds_now());
    if (r->link.state == SAFETY_RUN) {
        r->wants_start = false; /* once is enough: after a doubt a person must decide */
        r->ran = true;
    }
    if (before / HOST_PERIOD_TICKS == r->ticks / HOST_PERIOD_TICKS)
        return STATUS_OK;
    status = heartbeat(r, why);
    if (!status && r->wants_start && r->link.state == SAFETY_READY)
        status = remote_command(r, NMT_START, why);
    return status;
}

static int hear(struct remote *r, const struct backend_received *received, struct failure *why)
{
    const struct can_frame_t *f = &received->frame;
    struct wire_sync sync;
    r->first_us = r->first_us ? r->first_us : received->time_us;
    r->last_us = received->time_us;
    link_receive(&r->link, f, received->time_us);
    const double *n = r->link.force_N;
    r->peak_force_N = fmax(r->peak_force_N, sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]));
    if (f->flags == 0 && f->id == (uint32_t)WIRE_TORQUES_ID + r->options.node) {
        torque_log_frame(&r->log, f, received->time_us);
        r->torques++;
        r->answered = true;
    }
    if (f->flags == 0 && f->id == WIRE_SYNC_ID && wire_sync_unpack(&sync, f->data, f->length))
        return tick(r, sync.counter, why);
    return STATUS_OK;
}

static bool over(const struct remote *r)
{
    const uint64_t end = r->options.ticks; /* with the torque of the last tick, or at the next SYNC when it is lost */
    return interrupted() || (end && (r->ticks > end || (r->ticks == end && r->answered)));
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
