#include "fdcan.h"

#include "can_timing.h"
#include "registers.h"

#define BIT(n)      (1u << (n))
#define FILTER_MASK (2u << 30) /* SFT: identifier and mask */

enum {
    CCCR_INIT = BIT(0),
    CCCR_CONFIGURE = BIT(1),                        /* CCE */
    PSR_PASSIVE = BIT(5),                           /* EP */
    PSR_BUS_OFF = BIT(7),                           /* BO */
    IR_LOST = BIT(3),                               /* RF0L: no room in the receive FIFO */
    GFC_REJECT = BIT(0) | BIT(1) | 2 << 2 | 2 << 4, /* remote frames, and what no filter names */
    FILTER_STORE = 1 << 27,                         /* SFEC: in receive FIFO 0 */
    ID_EXTENDED = BIT(30),                          /* XTD */
    ID_REMOTE = BIT(29),                            /* RTR */
    MODE_READS = 1000, /* a mode passes from the bus clock to the controller: a few cycles of the slower */
    CANCEL_READS = 100
};

static const struct can_timing_limits limits = {.prescaler = 512, .before = 256, .after = 128, .jump = 128};

static bool wait_control(struct fdcan *c, uint32_t bits, uint32_t value)
{
    for (uint32_t i = 0; i < MODE_READS; i++) /* bound: MODE_READS */
        if ((register_read(&c->registers->control) & bits) == value)
            return true;
    return false;
}

/* Silent, and ready to be configured; the FIFOs and buffers are empty. */
static bool stop(struct fdcan *c)
{
    register_write(&c->registers->control, CCCR_INIT);
    if (!wait_control(c, CCCR_INIT, CCCR_INIT))
        return false;
    register_write(&c->registers->control, CCCR_INIT | CCCR_CONFIGURE);
    return wait_control(c, CCCR_CONFIGURE, CCCR_CONFIGURE);
}

static void clear_memory(struct fdcan_memory *memory)
{
    volatile uint32_t *word = memory->filter;         /* RM0433: its parity is undefined after power-on */
    for (uint32_t i = 0; i < sizeof *memory / 4; i++) /* bound: words of the message RAM */
        register_write(&word[i], 0);
}

static void configure(struct fdcan *c, const struct fdcan_settings *s, const struct can_timing *t)
{
    struct fdcan_registers *r = c->registers;
    uint32_t begin =
        s->memory_word * 4; /* the start addresses' two low bits are not kept: byte offsets fit as they are */
    uint32_t receive = begin + (uint32_t)offsetof(struct fdcan_memory, receive);
    uint32_t transmit = begin + (uint32_t)offsetof(struct fdcan_memory, transmit);
    clear_memory(c->memory);
    for (uint32_t i = 0; i < s->filters; i++) /* bound: FDCAN_FILTERS */
        register_write(&c->memory->filter[i], FILTER_MASK | FILTER_STORE | s->filter[i].id << 16 | s->filter[i].mask);
    register_write(&r->bit_timing,
                   (t->jump - 1) << 25 | (t->prescaler - 1) << 16 | (t->before - 1) << 8 | (t->after - 1));
    register_write(&r->interrupt_enable, 0);
    register_write(&r->global_filter, s->filters ? GFC_REJECT : 0);
    register_write(&r->standard_filters, s->filters << 16 | begin);
    register_write(&r->extended_filters, 0);
    register_write(&r->receive_setup, FDCAN_RECEIVE << 16 | receive);
    register_write(&r->receive1_setup, 0);
    register_write(&r->receive_buffers, 0);
    register_write(&r->receive_size, 0); /* 8 bytes */
    register_write(&r->transmit_setup, (uint32_t)(FDCAN_URGENT + FDCAN_TRANSMIT) << 16 | transmit);
    register_write(&r->transmit_size, 0);
    register_write(&r->event_setup, 0);
    register_write(&r->interrupts, 0xFFFFFFFFu);
    register_write(&r->control, 0); /* classic frames, automatic retransmission; onto the bus */
}

bool fdcan_start(struct fdcan *c, struct fdcan_registers *registers, struct fdcan_memory *memory,
                 const struct fdcan_settings *settings)
{
    struct can_timing t;
    *c = (struct fdcan){.registers = registers, .memory = memory};
    if (settings->filters > FDCAN_FILTERS || !can_timing_find(settings->clock_Hz, settings->bit_rate, &limits, &t) ||
        !stop(c))
        return false;
    configure(c, settings, &t);
    return wait_control(c, CCCR_INIT, 0);
}

