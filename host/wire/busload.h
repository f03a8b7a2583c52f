/* How much of the bus each frame of the protocol can take: every frame of wire.dbc at the rate at which a scene's
 * instruments send it (firmware/telemetry.h), as long as stuffing can make it, in classic and in FD format.
 *
 * Sync, Encoders and Torques come with every tick. Contacts come at every turn of theirs while a set has at least
 * set / (2 contact) of them, else in sets: the largest set that an instrument with so many points can have counts. What comes
 * only on an event (Nmt, Emergency) has rate 0. */
#ifndef TROCAR_BUSLOAD_H
#define TROCAR_BUSLOAD_H

#include "dbc.h"
#include "framebits_fd.h"

struct busload_use {
    unsigned instruments; /* 1 or 2 on the bus */
    unsigned points[2];   /* of each instrument's tool */
    double bit_rate;      /* bit/s */
    double data_rate;     /* of FD frames behind the bit-rate switch */
};

struct busload_row {
    const struct dbc_message *message; /* of the dbc given, which must outlive this */
    double per_second;                 /* frames, of all senders; 0: on an event */
    unsigned bits;                     /* of one frame at most, classic */
    struct framebits_fd fd_bits;
    double share, fd_share; /* of the bus, 0..1 */
};

struct busload {
    size_t count;
    struct busload_row row[DBC_MAX_MESSAGES];
    double share, fd_share;
    double
        worst_tick_us; /* bus time of the fullest tick: SYNC, all encoders and torques, a pair of telemetry; classic */
};

/* STATUS_BUS_DBC for a message whose rate is not known here. */
int busload(const struct dbc *dbc, const struct busload_use *use, struct busload *load, struct failure *why);

#endif
