/* ST's FDCAN behind its registers and message RAM, as RM0433 and Bosch's M_CAN manual describe it. Registers are known by their
 * offsets, the message RAM by the start addresses that the driver gives.
 *
 * Bus-off sets CCCR.INIT and keeps what waits; CCCR.CCE empties FIFOs and buffers; clearing INIT lets 129 x 11 recessive bits
 * count, after which it is back with its error counters at 0. A cancelled frame that is on the bus is sent or fails once.
 * Violations: writing protected registers outside of configuration, requesting a buffer that is not there, waits or lies beyond
 * the message RAM, acknowledging what is not the oldest frame, setting CCE without INIT. */
#ifndef TROCAR_FDCAN_MODEL_H
#define TROCAR_FDCAN_MODEL_H

#include "bus_model.h"

enum { MODEL_REGISTERS = 64, MODEL_WORDS = 2560, MODEL_OFFSET = 40 /* words of another controller before */ };

static struct {
    uint32_t block[MODEL_REGISTERS], ram[MODEL_WORDS]; /* addresses; the values of registers and RAM */
    unsigned get, count;                               /* of the receive FIFO */
    unsigned put, first, waiting;                      /* of the transmit FIFO: next free, next to send */
    uint32_t pending, cancelling, sent, cancelled, on_bus;
    unsigned next; /* buffer that is being sent */
    uint64_t joins_at;
    bool recovering;
} model;

enum {
    M_CCCR = 6,
    M_NBTP,
    M_ECR = 16,
    M_PSR,
    M_IR = 20,
    M_IE,
    M_GFC = 32,
    M_SIDFC,
    M_XIDFC,
    M_RXF0C = 40,
    M_RXF0S,
    M_RXF0A,
    M_RXBC,
    M_RXF1C,
    M_RXESC = 47,
    M_TXBC,
    M_TXFQS,
    M_TXESC,
    M_TXBRP,
    M_TXBAR,
    M_TXBCR,
    M_TXBTO,
    M_TXBCF,
    M_TXEFC = 60
};

static inline void model_words(const struct can_frame_t *f, uint32_t w[4])
{
    memset(w, 0, 4 * sizeof w[0]);
    w[0] = f->flags & CAN_FLAG_EXTENDED ? 1u << 30 | f->id : f->id << 18;
    w[0] |= f->flags & CAN_FLAG_RTR ? 1u << 29 : 0;
    w[1] = (uint32_t)f->length << 16;
    for (unsigned i = 0; i < f->length; i++)
        w[2 + i / 4] |= (uint32_t)f->data[i] << (8 * (i % 4));
}

static inline void model_frame(const uint32_t *w, struct can_frame_t *f)
{
    bool extended = w[0] >> 30 & 1;
    *f = (struct can_frame_t){.id = extended ? w[0] & 0x1FFFFFFF : w[0] >> 18 & 0x7FF, .length = w[1] >> 16 & 15};
    f->flags = (uint8_t)((extended ? CAN_FLAG_EXTENDED : 0) | (w[0] >> 29 & 1 ? CAN_FLAG_RTR : 0));
    for (unsigned i = 0; i < f->length && i < 8; i++)
        f->data[i] = (uint8_t)(w[2 + i / 4] >> (8 * (i % 4)));
}

static inline void model_power_on(void)
{
    memset(&bus, 0, sizeof bus);
    memset(&model, 0, sizeof model);
    memset(model.ram, 0xA5, sizeof model.ram);
    model.block[M_CCCR] = 1;
}

static inline unsigned model_waiting(void)
{
    return model.count;
}

static inline unsigned model_dedicated(void)
{
    return model.block[M_TXBC] >> 16 & 0x3F;
}

static inline unsigned model_fifo(void)
{
    return model.block[M_TXBC] >> 24 & 0x3F;
}

/* Words of transmit buffer `b`. */
static inline uint32_t *model_buffer(unsigned b)
{
    return &model.ram[(model.block[M_TXBC] & 0xFFFC) / 4 + 4 * b];
}

