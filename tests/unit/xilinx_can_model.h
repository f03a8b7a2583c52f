/* The Zynq's CAN controller behind the registers of drivers/xilinx_can.h, as UG1085 and UG1087 describe it, on a bus that can be
 * spoiled. Written from the manual and ISO 11898-1, not from the driver: it knows the registers by their offsets alone.
 *
 * Time is counted in bits. model_run lets the controller send what waits; `spoilt` says what becomes of it:
 *
 *   BUS_GOOD      frames go through
 *   BUS_UNHEARD   nobody acknowledges: TEC rises by 8 until error-passive, and stays (ISO 11898-1, 12.1.4.2 c, exception 1)
 *   BUS_SHORTED   dominant bits read back as recessive: an error in the first bit; TEC rises by 8 up to bus-off
 *   BUS_BUSY      others always win the arbitration
 *
 * Bus-off and configuration mode keep the FIFOs; only a software reset empties them. In bus-off the controller comes back by
 * itself after 128 x 11 recessive bits. What a driver must not do (configuring outside of configuration mode, filters that
 * are in use, words of a message out of order, writing to a full buffer) counts in `violations`. */
#ifndef TROCAR_XILINX_CAN_MODEL_H
#define TROCAR_XILINX_CAN_MODEL_H

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define SIMULATED_REGISTERS
#include "drivers/registers.h"

enum model_bus { BUS_GOOD, BUS_UNHEARD, BUS_SHORTED, BUS_BUSY };

struct model_message {
    uint32_t word[4];
};

struct model {
    uint32_t block[33]; /* addresses; the values of the plain registers */
    bool absent;        /* nothing answers: reads are 0 */
    bool enabled, off;
    unsigned tec, rec, interrupts;
    struct model_message transmit[64], urgent, receive[64];
    unsigned transmit_count, urgent_full, receive_count;
    uint32_t word[2][4]; /* of the messages being written */
    unsigned written[2], taken;
    uint64_t bits, joins_at, back_at;
    enum model_bus spoilt;
    /* what happened, for the tests to compare with */
    unsigned violations, resets, overflows, passives, bus_offs, attempts;
    bool passive;
    struct model_message sent[4096];
    unsigned sent_count;
};

static struct model model;

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
    M_AFMR1,
    M_END = 33
};

static inline void model_states(void)
{
    bool passive = !model.off && (model.tec >= 128 || model.rec >= 128);
    model.passives += passive && !model.passive;
    model.passive = passive;
    if (model.tec > 255 && !model.off) {
        model.off = true;
        model.bus_offs++;
        model.interrupts |= 1u << 9;
        model.back_at = model.bits + 128 * 11;
    }
}

static inline bool model_normal(void)
{
    return model.enabled && !model.off && model.bits >= model.joins_at;
}

static inline void model_reset(void)
{
    model.resets++;
    memset(model.block, 0, sizeof model.block);
    model.enabled = model.off = model.passive = false;
    model.tec = model.rec = model.interrupts = 0;
    model.transmit_count = model.urgent_full = model.receive_count = 0;
    model.written[0] = model.written[1] = model.taken = 0;
}

static inline void model_power_on(void)
{
    memset(&model, 0, sizeof model);
    model_reset();
    model.resets = 0;
}

static inline unsigned model_index(const volatile uint32_t *address)
{
    size_t at = (size_t)(address - (volatile uint32_t *)model.block);
    if (at >= M_END)
        abort();
    return (unsigned)at;
}

static inline uint32_t model_status(void)
{
    uint32_t state = !model.enabled ? 0 : model.off ? 2 : model.passive ? 3 : 1;
    return (model.enabled ? 0 : 1u) | (model_normal() ? 1u << 3 : 0) | state << 7 | (model.urgent_full ? 1u << 9 : 0) |
           (model.transmit_count == 64 ? 1u << 10 : 0) | (model.tec >= 96 || model.rec >= 96 ? 1u << 6 : 0);
}

