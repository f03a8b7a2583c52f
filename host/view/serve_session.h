/* A session and its page, tick by tick: the session's newest state goes to the page, and what the page asks for goes to
 * the session as a host's commands and a hand. Used by `trocar run --view` and `trocar view`. */
#ifndef TROCAR_SERVE_SESSION_H
#define TROCAR_SERVE_SESSION_H

#include <stdbool.h>

#include "session.h"
#include "view.h"

/* Listen on `port`, or when that is negative on VIEW_DEFAULT_PORT, or if that is taken on any free one. */
int serve_open(const struct bank_file *bank, int port, struct view **view, struct failure *why);

/* After each session_tick of a session in real time. False when the page asked to end the run. */
bool serve_session(struct session *session, struct view *view);

#endif
