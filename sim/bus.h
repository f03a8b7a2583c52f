/* A CAN bus in user space: `soft`. Nodes attach; a frame that one sends is delivered to all others, in the order in
 * which arbitration would let them through (lower identifier first), after the time that its stuffed bits take at the
 * bit rate. Time is simulated (it moves only when bus_run is called), so runs are deterministic and as fast as the
 * machine.
 *
 * A node's waiting frames go lowest identifier first and, for the same identifier, in the order sent; between nodes
 * that offer the same identifier the one attached first goes first. A frame on the bus is not interrupted. It is
 * delivered at the end of its intermission (framebits.h), 3 bits later than a real receiver has it. The receivers are
 * called in the order of their attachment, behind the listener.
 *
 * Faults are decided by faults.h when a frame has won arbitration, so all of them have used their time on the bus:
 *   drop       nobody receives it
 *   duplicate  it is sent once more, and arbitrates again (as after an error in the last bit of EOF, which some nodes
 * see) delay      it is delivered `delay_us` later than it should corrupt    it is delivered with one to three bits of
 * identifier or data flipped, as if CAN's CRC had passed it reorder    it is delivered behind the frame that follows
 * it, or after BUS_REORDER_US if none does */
#ifndef TROCAR_BUS_H
#define TROCAR_BUS_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"

enum {
    BUS_MAX_NODES = 8,
    BUS_QUEUE = 4096, /* frames that each node can have waiting, and that faults can hold back */
    BUS_REORDER_US = 1000
};

struct bus; /* opaque */

struct bus_faults {
    double drop, duplicate, delay, corrupt, reorder; /* probabilities per frame, 0..1 */
    uint32_t delay_us;
    uint32_t id_from, id_to; /* only frames with an identifier in this range */
    uint64_t seed;
};

struct bus_statistics {
    uint64_t frames, bits, busy_us; /* carried by the bus, dropped and duplicated ones included */
    uint64_t dropped, duplicated, delayed, corrupted, reordered;
    uint64_t overflowed; /* frames refused because a queue was full */
};

typedef void bus_receiver(void *context, const struct can_frame_t *frame, uint64_t time_us);

/* NULL without memory, or for a bit rate outside 10 kbit/s .. 1 Mbit/s. */
struct bus *bus_create(uint32_t bit_rate);
void bus_free(struct bus *bus);
/* Returns the node's number, or -1 when BUS_MAX_NODES are attached or there is no memory. */
int bus_attach(struct bus *bus, bus_receiver *receiver, void *context);
/* False: queue full (counted), or not a classic frame (FD, error, more than eight bytes, identifier too large). */
bool bus_send(struct bus *bus, int node, const struct can_frame_t *frame);
/* Deliver everything that the bus can carry up to `until_us`; receivers may send, which joins the arbitration. A
 * receiver must not call bus_run. */
void bus_run(struct bus *bus, uint64_t until_us);
void bus_inject(struct bus *bus, const struct bus_faults *faults); /* NULL: none from now on */
const struct bus_statistics *bus_statistics(const struct bus *bus);

/* A listener that sees every delivered frame with the time stamp of its end: for logs. NULL: none. */
void bus_listen(struct bus *bus, bus_receiver *listener, void *context);

#endif
