/* Where a tool that listens gets its frames: from a bus by its name (backend.h), or, for whoever has none, from a simulated
 * session on the bus `soft`: device, hand, controller and host of a bank, with every frame that is delivered. */
#ifndef TROCAR_FRAME_SOURCE_H
#define TROCAR_FRAME_SOURCE_H

#include <stdint.h>

#include "backend.h"
#include "bank.h"
#include "session.h"

struct frame_source_options {
    const char *bus;              /* NULL or "soft": a session */
    const struct bank_file *bank; /* of the session; must outlive the source. NULL with a bus of its own */
    struct session_options session;
    bool errors; /* also error frames of the bus */
};

struct frame_source;

/* What backend_open and session_create say; STATUS_USAGE when a session is wanted and there is no bank. */
int frame_source_open(const struct frame_source_options *options, struct frame_source **source, struct failure *why);

enum { FRAME_SOURCE_NONE = 0, FRAME_SOURCE_FRAME = 1, FRAME_SOURCE_END = 2 };
/* The next frame with its time, us (of a session: since its start). NONE when none came within `wait_us` (a session's tick
 * without frames), END when the session is over or interrupted; else a failure of the bus. A bus that went down is waited
 * for: it is told once (*why, STATUS_BUS_DOWN or STATUS_BUS_LOST), and the next call goes on. */
int frame_source_next(struct frame_source *source, struct backend_received *received, int64_t wait_us,
                      struct failure *why);

const char *frame_source_interface(const struct frame_source *source);                   /* as candump's logs name it */
const struct backend_counters *frame_source_counters(const struct frame_source *source); /* NULL of a session */
struct session *frame_source_session(struct frame_source *source);                       /* NULL of a bus */
void frame_source_close(struct frame_source *source);                                    /* NULL is nothing */

#endif
