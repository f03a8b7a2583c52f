/* The Zynq's CAN controller behind its registers, as UG1085 and UG1087 describe it. Registers are known by their offsets.
 *
 * Bus-off and configuration mode keep the FIFOs, only a software reset empties them; both, and the entry into bus-off, clear the
 * error counters. From bus-off it comes back by itself after 128 x 11 recessive bits. Violations: configuring outside of
 * configuration mode, filters changed while in use, words of a message out of order, writing to a full buffer. */
#ifndef TROCAR_XILINX_CAN_MODEL_H
#define TROCAR_XILINX_CAN_MODEL_H

#include "bus_model.h"

enum { MODEL_FIFO = 64, MODEL_REGISTERS = 33 };

static struct {
    uint32_t block[MODEL_REGISTERS]; /* addresses; the values of the plain registers */
    bool enabled;
    unsigned interrupts, resets;
    uint32_t transmit[MODEL_FIFO][4], urgent[4], receive[MODEL_FIFO][4];
    unsigned transmit_count, urgent_full, receive_count;
    uint32_t word[2][4]; /* of the messages being written */
    unsigned written[2], taken;
    uint64_t joins_at, back_at;
} model;

enum {
    M_SRR,
    M_MSR,
    M_BRPR,
    M_BTR,
    M_ECR,
    M_ESR,
    M_SR,
    M_ISR,
    M_IER,
    M_ICR,
    M_TCR,
    M_WIR,
    M_TX,
    M_HPB = 16,
    M_RX = 20,
    M_AFR = 24,
    M_AFMR1
};

/* "Message Format": identifier, length, data, bit by bit. */
static inline void model_words(const struct can_frame_t *f, uint32_t w[4])
{
    bool extended = f->flags & CAN_FLAG_EXTENDED, remote = f->flags & CAN_FLAG_RTR;
    memset(w, 0, 4 * sizeof w[0]);
    for (unsigned bit = 0; bit < 11; bit++)
        w[0] |= (f->id >> (extended ? 18 + bit : bit) & 1) << (21 + bit);
    for (unsigned bit = 0; extended && bit < 18; bit++)
        w[0] |= (f->id >> bit & 1) << (1 + bit);
    w[0] |= (extended || remote ? 1u : 0) << 20 | (extended ? 1u : 0) << 19 | (extended && remote ? 1u : 0);
    w[1] = (uint32_t)f->length << 28;
    for (unsigned i = 0; i < f->length; i++)
        w[2 + i / 4] |= (uint32_t)f->data[i] << (8 * (3 - i % 4));
}

static inline void model_frame(const uint32_t w[4], struct can_frame_t *f)
{
    bool extended = w[0] >> 19 & 1;
    *f = (struct can_frame_t){.id = w[0] >> 21, .length = (uint8_t)(w[1] >> 28)};
    if (extended)
        f->id = f->id << 18 | (w[0] >> 1 & 0x3FFFF);
    f->flags = (uint8_t)((extended ? CAN_FLAG_EXTENDED : 0) | (w[0] >> (extended ? 0 : 20) & 1 ? CAN_FLAG_RTR : 0));
    for (unsigned i = 0; i < f->length; i++)
        f->data[i] = (uint8_t)(w[2 + i / 4] >> (8 * (3 - i % 4)));
}

static void model_reset(void)
{
    unsigned resets = model.resets + 1;
    memset(&model, 0, sizeof model);
    model.resets = resets;
    bus.off = bus.passive = false;
    bus.tec = bus.rec = 0;
}

static inline void model_power_on(void)
{
    memset(&bus, 0, sizeof bus);
    model_reset();
    model.resets = 0;
}

static inline unsigned model_waiting(void)
{
    return model.receive_count;
}

static bool controller_normal(void)
{
    return model.enabled && !bus.off && bus.bits >= model.joins_at;
}

static bool controller_next(struct can_frame_t *frame)
{
    if (model.urgent_full)
        model_frame(model.urgent, frame);
    else if (model.transmit_count)
        model_frame(model.transmit[0], frame);
    return model.urgent_full || model.transmit_count;
}

static void controller_attempted(bool sent)
{
    if (!sent)
        return;
    if (model.urgent_full)
        model.urgent_full = 0;
    else
        memmove(model.transmit, model.transmit + 1, --model.transmit_count * sizeof model.transmit[0]);
    model.interrupts |= 1u << 1;
}

static void controller_bus_off(void)
{
    bus.tec = bus.rec = 0;
    model.interrupts |= 1u << 9;
    model.back_at = bus.bits + 128 * 11;
}

