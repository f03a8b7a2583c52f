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
    struct view_input input;
    struct view_now now = {.time_s = session_time_s(session),
                           .instruments = session_instruments(session),
                           .controller = &session_node(session)->controller};
    for (uint32_t t = 0; t < now.instruments; t++) {
        now.link[t] = session_link(session, t);
        hand_target(session_hand(session, t), session_gesture_time_s(session), now.hand_target_m[t]);
    }
    view_update(view, &now);
    view_serve(view, 0);
    view_input(view, &input);
    for (uint32_t t = 0; t < now.instruments; t++)
        session_drive(session, t, input.hand[t].overridden, input.hand[t].target_m);
    if (input.acknowledge)
        session_command(session, NMT_START);
    if (input.stop)
        session_command(session, NMT_STOP);
    return !input.quit;
}

/* Where the tip is, in the trocar's frame: the page shows a hand that is where the instrument is. */
static void tip_in_trocar(const struct bank_tool *tool, const double tip_m[3], double out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = 0;
        for (int j = 0; j < 3; j++)
            out[i] += (double)tool->rotation[3 * j + i] * (tip_m[j] - (double)tool->trocar_m[j]);
    }
}

int serve_remote(struct remote *remote, const struct bank_file *bank, struct view *view, struct failure *why)
{
    struct view_input input;
    const struct mirror *mirror = remote->options.mirror;
    struct view_now now = {.time_s = 1e-3 * (double)remote->ticks,
                           .controller = remote->mirrored ? &mirror->node.controller : NULL};
    for (uint32_t t = 0; t < remote->instruments && t < bank->view.tool_count; t++) {
        now.link[now.instruments++] = &remote->instrument[t].link;
        tip_in_trocar(&bank->view.tools[t], remote->instrument[t].link.tip_m, now.hand_target_m[t]);
    }
    view_update(view, &now);
    view_serve(view, 0);
    view_input(view, &input);
    int status = input.acknowledge ? remote_command(remote, NMT_START, why) : STATUS_OK;
    if (!status && input.stop)
        status = remote_command(remote, NMT_STOP, why);
    return status < 0 ? status : !input.quit;
}
