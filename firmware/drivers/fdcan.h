/* ST's FDCAN controller (Bosch M_CAN with a message RAM that software lays out) as the STM32H7 has it, used for classic CAN.
 * Source: ST RM0433, chapter "FD controller area network (FDCAN)"; Bosch, M_CAN User's Manual 3.2. No interrupts: the caller
 * polls.
 *
 * The message RAM is laid out here: filters, a receive FIFO of 32 frames, 32 dedicated transmit buffers. Of what waits, the frame
 * with the lowest identifier goes next, of equal ones that in the lower buffer: so a torque overtakes telemetry, and frames with
 * one identifier keep their order.
 *
 * Frames in dedicated buffers can be taken back, those of the transmit FIFO cannot; so it is not used. One that is on the bus
 * at that moment is sent or fails once; the next urgent one meanwhile takes another buffer.
 *
 * Bus-off: the controller has set CCCR.INIT. CCCR.CCE empties its FIFOs and buffers, clearing INIT starts the 129 x 11 recessive
 * bits after which it is back. Until then frames handed over are refused, so what is sent afterwards is never old. */
#ifndef TROCAR_FDCAN_H
#define TROCAR_FDCAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "can_frame.h"

enum { FDCAN_RECEIVE = 32, FDCAN_URGENT = 2, FDCAN_TRANSMIT = 30, FDCAN_FILTERS = 4 };

/* Of the registers, those that are used. */
struct fdcan_registers {
    volatile uint32_t reserved0[6];
    volatile uint32_t control;    /* CCCR */
    volatile uint32_t bit_timing; /* NBTP */
    volatile uint32_t reserved1[8];
    volatile uint32_t error_counters;  /* ECR */
    volatile uint32_t protocol_status; /* PSR */
    volatile uint32_t reserved2[2];
    volatile uint32_t interrupts;       /* IR: a flag is cleared by writing 1 */
    volatile uint32_t interrupt_enable; /* IE */
    volatile uint32_t reserved3[10];
    volatile uint32_t global_filter;    /* GFC */
    volatile uint32_t standard_filters; /* SIDFC */
    volatile uint32_t extended_filters; /* XIDFC */
    volatile uint32_t reserved4[5];
    volatile uint32_t receive_setup;       /* RXF0C */
    volatile uint32_t receive_status;      /* RXF0S */
    volatile uint32_t receive_acknowledge; /* RXF0A */
    volatile uint32_t receive_buffers;     /* RXBC */
    volatile uint32_t receive1_setup;      /* RXF1C */
    volatile uint32_t reserved5[2];
    volatile uint32_t receive_size;   /* RXESC */
    volatile uint32_t transmit_setup; /* TXBC */
    volatile uint32_t reserved6;
    volatile uint32_t transmit_size; /* TXESC */
    volatile uint32_t pending;       /* TXBRP */
    volatile uint32_t request;       /* TXBAR */
    volatile uint32_t cancel;        /* TXBCR */
    volatile uint32_t sent;          /* TXBTO */
    volatile uint32_t cancelled;     /* TXBCF */
    volatile uint32_t reserved7[4];
    volatile uint32_t event_setup; /* TXEFC */
};
_Static_assert(offsetof(struct fdcan_registers, control) == 0x18, "CCCR");
_Static_assert(offsetof(struct fdcan_registers, bit_timing) == 0x1C, "NBTP");
_Static_assert(offsetof(struct fdcan_registers, error_counters) == 0x40, "ECR");
_Static_assert(offsetof(struct fdcan_registers, protocol_status) == 0x44, "PSR");
_Static_assert(offsetof(struct fdcan_registers, interrupts) == 0x50, "IR");
_Static_assert(offsetof(struct fdcan_registers, global_filter) == 0x80, "GFC");
_Static_assert(offsetof(struct fdcan_registers, standard_filters) == 0x84, "SIDFC");
_Static_assert(offsetof(struct fdcan_registers, extended_filters) == 0x88, "XIDFC");
_Static_assert(offsetof(struct fdcan_registers, receive_setup) == 0xA0, "RXF0C");
_Static_assert(offsetof(struct fdcan_registers, receive_status) == 0xA4, "RXF0S");
_Static_assert(offsetof(struct fdcan_registers, receive_acknowledge) == 0xA8, "RXF0A");
_Static_assert(offsetof(struct fdcan_registers, receive_buffers) == 0xAC, "RXBC");
_Static_assert(offsetof(struct fdcan_registers, receive1_setup) == 0xB0, "RXF1C");
_Static_assert(offsetof(struct fdcan_registers, receive_size) == 0xBC, "RXESC");
_Static_assert(offsetof(struct fdcan_registers, transmit_setup) == 0xC0, "TXBC");
_Static_assert(offsetof(struct fdcan_registers, transmit_size) == 0xC8, "TXESC");
_Static_assert(offsetof(struct fdcan_registers, pending) == 0xCC, "TXBRP");
_Static_assert(offsetof(struct fdcan_registers, cancelled) == 0xDC, "TXBCF");
_Static_assert(offsetof(struct fdcan_registers, event_setup) == 0xF0, "TXEFC");

/* A frame in the message RAM, with room for 8 bytes. */
struct fdcan_message {
    volatile uint32_t identifier, length, data[2];
};

/* The message RAM from the controller's first word of it on. */
struct fdcan_memory {
    volatile uint32_t filter[FDCAN_FILTERS]; /* of 11-bit identifiers */
    struct fdcan_message receive[FDCAN_RECEIVE];
    struct fdcan_message transmit[FDCAN_URGENT + FDCAN_TRANSMIT];
};
_Static_assert(sizeof(struct fdcan_memory) <= 2560 * 4, "the message RAM has 2560 words");

struct fdcan_filter { /* frames with 11-bit identifiers that agree with `id` in the bits of `mask` */
    uint32_t id, mask;
};

struct fdcan_settings {
    uint32_t clock_Hz, bit_rate; /* fdcan_tq_ck */
    uint32_t memory_word;        /* where `memory` begins, in words from the start of the message RAM */
    uint32_t filters;            /* in use; 0: every frame is received */
    struct fdcan_filter filter[FDCAN_FILTERS];
};

struct fdcan {
    struct fdcan_registers *registers;
    struct fdcan_memory *memory;
    struct can_errors errors;
    uint32_t next;                            /* buffer for the next frame that is not urgent */
    uint32_t transmit_errors, receive_errors; /* the controller's own counters (ISO 11898-1), as last polled */
    bool passive;                             /* error-passive when last polled */
    bool off;                                 /* bus-off, not yet back */
};

/* Configure, and join the bus. The controller's clock runs. False when the bit rate cannot be made of the clock, or no
 * controller answers. */
bool fdcan_start(struct fdcan *c, struct fdcan_registers *registers, struct fdcan_memory *memory,
                 const struct fdcan_settings *settings);

/* Look after the controller: count what happened, begin the way back from bus-off. At least once per millisecond; what
 * happens twice between two calls counts once. */
void fdcan_poll(struct fdcan *c);

/* A frame has been received and not yet taken. */
bool fdcan_waiting(struct fdcan *c);

/* The oldest frame received, or false. */
bool fdcan_receive(struct fdcan *c, struct can_frame_t *frame);

/* Hand over a frame with at most 8 bytes. False: no room, or off the bus; the frame is dropped. */
bool fdcan_transmit(struct fdcan *c, const struct can_frame_t *frame);

/* The same for a frame that begins what is sent in a tick. What still waits from before is too old: it is taken back, and
 * counted in errors.aborted. */
bool fdcan_transmit_urgent(struct fdcan *c, const struct can_frame_t *frame);

#endif