static void controller_time(void)
{
    if (bus.off && bus.bits >= model.back_at)
        bus.off = false;
}

static void controller_store(const struct can_frame_t *frame)
{
    uint32_t w[4];
    model_words(frame, w);
    bool pass = model.block[M_AFR] == 0;
    for (unsigned f = 0; f < 4; f++) {
        uint32_t mask = model.block[M_AFMR1 + 2 * f], id = model.block[M_AFMR1 + 2 * f + 1];
        pass |= (model.block[M_AFR] >> f & 1) && (w[0] & mask) == (id & mask);
    }
    if (!pass)
        return;
    if (model.receive_count == MODEL_FIFO) {
        bus.overflows++;
        model.interrupts |= 1u << 6;
        return;
    }
    w[1] |= (uint32_t)bus.bits & 0xFFFF; /* time stamp */
    memcpy(model.receive[model.receive_count++], w, sizeof w);
    model.interrupts |= 1u << 4;
}

static inline unsigned model_index(const volatile uint32_t *address)
{
    size_t at = (size_t)(address - (volatile uint32_t *)model.block);
    if (at >= MODEL_REGISTERS)
        abort();
    return (unsigned)at;
}

static inline uint32_t model_status(void)
{
    uint32_t state = !model.enabled ? 0 : bus.off ? 2 : bus.passive ? 3 : 1;
    return (model.enabled ? 0 : 1u) | (controller_normal() ? 1u << 3 : 0) | state << 7 |
           (model.urgent_full ? 1u << 9 : 0) | (model.transmit_count == MODEL_FIFO ? 1u << 10 : 0) |
           (bus.tec >= 96 || bus.rec >= 96 ? 1u << 6 : 0);
}

uint32_t register_read(const volatile uint32_t *address)
{
    unsigned at = model_index(address);
    if (bus.absent)
        return 0;
    switch (at) {
    case M_SRR:
        return model.enabled ? 2 : 0;
    case M_ECR:
        return bus.rec << 8 | bus.tec;
    case M_SR:
        return model_status();
    case M_ISR:
        return model.interrupts | (model.receive_count ? 1u << 7 : 0);
    case M_RX:
    case M_RX + 1:
    case M_RX + 2:
    case M_RX + 3: {
        if (model.receive_count == 0 || at - M_RX != model.taken) {
            bus.violations++;
            return 0xDEADBEEF;
        }
        uint32_t word = model.receive[0][model.taken++];
        if (model.taken == 4) {
            memmove(model.receive, model.receive + 1, --model.receive_count * sizeof model.receive[0]);
            model.taken = 0;
        }
        return word;
    }
    default:
        if (at >= M_TX && at < M_RX)
            bus.violations++; /* write only */
        return model.block[at];
    }
}

/* A word into a message buffer: 0 the FIFO, 1 the high-priority buffer. */
static inline void model_put(unsigned which, unsigned word, uint32_t value)
{
    if ((which ? model.urgent_full : model.transmit_count == MODEL_FIFO) || word != model.written[which]) {
        bus.violations++;
        return;
    }
    model.word[which][word] = value;
    model.written[which] = (word + 1) % 4;
    if (word < 3)
        return;
    memcpy(which ? model.urgent : model.transmit[model.transmit_count], model.word[which], sizeof model.word[which]);
    if (which)
        model.urgent_full = 1;
    else
        model.transmit_count++;
}

void register_write(volatile uint32_t *address, uint32_t value)
{
    unsigned at = model_index(address);
    if (bus.absent)
        return;
    if (at == M_SRR && (value & 1)) {
        model_reset();
    } else if (at == M_SRR) {
        if ((value & 2) && !model.enabled)
            model.joins_at = bus.bits + 11;
        if (!(value & 2))
            bus.tec = bus.rec = 0;
        model.enabled = value & 2;
    } else if (at == M_ICR) {
        model.interrupts &= ~value;
    } else if (at >= M_TX && at < M_HPB) {
        model_put(0, at - M_TX, value);
    } else if (at >= M_HPB && at < M_RX) {
        model_put(1, at - M_HPB, value);
    } else {
        bool filter = at >= M_AFMR1, setup = at >= M_MSR && at <= M_BTR;
        if ((setup && model.enabled) || (filter && (model.block[M_AFR] >> (at - M_AFMR1) / 2 & 1)) ||
            (at >= M_RX && at < M_AFR) || at == M_ECR || at == M_SR || at == M_ISR)
            bus.violations++;
        else
            model.block[at] = value;
    }
}

#endif
