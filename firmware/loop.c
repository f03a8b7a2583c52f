#include "loop.h"

#include "hal.h"
#include "node.h"
#include "wire.h"

static void transmit_queue(struct node *n)
{
    struct can_frame_t frame;
    for (uint32_t i = 0; i < NODE_QUEUE && node_transmit(n, &frame); i++) /* bound: NODE_QUEUE */
        if (!hal_can_transmit(&frame))
            n->queue_overflows++;
}

/* Take what has arrived; true once every device has answered this tick's SYNC. */
static bool receive_all(struct node *n)
{
    struct can_frame_t frame;
    for (uint32_t i = 0; i < LOOP_FRAMES_PER_TICK && hal_can_receive(&frame); i++) /* bound: LOOP_FRAMES_PER_TICK */
        node_receive(n, &frame);
    return node_answered(n);
}

/* `lacking`: bits of the effects that the bank names and this image has not; goes where other emergencies have the tick. */
static int refuse(int status, uint32_t lacking, uint8_t node_id)
{
    struct wire_emergency m = {
        .error_code = 0x6300, .error_register = 1, .reason = (int16_t)status, .tick = (uint16_t)lacking};
    struct can_frame_t frame = {.id = WIRE_EMERGENCY_ID + (uint32_t)node_id, .length = WIRE_EMERGENCY_LENGTH};
    wire_emergency_pack(frame.data, &m);
    hal_can_transmit(&frame);
    hal_wait_us(hal_time_us());
    return status;
}

int loop_run(uint8_t node_id)
{
    static struct node node; /* the one state of the controller */
    static struct bank_view bank;
    size_t length = 0, room = 0;
    const void *bytes = hal_bank(&length);
    void *memory = hal_memory(&room);
    if (node_id < 1 || node_id > LOOP_MAX_NODE)
        return STATUS_USAGE;
    int status = bytes ? bank_view_open(&bank, bytes, length) : STATUS_BANK_MAGIC;
    if (status == STATUS_OK && node_id + bank.tool_count - 1u > LOOP_MAX_NODE)
        return STATUS_USAGE;
    if (status == STATUS_OK)
        status = node_start(&node, &bank, node_id, memory, room);
    if (status != STATUS_OK)
        return refuse(status, status == STATUS_BANK_EFFECT ? bank.fault_record : 0, node_id);
    transmit_queue(&node);
    uint64_t start_us = hal_time_us();
    while (hal_running()) { /* bound: none, this is the controller's life */
        node_begin_tick(&node);
        transmit_queue(&node);
        uint64_t now_us = hal_time_us();
        while (!receive_all(&node) && now_us < start_us + LOOP_SAMPLE_WAIT_US) /* bound: LOOP_SAMPLE_WAIT_US of time */
            now_us = hal_wait_us(start_us + LOOP_SAMPLE_WAIT_US);
        node.bus = hal_can_errors();
        now_us = hal_time_us();
        node_finish_tick(&node);
        uint64_t spent_us = hal_time_us() - now_us;
        if (spent_us > node.worst_tick_us)
            node.worst_tick_us = (uint32_t)spent_us;
        transmit_queue(&node);

        start_us += LOOP_TICK_US;
        now_us = hal_time_us();
        if (now_us > start_us) { /* late: say so, and do not try to catch up */
            node_overrun(&node);
            start_us = now_us;
        }
        while (now_us < start_us) { /* bound: LOOP_TICK_US of time */
            receive_all(&node);
            now_us = hal_wait_us(start_us);
        }
    }
    return STATUS_OK;
}
