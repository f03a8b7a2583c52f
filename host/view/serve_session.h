/* A session, or the host of a controller that is out there, and its page, tick by tick: the session's newest state goes to the page, and what the page asks for goes to
 * the session as a host's commands and a hand. Used by `trocar run --view` and `trocar view`. */
#ifndef TROCAR_SERVE_SESSION_H
#define TROCAR_SERVE_SESSION_H

#include <stdbool.h>

#include "remote.h"
#include "session.h"
#include "view.h"

/* Listen on `port`, or when that is negative on VIEW_DEFAULT_PORT, or if that is taken on any free one. */
int serve_open(const struct bank_file *bank, int port, struct view **view, struct failure *why);

/* After each session_tick of a session in real time. False when the page asked to end the run. */
bool serve_session(struct session *session, struct view *view);

/* The same after each remote_step: the page's hand has nothing to move there, start and stop go to the controller. 1 to go on, 0
 * when the page asked to end, STATUS_BUS_* of a command that could not be sent. */
int serve_remote(struct remote *remote, const struct bank_file *bank, struct view *view, struct failure *why);

#endif
