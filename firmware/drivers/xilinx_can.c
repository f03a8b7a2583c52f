#include "xilinx_can.h"

#include "can_timing.h"
#include "registers.h"

#define BIT(n) (1u << (n))

enum {
    SRR_RESET = BIT(0),
    SRR_ENABLE = BIT(1), /* CEN: out of configuration mode */
    SR_CONFIG = BIT(0),
    SR_STATE_SHIFT = 7, /* ESTAT */
    SR_STATE_MASK = 3,
    STATE_BUS_OFF = 2,
    STATE_PASSIVE = 3,
    SR_URGENT_FULL = BIT(9),    /* TXBFLL */
    SR_TRANSMIT_FULL = BIT(10), /* TXFLL */
    ISR_OVERFLOW = BIT(6),      /* RXOFLW */
    ISR_RECEIVED = BIT(7),      /* RXNEMP: set again at once while the FIFO holds a frame */
    ISR_BUS_OFF = BIT(9),       /* BSOFF */
    ID_REMOTE = BIT(20),        /* SRR/RTR: of a frame with an 11-bit identifier, a remote frame */
    ID_EXTENDED = BIT(19),      /* IDE */
    ID_REMOTE_EXTENDED = BIT(0),
    RESET_READS = 1000, /* a reset takes a few cycles of the bus clock; each read of a register takes at least one */
    RECOVERY_BITS = 128 * 11 /* ISO 11898-1, 12.1.4.4 */
};

static const struct can_timing_limits limits = {.prescaler = 256, .before = 16, .after = 8, .jump = 4};

/* Every buffer is empty and the controller silent afterwards. */
static bool reset(struct xilinx_can *c)
{
    register_write(&c->registers->software_reset, SRR_RESET);
    c->passive = false;
    for (uint32_t i = 0; i < RESET_READS; i++) /* bound: RESET_READS */
        if (register_read(&c->registers->status) & SR_CONFIG)
            return true;
    return false;
}

/* From configuration mode onto the bus. */
static bool configure(struct xilinx_can *c)
{
    struct xilinx_can_registers *r = c->registers;
    struct can_timing t;
    if (!can_timing_find(c->settings.clock_Hz, c->settings.bit_rate, &limits, &t))
        return false;
    register_write(&r->mode, 0); /* normal: no loop-back, sleep, snoop */
    register_write(&r->prescaler, t.prescaler - 1);
    register_write(&r->bit_timing, (t.jump - 1) << 7 | (t.after - 1) << 4 | (t.before - 1));
    register_write(&r->interrupt_enable, 0);
    register_write(&r->filter_enable, 0);                /* a filter may only be changed while it is not in use */
    for (uint32_t i = 0; i < c->settings.filters; i++) { /* bound: XILINX_CAN_FILTERS */
        register_write(&r->filter[i].mask, c->settings.filter[i].mask << 21 | ID_REMOTE | ID_EXTENDED);
        register_write(&r->filter[i].identifier, c->settings.filter[i].id << 21);
    }
    register_write(&r->filter_enable, BIT(c->settings.filters) - 1u);
    register_write(&r->software_reset, SRR_ENABLE);
    c->off = false;
    return true;
}

bool xilinx_can_start(struct xilinx_can *c, struct xilinx_can_registers *registers,
                      const struct xilinx_can_settings *settings)
{
    *c = (struct xilinx_can){.registers = registers, .settings = *settings};
    return settings->filters <= XILINX_CAN_FILTERS && reset(c) && configure(c);
}

/* Silence, as after bus-off. */
static void leave(struct xilinx_can *c)
{
    reset(c);
    c->off = true;
    c->back_us = 0; /* the next poll says when */
}

