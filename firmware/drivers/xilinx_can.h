/* The CAN controller of the Zynq UltraScale+ (classic CAN), by its registers. Source: AMD UG1085, chapter "CAN Controller",
 * and UG1087, module "CAN". No interrupts: the caller polls.
 *
 * Sending: the FIFO (64 frames) keeps the order; the high-priority buffer (one frame) overtakes it. Neither can be told
 * to drop a frame, and both keep theirs through bus-off and configuration mode; only a reset of the whole controller empties
 * them. So a frame in the high-priority buffer that still waits when the next one comes is taken back by a reset, and
 * bus-off is left by one: what is sent afterwards is never old.
 *
 * Receiving: up to 4 acceptance filters in front of a FIFO of 64 frames.
 *
 * After bus-off the controller is kept in configuration mode, silent, for the 128 x 11 bits that ISO 11898-1 asks for, then
 * started afresh; frames handed over meanwhile are refused. The same after a frame was taken back that could not be sent for
 * errors, as the reset has made the controller forget them: a node that disturbs the bus must not go on doing so. A frame that
 * only had to wait for others is replaced at once. */
#ifndef TROCAR_XILINX_CAN_H
#define TROCAR_XILINX_CAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "can_frame.h"

enum { XILINX_CAN_FIFO = 64, XILINX_CAN_FILTERS = 4 };

/* A frame as the controller has it: four words, all of which are to be read or written, in this order. */
struct xilinx_can_message {
    volatile uint32_t identifier, length, data[2];
};

struct xilinx_can_registers {
    volatile uint32_t software_reset;    /* SRR */
    volatile uint32_t mode;              /* MSR */
    volatile uint32_t prescaler;         /* BRPR */
    volatile uint32_t bit_timing;        /* BTR */
    volatile uint32_t error_counters;    /* ECR */
    volatile uint32_t error_status;      /* ESR */
    volatile uint32_t status;            /* SR */
    volatile uint32_t interrupts;        /* ISR */
    volatile uint32_t interrupt_enable;  /* IER */
    volatile uint32_t interrupt_clear;   /* ICR */
    volatile uint32_t timestamp_control; /* TCR */
    volatile uint32_t watermarks;        /* WIR */
    struct xilinx_can_message transmit;  /* TXFIFO */
    struct xilinx_can_message urgent;    /* TXHPB */
    struct xilinx_can_message receive;   /* RXFIFO */
    volatile uint32_t filter_enable;     /* AFR */
    struct {
        volatile uint32_t mask, identifier;
    } filter[XILINX_CAN_FILTERS]; /* AFMR, AFIR */
};
_Static_assert(offsetof(struct xilinx_can_registers, status) == 0x18, "SR");
_Static_assert(offsetof(struct xilinx_can_registers, interrupts) == 0x1C, "ISR");
_Static_assert(offsetof(struct xilinx_can_registers, transmit) == 0x30, "TXFIFO_ID");
_Static_assert(offsetof(struct xilinx_can_registers, urgent) == 0x40, "TXHPB_ID");
_Static_assert(offsetof(struct xilinx_can_registers, receive) == 0x50, "RXFIFO_ID");
_Static_assert(offsetof(struct xilinx_can_registers, filter_enable) == 0x60, "AFR");
_Static_assert(offsetof(struct xilinx_can_registers, filter) == 0x64, "AFMR1");
_Static_assert(sizeof(struct xilinx_can_registers) == 0x84, "AFIR4 is the last");

struct xilinx_can_filter { /* frames with 11-bit identifiers that agree with `id` in the bits of `mask` */
    uint32_t id, mask;
};

struct xilinx_can_settings {
    uint32_t clock_Hz, bit_rate; /* CAN_REF_CLK */
    uint32_t filters;            /* in use; 0: every frame is received */
    struct xilinx_can_filter filter[XILINX_CAN_FILTERS];
};

struct xilinx_can {
    struct xilinx_can_registers *registers;
    struct xilinx_can_settings settings;
    struct can_errors errors;
    uint32_t transmit_errors, receive_errors; /* the controller's own counters (ISO 11898-1), as last polled */
    bool passive;                             /* error-passive when last polled */
    bool off;                                 /* off the bus, silent until back_us */
    uint64_t time_us;                         /* of the last poll */
    uint64_t back_us;
};

/* Reset and configure, and join the bus. False when the bit rate cannot be made of the clock, or no controller answers. */
bool xilinx_can_start(struct xilinx_can *c, struct xilinx_can_registers *registers,
                      const struct xilinx_can_settings *settings);

/* Look after the controller: count what happened, leave the bus when it is off it, come back when it is time. At least
 * once per millisecond; what happens twice between two calls counts once. */
void xilinx_can_poll(struct xilinx_can *c, uint64_t time_us);

/* The oldest frame received, or false. */
bool xilinx_can_receive(struct xilinx_can *c, struct can_frame_t *frame);

/* Hand over a frame with at most 8 bytes. False: no room, or off the bus; the frame is dropped. */
bool xilinx_can_transmit(struct xilinx_can *c, const struct can_frame_t *frame);

/* The same by the high-priority buffer. One that still waits there is too old: the controller is reset, by which
 * everything not yet sent or received is lost, and counted as one in errors.aborted. If it met errors, this one is refused. */
bool xilinx_can_transmit_urgent(struct xilinx_can *c, const struct can_frame_t *frame);

#endif
