/* A CAN bus in user space: `soft`. Nodes attach; a frame that one sends is delivered to all others, in the order in which
 * arbitration would let them through (lower identifier first), after the time that its stuffed bits take at the bit rate.
 * Time is simulated (it moves only when bus_run is called), so runs are deterministic and as fast as the machine.
 *
 * Faults (drop, duplicate, delay, corrupt, reorder) are injected between send and delivery from a seeded generator. */
#ifndef TROCAR_BUS_H
#define TROCAR_BUS_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"

enum { BUS_MAX_NODES = 8, BUS_QUEUE = 4096 };

struct bus; /* opaque */

struct bus_faults {
    double drop, duplicate, delay, corrupt, reorder; /* probabilities per frame, 0..1 */
    uint32_t delay_us;
    uint32_t id_from, id_to; /* only frames with an identifier in this range */
    uint64_t seed;
};

struct bus_statistics {
    uint64_t frames, bits, busy_us, dropped, duplicated, delayed, corrupted, reordered, overflowed;
};

typedef void bus_receiver(void *context, const struct can_frame_t *frame, uint64_t time_us);

struct bus *bus_create(uint32_t bit_rate); /* NULL without memory */
void bus_free(struct bus *bus);
/* Returns the node's number, or -1 when BUS_MAX_NODES are attached. */
int bus_attach(struct bus *bus, bus_receiver *receiver, void *context);
bool bus_send(struct bus *bus, int node, const struct can_frame_t *frame); /* false: queue full (counted) */
/* Deliver everything that the bus can carry up to `until_us`; receivers may send, which joins the arbitration. */
void bus_run(struct bus *bus, uint64_t until_us);
uint64_t bus_time_us(const struct bus *bus);
void bus_inject(struct bus *bus, const struct bus_faults *faults);
const struct bus_statistics *bus_statistics(const struct bus *bus);

/* A listener that sees every delivered frame with the time stamp of its end: for logs. */
void bus_listen(struct bus *bus, bus_receiver *listener, void *context);

#endif
