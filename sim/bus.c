#include "bus.h"

#include <stdlib.h>
#include <string.h>

#include "faults.h"
#include "framebits.h"

/* A frame that waits: for arbitration (key: what the bits of its identifier say) or for a fault to let it go (key:
 * time). */
struct waiting {
    uint64_t key, order; /* lower key first, then lower order */
    int node;
    bool again;  /* the second copy of a duplicate: suffers no more */
    bool behind; /* reordered: goes with the next delivery */
    struct can_frame_t frame;
};

/* Binary heap of at most BUS_QUEUE frames, smallest at 0. */
struct heap {
    size_t count;
    struct waiting *item;
};

struct node {
    bus_receiver *receiver;
    void *context;
    struct heap queue;
};

struct bus {
    uint32_t bit_rate;
    uint64_t now_ns, order, busy_ns;
    int node_count;
    struct node node[BUS_MAX_NODES];
    bool carrying, running, faulty;
    struct waiting carried; /* on the bus until carried_end_ns */
    uint64_t carried_end_ns;
    struct heap held;
    size_t behind; /* of the held ones */
    struct faults faults;
    struct bus_statistics statistics;
    bus_receiver *listener;
    void *listener_context;
};

static bool before(const struct waiting *a, const struct waiting *b)
{
    return a->key != b->key ? a->key < b->key : a->order < b->order;
}

static bool heap_create(struct heap *heap)
{
    heap->count = 0;
    heap->item = malloc(BUS_QUEUE * sizeof *heap->item);
    return heap->item != NULL;
}