/* Count what happened. */
static void watch(struct xilinx_can *c)
{
    struct xilinx_can_registers *r = c->registers;
    uint32_t interrupts = register_read(&r->interrupts), counters = register_read(&r->error_counters);
    uint32_t state = register_read(&r->status) >> SR_STATE_SHIFT & SR_STATE_MASK;
    c->transmit_errors = counters & 0xFFu;
    c->receive_errors = counters >> 8 & 0xFFu;
    if (interrupts & ISR_OVERFLOW) {
        c->errors.receive_overflows++;
        register_write(&r->interrupt_clear, ISR_OVERFLOW);
    }
    if (state == STATE_PASSIVE && !c->passive)
        c->errors.error_passive++;
    c->passive = state == STATE_PASSIVE;
    if (state == STATE_BUS_OFF || (interrupts & ISR_BUS_OFF)) {
        c->errors.bus_off++;
        leave(c);
    }
}

void xilinx_can_poll(struct xilinx_can *c, uint64_t time_us)
{
    if (!c->off)
        watch(c);
    if (c->off && c->back_us == 0)
        c->back_us = time_us + (RECOVERY_BITS * 1000000u + c->settings.bit_rate - 1) / c->settings.bit_rate;
    else if (c->off && time_us >= c->back_us)
        configure(c);
}

bool xilinx_can_receive(struct xilinx_can *c, struct can_frame_t *frame)
{
    struct xilinx_can_registers *r = c->registers;
    if (c->off || !(register_read(&r->interrupts) & ISR_RECEIVED))
        return false;
    uint32_t id = register_read(&r->receive.identifier), length = register_read(&r->receive.length) >> 28;
    uint32_t data[2] = {register_read(&r->receive.data[0]), register_read(&r->receive.data[1])};
    register_write(&r->interrupt_clear, ISR_RECEIVED);

    *frame = (struct can_frame_t){.id = id >> 21, .length = (uint8_t)(length > 8 ? 8 : length)};
    if (id & ID_EXTENDED) {
        frame->id = (id >> 21) << 18 | (id >> 1 & 0x3FFFFu);
        frame->flags = CAN_FLAG_EXTENDED;
    }
    if (id & (id & ID_EXTENDED ? ID_REMOTE_EXTENDED : ID_REMOTE))
        frame->flags |= CAN_FLAG_RTR;
    for (uint32_t i = 0; i < frame->length; i++) /* bound: 8 */
        frame->data[i] = (uint8_t)(data[i / 4] >> (24 - 8 * (i % 4)));
    return true;
}

static void put(struct xilinx_can_message *m, const struct can_frame_t *frame)
{
    uint32_t id = frame->id << 21, data[2] = {0, 0};
    bool remote = frame->flags & CAN_FLAG_RTR;
    if (frame->flags & CAN_FLAG_EXTENDED)
        id = (frame->id >> 18) << 21 | ID_REMOTE | ID_EXTENDED | (frame->id & 0x3FFFFu) << 1 | (remote ? 1u : 0u);
    else if (remote)
        id |= ID_REMOTE;
    for (uint32_t i = 0; i < frame->length; i++) /* bound: 8 */
        data[i / 4] |= (uint32_t)frame->data[i] << (24 - 8 * (i % 4));
    register_write(&m->identifier, id);
    register_write(&m->length, (uint32_t)frame->length << 28);
    register_write(&m->data[0], data[0]);
    register_write(&m->data[1], data[1]); /* the last word hands it over */
}

static bool fits(const struct xilinx_can *c, const struct can_frame_t *frame)
{
    return !c->off && frame->length <= 8 && !(frame->flags & (CAN_FLAG_FD | CAN_FLAG_ERROR));
}

bool xilinx_can_transmit(struct xilinx_can *c, const struct can_frame_t *frame)
{
    if (!fits(c, frame) || (register_read(&c->registers->status) & SR_TRANSMIT_FULL))
        return false;
    put(&c->registers->transmit, frame);
    return true;
}

bool xilinx_can_transmit_urgent(struct xilinx_can *c, const struct can_frame_t *frame)
{
    if (!fits(c, frame))
        return false;
    if (register_read(&c->registers->status) & SR_URGENT_FULL) {
        watch(c); /* first of all: bus-off clears the error counters */
        if (c->off)
            return false;
        c->errors.aborted++;
        if (c->transmit_errors > 0)
            leave(c);
        if (c->off || !reset(c) || !configure(c))
            return false;
    }
    put(&c->registers->urgent, frame);
    return true;
}
