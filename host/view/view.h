/* The local page that shows the organ deforming: HTTP and WebSocket on 127.0.0.1 through libwebsockets, page and three.js
 * built into the program. It sends the displaced surface 30 times a second and takes keyboard and mouse for the hand. */
#ifndef TROCAR_VIEW_H
#define TROCAR_VIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "bank.h"
#include "failure.h"
#include "link.h"

struct view;

struct view_input {            /* what the page asks for since the last poll */
    bool overridden;           /* the hand follows `target_m` (trocar's frame) */
    double target_m[3];
    bool acknowledge, stop, quit;
};

/* Listen on 127.0.0.1:port (0: any free port). */
int view_create(const struct bank_file *bank, uint16_t port, struct view **view, struct failure *why);
uint16_t view_port(const struct view *view);
/* Hand the newest state to the page; reconstructs the field and queues a frame when 1/30 s of wall time went by.
 * tip and target in the trocar's frame tell the page where the hand is. Never blocks. */
void view_update(struct view *view, const struct link *link, double time_s, const double hand_target_m[3]);
/* Serve sockets for at most `wait_ms`. */
void view_serve(struct view *view, int wait_ms);
void view_input(struct view *view, struct view_input *input);
uint64_t view_frames_sent(const struct view *view);
unsigned view_clients(const struct view *view);
void view_free(struct view *view);

#endif