static bool heap_push(struct heap *heap, const struct waiting *item)
{
    if (heap->count == BUS_QUEUE)
        return false;
    size_t at = heap->count++;
    while (at > 0 && before(item, &heap->item[(at - 1) / 2])) {
        heap->item[at] = heap->item[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    heap->item[at] = *item;
    return true;
}

static struct waiting heap_pop(struct heap *heap)
{
    const struct waiting top = heap->item[0];
    const struct waiting last = heap->item[--heap->count];
    size_t at = 0;
    for (size_t child = 1; child < heap->count; child = 2 * at + 1) {
        if (child + 1 < heap->count && before(&heap->item[child + 1], &heap->item[child]))
            child++;
        if (!before(&heap->item[child], &last))
            break;
        heap->item[at] = heap->item[child];
        at = child;
    }
    if (heap->count > 0)
        heap->item[at] = last;
    return top;
}

struct bus *bus_create(uint32_t bit_rate)
{
    if (bit_rate < 10000 || bit_rate > 1000000)
        return NULL;
    struct bus *bus = calloc(1, sizeof *bus);
    if (!bus)
        return NULL;
    bus->bit_rate = bit_rate;
    if (!heap_create(&bus->held)) {
        free(bus);
        return NULL;
    }
    return bus;
}

void bus_free(struct bus *bus)
{
    if (!bus)
        return;
    for (int i = 0; i < bus->node_count; i++)
        free(bus->node[i].queue.item);
    free(bus->held.item);
    free(bus);
}

int bus_attach(struct bus *bus, bus_receiver *receiver, void *context)
{
    if (bus->node_count == BUS_MAX_NODES)
        return -1;
    struct node *node = &bus->node[bus->node_count];
    if (!heap_create(&node->queue))
        return -1;
    node->receiver = receiver;
    node->context = context;
    return bus->node_count++;
}

void bus_listen(struct bus *bus, bus_receiver *listener, void *context)
{
    bus->listener = listener;
    bus->listener_context = context;
}

void bus_inject(struct bus *bus, const struct bus_faults *setting)
{
    bus->faulty = setting != NULL;
    if (setting)
        faults_start(&bus->faults, setting);
}

const struct bus_statistics *bus_statistics(const struct bus *bus)
{
    return &bus->statistics;
}

/* The arbitration field as a number, first bit on the bus highest; dominant (0) wins. */
static uint32_t arbitration(const struct can_frame_t *frame)
{
    const uint32_t remote = frame->flags & CAN_FLAG_RTR ? 1 : 0;
    if (frame->flags & CAN_FLAG_EXTENDED) /* base, SRR, IDE, extension, RTR */
        return frame->id >> 18 << 21 | 3u << 19 | (frame->id & 0x3ffff) << 1 | remote;
    return frame->id << 21 | remote << 20;
}

bool bus_send(struct bus *bus, int node, const struct can_frame_t *frame)
{
    if (node < 0 || node >= bus->node_count || framebits(frame) == 0 ||
        frame->id > (frame->flags & CAN_FLAG_EXTENDED ? 0x1fffffffu : 0x7ffu))
        return false;
    const struct waiting item = {.key = arbitration(frame), .order = bus->order++, .node = node, .frame = *frame};
    if (!heap_push(&bus->node[node].queue, &item)) {
        bus->statistics.overflowed++;
        return false;
    }
    return true;
}

/* Put the winner of arbitration on the bus. */
static void arbitrate(struct bus *bus)
{
    int winner = -1;
    for (int i = 0; i < bus->node_count; i++) {
        const struct heap *queue = &bus->node[i].queue;
        if (queue->count && (winner < 0 || queue->item[0].key < bus->node[winner].queue.item[0].key))
            winner = i;
    }
    if (winner < 0)
        return;
    bus->carried = heap_pop(&bus->node[winner].queue);
    const uint64_t bits = framebits(&bus->carried.frame);
    const uint64_t duration_ns = (bits * 1000000000 + bus->bit_rate - 1) / bus->bit_rate;
    bus->carrying = true;
    bus->carried_end_ns = bus->now_ns + duration_ns;
    bus->busy_ns += duration_ns;
    bus->statistics.busy_us = bus->busy_ns / 1000;
    bus->statistics.bits += bits;
    bus->statistics.frames++;
}

static void deliver(struct bus *bus, const struct waiting *item)
{
    const uint64_t time_us = bus->now_ns / 1000;
    if (bus->listener)
        bus->listener(bus->listener_context, &item->frame, time_us);
    for (int i = 0; i < bus->node_count; i++)
        if (i != item->node && bus->node[i].receiver)
            bus->node[i].receiver(bus->node[i].context, &item->frame, time_us);
}

/* Hold a frame back until `release_ns`; when the store is full it is delivered now and the fault does not happen. */
static bool hold(struct bus *bus, struct waiting *item, uint64_t release_ns, bool behind)
{
    item->key = release_ns;
    item->behind = behind;
    item->order = bus->order++;
    if (!heap_push(&bus->held, item))
        return false;
    bus->behind += behind;
    return true;
}

/* Take item i out of a heap: brought to the top with a key below all others, then popped. */
static struct waiting heap_remove(struct heap *heap, size_t i)
{
    struct waiting item = heap->item[i];
    for (; i > 0; i = (i - 1) / 2)
        heap->item[i] = heap->item[(i - 1) / 2];
    heap->item[0] = item;
    heap->item[0].key = 0;
    return heap_pop(heap);
}

/* Frames that were put behind this delivery go now, in the order in which they were held. */
static void release_behind(struct bus *bus)
{
    while (bus->behind > 0) {
        size_t first = 0;
        for (size_t i = 0; i < bus->held.count; i++)
            if (bus->held.item[i].behind &&
                (!bus->held.item[first].behind || bus->held.item[i].order < bus->held.item[first].order))
                first = i;
        const struct waiting item = heap_remove(&bus->held, first);
        bus->behind--;
        deliver(bus, &item);
    }
}

/* The frame on the bus has ended. */
static void complete(struct bus *bus)
{
    struct bus_statistics *count = &bus->statistics;
    struct waiting item = bus->carried;
    bus->carrying = false;
    const struct fault fault = bus->faulty && !item.again ? faults_next(&bus->faults, &item.frame) : (struct fault){0};
    if (fault.drop) {
        count->dropped++;
        return;
    }
    if (fault.duplicate) {
        struct waiting copy = item;
        copy.again = true;
        if (heap_push(&bus->node[item.node].queue,
                      &copy)) /* it has just left the queue, so there is nearly always room */
            count->duplicated++;
    }
    if (fault.corrupt) {
        faults_corrupt(&bus->faults, &item.frame);
        count->corrupted++;
    }
    if (fault.delay && hold(bus, &item, bus->now_ns + UINT64_C(1000) * bus->faults.setting.delay_us, false)) {
        count->delayed++;
        return;
    }
    if (fault.reorder && hold(bus, &item, bus->now_ns + UINT64_C(1000) * BUS_REORDER_US, true)) {
        count->reordered++;
        return;
    }
    deliver(bus, &item);
    release_behind(bus);
}

void bus_run(struct bus *bus, uint64_t until_us)
{
    const uint64_t until_ns = until_us * 1000;
    if (bus->running)
        return;
    bus->running = true;
    for (;;) {
        if (!bus->carrying)
            arbitrate(bus);
        const bool held = bus->held.count > 0;
        const bool release_first = held && (!bus->carrying || bus->held.item[0].key < bus->carried_end_ns);
        if (!bus->carrying && !held)
            break;
        const uint64_t next_ns = release_first ? bus->held.item[0].key : bus->carried_end_ns;
        if (next_ns > until_ns)
            break;
        bus->now_ns = next_ns;
        if (release_first) {
            const struct waiting item = heap_pop(&bus->held);
            bus->behind -= item.behind;
            deliver(bus, &item);
        } else {
            complete(bus);
        }
    }
    if (until_ns > bus->now_ns)
        bus->now_ns = until_ns;
    bus->running = false;
}
