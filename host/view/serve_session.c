#include "serve_session.h"

enum { NMT_START = 1, NMT_STOP = 2 };

int serve_open(const struct bank_file *bank, int port, struct view **view, struct failure *why)
{
    int status = view_create(bank, (uint16_t)(port < 0 ? VIEW_DEFAULT_PORT : port), view, why);
    if (status == STATUS_VIEW_PORT && port < 0)
        status = view_create(bank, 0, view, why);
    return status;
}

bool serve_session(struct session *session, struct view *view)
{
    double target_m[3];
    struct view_input input;
    hand_target(session_hand(session), session_gesture_time_s(session), target_m);
    view_update(view, session_link(session), session_time_s(session), target_m);
    view_serve(view, 0);
    view_input(view, &input);
    session_drive(session, input.overridden, input.target_m);
    if (input.acknowledge)
        session_command(session, NMT_START);
    if (input.stop)
        session_command(session, NMT_STOP);
    return !input.quit;
}
