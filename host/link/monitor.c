#include "monitor.h"

#include <string.h>

#include "framebits.h"
#include "wire.h"

static const uint32_t extended_bit = 0x80000000;

void monitor_start(struct monitor *monitor, const struct dbc *dbc, double bit_rate, struct mirror *mirror)
{
    memset(monitor, 0, sizeof *monitor);
    monitor->dbc = dbc;
    monitor->bit_rate = bit_rate;
    monitor->mirror = mirror;
}

void monitor_idle(struct monitor *monitor, uint64_t time_us)
{
    if (monitor->first_us == 0 && monitor->frames == 0)
        monitor->first_us = monitor->window_us = time_us;
    if (time_us > monitor->now_us)
        monitor->now_us = time_us;
}

static struct monitor_id *find(struct monitor *monitor, uint32_t id)
{
    size_t at = 0;
    while (at < monitor->id_count && monitor->id[at].id < id)
        at++;
    if (at < monitor->id_count && monitor->id[at].id == id)
        return &monitor->id[at];
    if (monitor->id_count == MONITOR_IDS)
        return NULL;
    memmove(&monitor->id[at + 1], &monitor->id[at], (monitor->id_count - at) * sizeof monitor->id[0]);
    monitor->id_count++;
    monitor->id[at] = (struct monitor_id){.id = id};
    return &monitor->id[at];
}

/* A controller is who sends torques, its heartbeat or its boot-up. */
static void meet(struct monitor *monitor, const struct can_frame_t *frame)
{
    const uint32_t node = frame->id & 0x7F, base = frame->id - node;
    if (frame->flags || node < 1 || node > 126 || (base != WIRE_TORQUES_ID && base != WIRE_HEARTBEAT_ID) ||
        monitor->node_count == MONITOR_NODES)
        return;
    for (size_t i = 0; i < monitor->node_count; i++)
        if (monitor->link[i].node_id == node)
            return;
    link_start(&monitor->link[monitor->node_count++], (uint8_t)node);
}

void monitor_receive(struct monitor *monitor, const struct can_frame_t *frame, uint64_t time_us)
{
    monitor_idle(monitor, time_us);
    monitor->frames++;
    if (frame->flags & CAN_FLAG_ERROR) {
        monitor->errors++;
        return;
    }
    monitor->bits += framebits(frame);
    struct monitor_id *id = find(monitor, frame->id | (frame->flags & CAN_FLAG_EXTENDED ? extended_bit : 0));
    if (id) {
        id->count++;
        id->last = *frame;
        id->last_us = time_us;
    } else {
        monitor->overflow++;
    }
    meet(monitor, frame);
    for (size_t i = 0; i < monitor->node_count; i++)
        link_receive(&monitor->link[i], frame, time_us);
    if (monitor->mirror)
        mirror_receive(monitor->mirror, frame, time_us);
}

bool monitor_window(struct monitor *monitor)
{
    const double seconds = 1e-6 * (double)(monitor->now_us - monitor->window_us);
    if (seconds < 1e-3)
        return false;
    for (size_t i = 0; i < monitor->id_count; i++) {
        struct monitor_id *id = &monitor->id[i];
        id->per_second = (double)(id->count - id->reported) / seconds;
        id->reported = id->count;
    }
    monitor->load = (double)(monitor->bits - monitor->reported_bits) / (seconds * monitor->bit_rate);
    monitor->per_second = (double)(monitor->frames - monitor->reported_frames) / seconds;
    monitor->reported_bits = monitor->bits;
    monitor->reported_frames = monitor->frames;
    if (monitor->mirror) {
        monitor->differed = monitor->mirror->differed - monitor->mirror_differed;
        monitor->mirror_differed = monitor->mirror->differed;
    }
    monitor->window_us = monitor->now_us;
    return true;
}
