#include "device_process.h"

#include <string.h>

#include "progress.h"
#include "wire.h"

int device_process_start(struct device_process *p, const struct bank_file *bank, const char *bus,
                         const struct device_process_options *options, struct failure *why)
{
    memset(p, 0, sizeof *p);
    p->options = *options;
    int status =
        bench_start(&p->bench, bank, options->instrument, options->gesture, options->device, options->node, why);
    if (status)
        return status;
    if (options->repeat)
        p->bench.gesture.repeat = HAND_MAX_REPEAT;
    const struct backend_filter filter[] = {{WIRE_SYNC_ID, 0x7FF}, {WIRE_TORQUES_ID + (uint32_t)options->node, 0x7FF}};
    const struct backend_options heard = {.filter = filter, .filters = 2};
    return backend_open(bus, &heard, &p->backend, why);
}

static double gesture_time_s(const struct device_process *p)
{
    return p->moving ? 1e-3 * (double)(p->ticks - p->gesture_tick) : 0;
}

/* Move the mechanics to so long after the last sample. */
static void advance(struct device_process *p, uint32_t to_us)
{
    if (to_us <= p->since_sample_us)
        return;
    device_step(&p->bench.node.device, &p->bench.hand, gesture_time_s(p) + 1e-6 * p->since_sample_us,
                to_us - p->since_sample_us);
    p->since_sample_us = to_us;
}

static void begin_tick(struct device_process *p, uint8_t counter)
{
    const unsigned step = p->ticks ? (uint8_t)(counter - p->counter) : 1;
    for (unsigned i = 0; i < step; i++) { /* at most 255 */
        advance(p, p->ticks ? 1000 : 0);
        p->since_sample_us = 0;
        p->ticks++;
    }
    p->skipped += step > 1 ? step - 1 : 0;
    p->counter = counter;
    if (!p->moving && (p->bench.node.device.enabled || p->ticks >= DEVICE_PROCESS_WAIT_TICKS)) {
        p->moving = true;
        p->gesture_tick = p->ticks;
    }
}

static bool over(const struct device_process *p)
{
    if (p->options.ticks)
        return p->ticks >= p->options.ticks;
    return p->moving && gesture_time_s(p) >= gesture_duration_s(&p->bench.gesture) + 1e-3 * DEVICE_PROCESS_SETTLE_TICKS;
}

static int hear(struct device_process *p, const struct can_frame_t *frame, struct failure *why)
{
    struct can_frame_t reply;
    struct wire_sync sync;
    if (frame->flags == 0 && frame->id == WIRE_SYNC_ID && wire_sync_unpack(&sync, frame->data, frame->length))
        begin_tick(p, sync.counter);
    else
        advance(p, DEVICE_PROCESS_TORQUE_US);
    if (!device_node_receive(&p->bench.node, frame, &reply))
        return STATUS_OK;
    const int status = backend_send(p->backend, &reply, 0, why);
    p->unsent += status == 0;
    return status < 0 ? status : STATUS_OK;
}

int device_process_run(struct device_process *p, void (*say)(const struct failure *why), struct failure *why)
{
    while (!over(p) && !interrupted()) {
        struct backend_received received;
        int status = backend_receive(p->backend, &received, DEVICE_PROCESS_SILENCE_US, why);
        if (status == 1)
            status = hear(p, &received.frame, why);
        else if (status == 0 && p->ticks && !interrupted())
            device_step(&p->bench.node.device, &p->bench.hand, gesture_time_s(p), DEVICE_SILENCE_US);
        if (status == STATUS_BUS_DOWN || status == STATUS_BUS_LOST)
            say(why);
        else if (status < 0)
            return status;
    }
    return STATUS_OK;
}

void device_process_end(struct device_process *p)
{
    backend_close(p->backend);
    p->backend = NULL;
}