uint32_t register_read(const volatile uint32_t *address)
{
    unsigned at = model_index(address);
    if (model.absent)
        return 0;
    switch (at) {
    case M_SRR:
        return model.enabled ? 2 : 0;
    case M_ECR:
        return model.rec << 8 | (model.tec > 255 ? 255 : model.tec);
    case M_SR:
        return model_status();
    case M_ISR:
        return model.interrupts | (model.receive_count ? 1u << 7 : 0);
    case M_RX:
    case M_RX + 1:
    case M_RX + 2:
    case M_RX + 3: {
        if (model.receive_count == 0 || at - M_RX != model.taken) {
            model.violations++;
            return 0xDEADBEEF;
        }
        uint32_t word = model.receive[0].word[model.taken++];
        if (model.taken == 4) {
            memmove(model.receive, model.receive + 1, --model.receive_count * sizeof model.receive[0]);
            model.taken = 0;
        }
        return word;
    }
    default:
        if (at >= M_TX && at < M_RX)
            model.violations++; /* write only */
        return model.block[at];
    }
}

/* A word into a message buffer: 0 the FIFO, 1 the high-priority buffer. */
static inline void model_put(unsigned which, unsigned word, uint32_t value)
{
    bool full = which ? model.urgent_full : model.transmit_count == 64;
    if (full || word != model.written[which]) {
        model.violations++;
        return;
    }
    model.word[which][word] = value;
    model.written[which] = (word + 1) % 4;
    if (word < 3)
        return;
    memcpy(which ? model.urgent.word : model.transmit[model.transmit_count].word, model.word[which],
           sizeof model.word[which]);
    if (which)
        model.urgent_full = 1;
    else
        model.transmit_count++;
}

void register_write(volatile uint32_t *address, uint32_t value)
{
    unsigned at = model_index(address);
    if (model.absent)
        return;
    if (at == M_SRR && (value & 1)) {
        model_reset();
    } else if (at == M_SRR) {
        if ((value & 2) && !model.enabled)
            model.joins_at = model.bits + 11;
        if (!(value & 2))
            model.tec = model.rec = 0;
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
            model.violations++;
        else
            model.block[at] = value;
    }
}

/* A message of somebody else's on the bus. */
static inline void model_hear(struct model_message m)
{
    if (!model_normal() || model.spoilt == BUS_UNHEARD || model.spoilt == BUS_SHORTED)
        return;
    bool pass = model.block[M_AFR] == 0;
    for (unsigned f = 0; f < 4; f++) {
        uint32_t mask = model.block[M_AFMR1 + 2 * f], id = model.block[M_AFMR1 + 2 * f + 1];
        pass |= (model.block[M_AFR] >> f & 1) && (m.word[0] & mask) == (id & mask);
    }
    model.rec -= model.rec > 0;
    model_states();
    if (!pass)
        return;
    if (model.receive_count == 64) {
        model.overflows++;
        model.interrupts |= 1u << 6;
        return;
    }
    m.word[1] |= (uint32_t)model.bits & 0xFFFF; /* time stamp */
    model.receive[model.receive_count++] = m;
    model.interrupts |= 1u << 4;
}

/* A message of somebody else's that this controller, and it alone, sees as damaged. */
static inline void model_mishear(void)
{
    if (model_normal() && model.rec < 255)
        model.rec += 8;
    model_states();
}

/* Let so many bits pass. */
static inline void model_run(unsigned bits)
{
    uint64_t end = model.bits + bits;
    while (model.bits < end) {
        if (model.off && model.bits >= model.back_at) {
            model.off = false;
            model.tec = model.rec = 0;
        }
        bool waits = model.urgent_full || model.transmit_count;
        if (!model_normal() || !waits || model.spoilt == BUS_BUSY) {
            model.bits++;
            continue;
        }
        struct model_message *m = model.urgent_full ? &model.urgent : &model.transmit[0];
        unsigned frame = 55 + 10 * (m->word[1] >> 28); /* with stuffing, at most */
        model.attempts++;
        if (model.spoilt == BUS_GOOD) {
            model.bits += frame;
            if (model.sent_count < sizeof model.sent / sizeof model.sent[0])
                model.sent[model.sent_count++] = *m;
            if (model.urgent_full)
                model.urgent_full = 0;
            else
                memmove(model.transmit, model.transmit + 1, --model.transmit_count * sizeof model.transmit[0]);
            model.interrupts |= 1u << 1;
            model.tec -= model.tec > 0;
        } else if (model.spoilt == BUS_UNHEARD) {
            model.bits += frame + 20; /* and an error frame */
            model.tec += model.tec < 128 ? 8 : 0;
        } else {
            model.bits += 1 + 20 + (model.passive ? 8 : 0); /* suspended transmission */
            model.tec += 8;
        }
        model_states();
    }
}

#endif
