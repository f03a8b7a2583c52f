/* The local page that shows the organ deforming: HTTP and WebSocket on 127.0.0.1 (server.h), page and three.js built into
 * the program (assets.h). It sends the displaced surface 30 times per second of the run (message.h has every byte) and
 * takes keyboard and mouse for the hands (command.h).
 *
 * The field is reconstructed from the contacts that the links heard (shown_field.h), so the page shows what the
 * controller said on the bus. What no frame carries, which points the jaws hold and how the organ swings, is read from the
 * controller's state where it is at hand. A hand belongs to the page that moved it last; when that page goes away,
 * the hand returns to its gesture. */
#ifndef TROCAR_VIEW_H
#define TROCAR_VIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "bank.h"
#include "failure.h"
#include "link.h"
#include "tick.h"

enum { VIEW_RATE_HZ = 30, VIEW_DEFAULT_PORT = 8471 };

struct view;

/* What is shown, of `instruments` instruments of the bank from its first. */
struct view_now {
    double time_s;
    uint32_t instruments;
    const struct link *link[BANK_MAX_INSTRUMENTS];
    double hand_target_m[BANK_MAX_INSTRUMENTS][3]; /* trocar's frame */
    const struct controller *controller;           /* a session's or a mirror's; NULL: not at hand */
};

struct view_hand {
    bool overridden; /* it follows `target_m` (trocar's frame, within the instrument's reach) */
    double target_m[3];
};

struct view_input { /* what the page asks for since the last poll */
    struct view_hand hand[BANK_MAX_INSTRUMENTS];
    bool acknowledge, stop, quit;
};

/* Listen on 127.0.0.1:port (0: any free port). The bank must outlive the view. */
int view_create(const struct bank_file *bank, uint16_t port, struct view **view, struct failure *why);
uint16_t view_port(const struct view *view);
/* Hand the newest state to the page, once per tick; a frame is queued when 1/30 s of the run went by. The field is computed
 * when a page takes the frame, so only while somebody looks. Never blocks. */
void view_update(struct view *view, const struct view_now *now);
/* Serve sockets for at most `wait_ms`. */
void view_serve(struct view *view, int wait_ms);
void view_input(struct view *view, struct view_input *input);
uint64_t view_frames_sent(const struct view *view);    /* over all clients */
uint64_t view_frames_dropped(const struct view *view); /* for clients that were slow */
uint64_t view_malformed(const struct view *view);      /* messages that were not understood */
unsigned view_clients(const struct view *view);
void view_free(struct view *view);

#endif