static inline void model_empty(void)
{
    model.get = model.count = model.waiting = 0;
    model.put = model.first = model_dedicated();
    model.pending = model.cancelling = model.sent = model.cancelled = model.on_bus = 0;
}

static bool controller_normal(void)
{
    return !(model.block[M_CCCR] & 1) && !bus.off && bus.bits >= model.joins_at;
}

static bool controller_next(struct can_frame_t *frame)
{
    bool found = false;
    for (unsigned b = 0; b <= model_dedicated(); b++) { /* the last: the FIFO's head */
        unsigned buffer = b < model_dedicated() ? b : model.first;
        struct can_frame_t f;
        if (b < model_dedicated() ? !(model.pending >> b & 1) : model.waiting == 0)
            continue;
        model_frame(model_buffer(buffer), &f);
        if (!found || f.id < frame->id) {
            model.next = buffer;
            *frame = f;
        }
        found = true;
    }
    return found;
}

static inline unsigned model_after(unsigned b)
{
    return b + 1 == model_dedicated() + model_fifo() ? model_dedicated() : b + 1;
}

static void controller_attempted(bool sent)
{
    uint32_t bit = 1u << model.next;
    if (!sent && !(model.cancelling & bit))
        return;
    model.pending &= ~bit;
    model.sent |= sent ? bit : 0;
    model.cancelled |= model.cancelling & bit;
    model.cancelling &= ~bit;
    if (model.next >= model_dedicated()) {
        model.first = model_after(model.first);
        model.waiting--;
    }
}

static void controller_bus_off(void)
{
    model.block[M_CCCR] |= 1;
    model.recovering = false;
    model.block[M_IR] |= 1u << 25;
}

static void controller_time(void)
{
    if (bus.off && model.recovering && bus.bits >= model.joins_at) {
        bus.off = model.recovering = false;
        bus.tec = bus.rec = 0;
    }
}

static void controller_store(const struct can_frame_t *frame)
{
    uint32_t w[4], list = model.block[M_SIDFC];
    bool extended = frame->flags & CAN_FLAG_EXTENDED, pass;
    uint32_t gfc = model.block[M_GFC];
    pass = (gfc >> (extended ? 2 : 4) & 3) == 0;
    for (unsigned i = 0; !extended && i < (list >> 16 & 0xFF); i++) {
        uint32_t f = model.ram[(list & 0xFFFC) / 4 + i];
        if (f >> 30 == 2 && (f >> 27 & 7) == 1 && (frame->id & f & 0x7FF) == (f >> 16 & f & 0x7FF))
            pass = true;
    }
    if ((frame->flags & CAN_FLAG_RTR) && (gfc >> (extended ? 0 : 1) & 1))
        pass = false;
    if (!pass)
        return;
    unsigned size = model.block[M_RXF0C] >> 16 & 0x7F;
    if (model.count == size) {
        bus.overflows++;
        model.block[M_IR] |= 1u << 3;
        return;
    }
    model_words(frame, w);
    w[1] |= (uint32_t)bus.bits & 0xFFFF; /* time stamp */
    memcpy(&model.ram[(model.block[M_RXF0C] & 0xFFFC) / 4 + 4 * ((model.get + model.count) % size)], w, sizeof w);
    model.count++;
    model.block[M_IR] |= 1;
}

/* The register's index, or MODEL_REGISTERS + the word of the RAM. */
static inline unsigned model_index(const volatile uint32_t *address)
{
    const uint32_t *a = (const uint32_t *)address;
    if (a >= model.ram && a < model.ram + MODEL_WORDS)
        return MODEL_REGISTERS + (unsigned)(a - model.ram);
    if (a < model.block || a >= model.block + MODEL_REGISTERS)
        abort();
    return (unsigned)(a - model.block);
}

