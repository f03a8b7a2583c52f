/* The local page that shows the organ deforming: HTTP and WebSocket on 127.0.0.1 (server.h), page and three.js built into
 * the program (assets.h). It sends the displaced surface 30 times per second of the run (message.h has every byte) and
 * takes keyboard and mouse for the hand (command.h).
 *
 * The field is reconstructed from the contacts that the link heard (field_from_contacts), so the page shows what the
 * controller said on the bus and nothing else. The hand belongs to the page that moved it last; when that page goes away,
 * the hand returns to its gesture. */
#ifndef TROCAR_VIEW_H
#define TROCAR_VIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "bank.h"
#include "failure.h"
#include "link.h"

enum { VIEW_RATE_HZ = 30, VIEW_DEFAULT_PORT = 8471 };

struct view;

struct view_input {  /* what the page asks for since the last poll */
    bool overridden; /* the hand follows `target_m` (trocar's frame, within the instrument's reach) */
    double target_m[3];
    bool acknowledge, stop, quit;
};

/* Listen on 127.0.0.1:port (0: any free port). The bank must outlive the view. */
int view_create(const struct bank_file *bank, uint16_t port, struct view **view, struct failure *why);
uint16_t view_port(const struct view *view);
/* Hand the newest state to the page, once per tick; a frame is queued when 1/30 s of the run went by. The field is computed
 * when a page takes the frame, so only while somebody looks. The target of the hand is in the trocar's frame. Never
 * blocks. */
void view_update(struct view *view, const struct link *link, double time_s, const double hand_target_m[3]);
/* Serve sockets for at most `wait_ms`. */
void view_serve(struct view *view, int wait_ms);
void view_input(struct view *view, struct view_input *input);
uint64_t view_frames_sent(const struct view *view);    /* over all clients */
uint64_t view_frames_dropped(const struct view *view); /* for clients that were slow */
uint64_t view_malformed(const struct view *view);      /* messages that were not understood */
unsigned view_clients(const struct view *view);
void view_free(struct view *view);

#endif