void fdcan_poll(struct fdcan *c)
{
    struct fdcan_registers *r = c->registers;
    uint32_t status = register_read(&r->protocol_status), counters = register_read(&r->error_counters);
    c->transmit_errors = counters & 0xFFu;
    c->receive_errors = counters & BIT(15) ? 128u : counters >> 8 & 0x7Fu; /* RP: 128 or more */
    if (register_read(&r->interrupts) & IR_LOST) {
        c->errors.receive_overflows++;
        register_write(&r->interrupts, IR_LOST);
    }
    bool off = status & PSR_BUS_OFF, passive = !off && (status & PSR_PASSIVE);
    if (passive && !c->passive)
        c->errors.error_passive++;
    c->passive = passive;
    if (off && !c->off) {
        c->errors.bus_off++;
        stop(c);
        register_write(&r->control, 0);
    }
    c->off = off;
}

bool fdcan_waiting(struct fdcan *c)
{
    return (register_read(&c->registers->receive_status) & 0x7Fu) != 0;
}

bool fdcan_receive(struct fdcan *c, struct can_frame_t *frame)
{
    uint32_t status = register_read(&c->registers->receive_status);
    if ((status & 0x7Fu) == 0)
        return false;
    uint32_t at = status >> 8 & 0x3Fu;
    struct fdcan_message *m = &c->memory->receive[at % FDCAN_RECEIVE];
    uint32_t id = register_read(&m->identifier), length = register_read(&m->length) >> 16 & 15u;
    uint32_t data[2] = {register_read(&m->data[0]), register_read(&m->data[1])};
    register_write(&c->registers->receive_acknowledge, at);

    bool extended = id & ID_EXTENDED;
    *frame = (struct can_frame_t){.id = extended ? id & 0x1FFFFFFFu : id >> 18 & 0x7FFu,
                                  .length = (uint8_t)(length > 8 ? 8 : length)};
    frame->flags = (uint8_t)((extended ? CAN_FLAG_EXTENDED : 0) | (id & ID_REMOTE ? CAN_FLAG_RTR : 0));
    for (uint32_t i = 0; i < frame->length; i++) /* bound: 8 */
        frame->data[i] = (uint8_t)(data[i / 4] >> (8 * (i % 4)));
    return true;
}

static void put(struct fdcan *c, uint32_t buffer, const struct can_frame_t *frame)
{
    struct fdcan_message *m = &c->memory->transmit[buffer];
    uint32_t data[2] = {0, 0};
    for (uint32_t i = 0; i < frame->length; i++) /* bound: 8 */
        data[i / 4] |= (uint32_t)frame->data[i] << (8 * (i % 4));
    register_write(&m->identifier, (frame->flags & CAN_FLAG_EXTENDED ? ID_EXTENDED | frame->id : frame->id << 18) |
                                       (frame->flags & CAN_FLAG_RTR ? ID_REMOTE : 0));
    register_write(&m->length, (uint32_t)frame->length << 16);
    register_write(&m->data[0], data[0]);
    register_write(&m->data[1], data[1]);
    register_write(&c->registers->request, BIT(buffer));
}

static bool fits(struct fdcan *c, const struct can_frame_t *frame)
{
    if (frame->length > 8 || (frame->flags & (CAN_FLAG_FD | CAN_FLAG_ERROR)))
        return false;
    return !c->off && !(register_read(&c->registers->control) & CCCR_INIT);
}

bool fdcan_transmit(struct fdcan *c, const struct can_frame_t *frame)
{
    if (!fits(c, frame))
        return false;
    if (register_read(&c->registers->pending) >> FDCAN_URGENT == 0)
        c->next = FDCAN_URGENT;
    if (c->next == FDCAN_URGENT + FDCAN_TRANSMIT) /* a lower buffer, though free, would overtake */
        return false;
    put(c, c->next++, frame);
    return true;
}

/* Take back all that waits; what is left is on the bus, as bits of buffers. */
static uint32_t take_back(struct fdcan *c)
{
    struct fdcan_registers *r = c->registers;
    uint32_t waiting = register_read(&r->pending), left = waiting;
    if (waiting == 0)
        return 0;
    register_write(&r->cancel, waiting);
    for (uint32_t i = 0; i < CANCEL_READS && left; i++) /* bound: CANCEL_READS */
        left = register_read(&r->pending);
    for (uint32_t taken = waiting & ~left & ~register_read(&r->sent); taken; taken &= taken - 1) /* bound: 32 buffers */
        c->errors.aborted++;
    return left;
}

bool fdcan_transmit_urgent(struct fdcan *c, const struct can_frame_t *frame)
{
    if (!fits(c, frame))
        return false;
    uint32_t left = take_back(c);
    if ((left & 1u) && (left & 2u))
        return false;
    put(c, left & 1u ? 1 : 0, frame);
    return true;
}