uint32_t register_read(const volatile uint32_t *address)
{
    unsigned at = model_index(address);
    if (bus.absent)
        return 0;
    if (at >= MODEL_REGISTERS)
        return model.ram[at - MODEL_REGISTERS];
    switch (at) {
    case M_ECR:
        return (bus.tec > 255 ? 255 : bus.tec) | (bus.rec > 127 ? 127u << 8 | 1u << 15 : bus.rec << 8);
    case M_PSR:
        return (bus.passive ? 1u << 5 : 0) | (bus.off ? 1u << 7 : 0) | (bus.tec >= 96 || bus.rec >= 96 ? 1u << 6 : 0) |
               7;
    case M_RXF0S:
        return model.count | model.get << 8;
    case M_TXFQS:
        return (model_fifo() - model.waiting) | model.first << 8 | model.put << 16 |
               (model.waiting == model_fifo() ? 1u << 21 : 0);
    case M_TXBRP:
        return model.pending;
    case M_TXBTO:
        return model.sent;
    case M_TXBCF:
        return model.cancelled;
    default:
        return model.block[at];
    }
}

static inline void model_control(uint32_t value)
{
    uint32_t before = model.block[M_CCCR];
    if ((value & 2) && !(value & before & 1)) {
        bus.violations++;
        value &= ~2u;
    }
    if (!(value & 1))
        value &= ~2u;
    if ((before & 1) && !(value & 1)) {
        model.recovering = bus.off;
        model.joins_at = bus.bits + (bus.off ? 129 * 11 : 11);
    }
    if ((value & 2) && !(before & 2))
        model_empty();
    model.block[M_CCCR] = value;
}

static inline void model_request(uint32_t bits)
{
    for (unsigned b = 0; b < 32; b++)
        if (bits >> b & 1) {
            bool fifo = b >= model_dedicated();
            uint32_t *w = model_buffer(b);
            if (b >= model_dedicated() + model_fifo() || (model.pending >> b & 1) || (fifo && b != model.put) ||
                (fifo && model.waiting == model_fifo()) || w + 4 > model.ram + MODEL_WORDS ||
                (model.block[M_CCCR] & 1)) {
                bus.violations++;
                continue;
            }
            model.pending |= 1u << b;
            model.sent &= ~(1u << b);
            model.cancelled &= ~(1u << b);
            if (fifo) {
                model.put = model_after(model.put);
                model.waiting++;
            }
        }
}

static inline void model_cancel(uint32_t bits)
{
    bits &= model.pending;
    if (model_dedicated() < 32 && bits >> model_dedicated())
        bus.violations++; /* "not intended for Tx FIFO operation" */
    model.cancelling |= bits & model.on_bus;
    bits &= ~model.on_bus;
    model.pending &= ~bits;
    model.cancelled |= bits;
}

void register_write(volatile uint32_t *address, uint32_t value)
{
    unsigned at = model_index(address);
    if (bus.absent)
        return;
    bool configuring = model.block[M_CCCR] & 2;
    if (at >= MODEL_REGISTERS) {
        bus.violations += at - MODEL_REGISTERS < MODEL_OFFSET; /* another controller's */
        model.ram[at - MODEL_REGISTERS] = value;
        return;
    }
    switch (at) {
    case M_CCCR:
        model_control(value);
        return;
    case M_IR:
        model.block[M_IR] &= ~value;
        return;
    case M_RXF0A:
        if (model.count == 0 || value != model.get)
            bus.violations++;
        else {
            model.get = (model.get + 1) % (model.block[M_RXF0C] >> 16 & 0x7F);
            model.count--;
        }
        return;
    case M_TXBAR:
        model_request(value);
        return;
    case M_TXBCR:
        model_cancel(value);
        return;
    case M_IE:
        model.block[at] = value;
        return;
    case M_ECR:
    case M_PSR:
    case M_RXF0S:
    case M_TXFQS:
    case M_TXBRP:
    case M_TXBTO:
    case M_TXBCF:
        bus.violations++;
        return;
    default: /* protected */
        if (!configuring)
            bus.violations++;
        else
            model.block[at] = value;
        if (at == M_TXBC)
            model_empty();
    }
}

#endif
