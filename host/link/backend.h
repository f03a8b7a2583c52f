/* One end of a CAN bus, whatever carries it. Its name says what:
 *
 *   socketcan:IF   an interface of the Linux kernel, for instance can0 or vcan0 (socketcan.h)
 *   slcan:TTY      an adapter on a serial line that speaks SLCAN; TTY@BAUD sets the line's speed (slcan.h)
 *   soft           a node of the simulated bus in this process (sim/bus.h): backend_soft; it has no name to open
 *
 * Nothing here sleeps, and nothing blocks longer than it was told to. What is lost is counted. When an interface goes down or
 * an adapter is unplugged, receive or send says so once, with STATUS_BUS_DOWN or STATUS_BUS_LOST; the backend stays usable:
 * go on calling, and frames pass again once it is back (backend_state, counters.downs). Everything else negative is final.
 *
 * One thread per backend. */
#ifndef TROCAR_BACKEND_H
#define TROCAR_BACKEND_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "can_frame.h"
#include "failure.h"

enum { BACKEND_MAX_FILTERS = 32, BACKEND_MAX_FRAMES = 4096 /* that a soft end holds for its reader */ };

/* Data and remote frames with (id & mask) == (filter's id & mask) are received. Of 11-bit identifiers only, unless the id has
 * CAN_EFF_FLAG of SocketCAN, 0x80000000. */
struct backend_filter {
    uint32_t id, mask;
};

struct backend_options {
    const struct backend_filter *filter; /* copied */
    size_t filters;                      /* 0: everything */
    bool own;                            /* socketcan: also what this end sends, once it is on the bus (received.own) */
    bool errors;                         /* also error frames (CAN_FLAG_ERROR); they are counted in any case */
    bool fd;                             /* also FD frames; only socketcan, STATUS_BUS_FRAME for the others */
    uint32_t bit_rate;                   /* slcan: one that SLCAN knows; 0: 1 Mbit/s. Others have theirs */
    uint32_t receive_bytes;              /* socketcan: of the kernel's buffer; 0: 4 MiB, about 5000 frames */
};

struct backend_received {
    struct can_frame_t frame;
    /* When it arrived, us since 1970 by the wall clock as in candump's logs (socketcan: the kernel's stamp; soft: the
     * simulated time). Never goes back: while the clock is set back, it stands still. */
    uint64_t time_us;
    bool own;
};

enum backend_state {
    BACKEND_UP,
    BACKEND_DOWN, /* the interface is there, but down */
    BACKEND_GONE  /* no interface of this name any more; the adapter was unplugged */
};

struct backend_counters {
    uint64_t received, sent; /* frames */
    uint64_t dropped;        /* that came while the receive buffer was full; SO_RXQ_OVFL where the kernel counts */
    uint64_t no_room;        /* sends that found no room in time: the frame was not sent */
    uint64_t waits;          /* times that a send had to wait for room */
    uint64_t malformed;      /* slcan: lines that are none of the protocol's; socketcan: impossible lengths */
    uint64_t refused;        /* slcan: frames that the adapter answered with a bell */
    uint64_t downs;          /* times that it went down or away */
    /* from error frames */
    uint64_t errors, warnings, passive, bus_off, restarted, no_acknowledge, arbitration_lost, overflows, timeouts;
};

struct backend;

/* STATUS_BUS_NAME (not one of the names above), STATUS_BUS_KERNEL, STATUS_BUS_INTERFACE, STATUS_BUS_PERMISSION, STATUS_BUS_DOWN,
 * STATUS_BUS_OPEN, STATUS_MEMORY; the message has the command that helps. `options` NULL: all of them 0. */
int backend_open(const char *name, const struct backend_options *options, struct backend **backend,
                 struct failure *why);

struct bus;
/* A node of the simulated bus, which may not be run any more once the backend is closed. */
int backend_soft(struct bus *bus, const struct backend_options *options, struct backend **backend, struct failure *why);

/* The oldest frame: 1. None within `wait_us`: 0 (0: does not wait; negative: waits for ever, or for a signal, then
 * 0). On the soft bus nothing is waited for: whoever runs the bus lets time pass. */
int backend_receive(struct backend *backend, struct backend_received *received, int64_t wait_us, struct failure *why);

/* Give a frame to the bus: 1. No room within `wait_us`: 0. STATUS_BUS_FRAME for what this backend cannot carry. */
int backend_send(struct backend *backend, const struct can_frame_t *frame, int64_t wait_us, struct failure *why);

/* To poll for POLLIN among other descriptors; -1 on the soft bus. It changes when an adapter comes back. */
int backend_descriptor(const struct backend *backend);
const char *backend_name(const struct backend *backend);
/* The interface as candump's logs name it: "vcan0", "ttyUSB0", "soft". */
const char *backend_interface(const struct backend *backend);
enum backend_state backend_state(const struct backend *backend);
const struct backend_counters *backend_counters(const struct backend *backend);
void backend_close(struct backend *backend); /* NULL is nothing */

#endif
