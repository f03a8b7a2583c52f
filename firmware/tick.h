/* The tick: from the encoder samples of one instrument, or of two, to their torque commands, once per millisecond. Freestanding, single precision, no
 * allocation, no recursion; one state struct; every loop's bound stands beside it.
 *
 * Frames of reference: "world" is the body's rest frame, m. Contact and tip forces are exerted by the tissue on the tool. */
#ifndef TROCAR_TICK_H
#define TROCAR_TICK_H

#include <stdbool.h>
#include <stdint.h>

#include "bank_view.h"
#include "collide.h"
#include "row_cache.h"
#include "contact.h"
#include "coupling.h"
#include "effects/effects.h"
#include "kinematics.h"
#include "safety.h"

enum {
    FIRMWARE_ABI = 1,
    TICK_RATE_HZ = 1000,
    TICK_INSTRUMENTS = CONTACT_TOOLS /* that this image serves: one, or two with the effect second */
};

struct tick_input {
    bool fresh;          /* an encoder sample arrived for this tick */
    uint8_t sequence;    /* 4 bits, of that sample */
    uint16_t counts[3];  /* alpha, beta, insertion */
    uint16_t roll, grip; /* raw counts; for effects */
    bool acknowledge;    /* the host asks to go on: READY -> RUN, SAFE -> READY */
    bool stop;           /* the host asks for SAFE */
    bool overrun;        /* the port saw the last tick end late */
};

struct tick_output {
    float torque[3]; /* N m, N m, N: what the motors are told; 0 unless `enable` */
    bool enable;
    uint8_t sequence; /* of the sample that this answers */
};

/* What each instrument has of its own. */
struct instrument {
    bool present;                 /* its pose is known: it takes part in the contact */
    struct safety safety;         /* state, counters, reasons */
    struct kinematics kinematics; /* joint angles, pose, Jacobian */
    struct coupling coupling;     /* tip force after limits, passivity energy */
};

/* All that a controller remembers; the only mutable state of the firmware. */
struct controller {
    uint32_t tick_count;
    IF_SECOND(uint32_t instrument_count;) /* TOOL records of the bank */
    struct instrument instrument[TICK_INSTRUMENTS];
    struct collide collide;     /* per tool point: last position, contact anchor */
    struct row_cache rows;      /* rows of the bank that are in use, in the memory given at start */
    struct contact_set contact; /* system, active set, forces of this tick */
                                /* and what the effects of this image remember: */
    IF_CONE(struct cone cone;)  /* friction and grasping */
#define EFFECT(bit, NAME, name, tag, parts, what) IF_##NAME(struct name name;)
#include "effects.def"
#undef EFFECT
};

/* `memory`: row_cache_memory(bank) bytes or more for rows, aligned to 4, kept by the caller; NULL with a plain bank.
 * STATUS_OK, or STATUS_BANK_MEMORY when they are fewer. */
int controller_start(struct controller *c, const struct bank_view *bank, void *memory, size_t bytes);

/* One input and one output per instrument. */
void tick(struct controller *c, const struct bank_view *bank, const struct tick_input in[TICK_INSTRUMENTS],
          struct tick_output out[TICK_INSTRUMENTS]);

/* How many instruments it serves; a constant in an image for one. */
static inline uint32_t tick_instruments(const struct controller *c)
{
    uint32_t count = 1;
    (void)c;
    IF_SECOND(count = c->instrument_count;)
    return count;
}

#endif
