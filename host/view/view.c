#include "view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "message.h"
#include "server.h"
#include "shown_field.h"

struct view {
    const struct bank_file *bank;
    struct server *server;
    struct message hello, frame;
    double *u; /* 3 per vertex, m */

    struct link link[BANK_MAX_INSTRUMENTS]; /* of the newest update */
    struct message_state state;
    bool swings;
    float amplitude[BANK_MAX_MODES];
    bool encoded;                             /* `frame` is of `state.number` */
    bool trace_taken;                         /* the traces' points are in an encoded frame */
    double due_s;                             /* time of the run at which the next frame is due */
    uint64_t traced_us[BANK_MAX_INSTRUMENTS]; /* pose that the trace ends with */

    uint64_t malformed, owner[BANK_MAX_INSTRUMENTS]; /* `owner`: client that holds the hand, 0 none */
    struct view_input input;
};

static const struct message *greeting(void *context)
{
    struct view *view = context;
    return &view->hello;
}

/* Where the held points are: at their place on the surface as it is shown. */
static void displace_held(const struct bank_view *bank, const double *u, struct message_instrument *i)
{
    for (size_t h = 0; h < i->held_count; h++) {
        struct link_contact *at = &i->held[h];
        const uint16_t *vertex = bank->triangles[at->triangle].vertex;
        const double weight[3] = {1 - at->weights[0] - at->weights[1], at->weights[0], at->weights[1]};
        for (size_t a = 0; a < 3; a++) {
            at->displacement_m[a] = 0;
            for (size_t k = 0; k < 3; k++)
                at->displacement_m[a] += weight[k] * u[3 * vertex[k] + a];
        }
    }
}

static const struct message *newest(void *context, uint64_t *number)
{
    struct view *view = context;
    if (view->state.number == 0)
        return NULL;
    if (!view->encoded) {
        struct failure why, field = {0};
        const struct bank_view *bank = &view->bank->view;
        int status = shown_field(bank, view->link, view->state.instruments, view->swings ? view->amplitude : NULL,
                                 view->u, &field);
        for (uint32_t i = 0; i < view->state.instruments; i++)
            displace_held(bank, view->u, &view->state.instrument[i]);
        view->state.field_error = status < 0 ? field.cause : "";
        view->state.clients = server_clients(view->server);
        view->state.dropped = server_dropped(view->server);
        view->state.malformed = view->malformed;
        if (message_frame(&view->frame, bank, &view->state, view->u, &why) < 0)
            return NULL;
        view->encoded = view->trace_taken = true;
    }
    *number = view->state.number;
    return &view->frame;
}

/* The nearest target that the instrument reaches: insertion and both angles within their ranges. */
static void clamp_to_reach(const struct bank_tool *tool, double target_m[3])
{
    double length = sqrt(target_m[0] * target_m[0] + target_m[1] * target_m[1] + target_m[2] * target_m[2]);
    double insertion = fmin(fmax(length, (double)tool->axis[2].minimum), (double)tool->axis[2].maximum);
    double share[2] = {0, 0}; /* of the direction, along the frame's x and y */
    for (int a = 0; a < 2; a++) {
        if (length > 0)
            share[a] = target_m[a] / length;
        share[a] = fmin(fmax(share[a], sin((double)tool->axis[a].minimum)), sin((double)tool->axis[a].maximum));
    }
    double across = hypot(share[0], share[1]);
    if (across > 0.95) { /* the pose is singular at 1 */
        share[0] *= 0.95 / across;
        share[1] *= 0.95 / across;
        across = 0.95;
    }
    target_m[0] = insertion * share[0];
    target_m[1] = insertion * share[1];
    target_m[2] = insertion * sqrt(1 - across * across);
}

static void received(void *context, uint64_t client, const char *text, size_t length)
{
    struct view *view = context;
    struct command command;
    if (!text || !command_parse(text, length, &command)) {
        view->malformed++;
        return;
    }
    const uint32_t i = command.instrument;
    struct view_hand *hand = &view->input.hand[i];
    if (i >= view->bank->view.tool_count) {
        view->malformed++;
        return;
    }
    switch (command.kind) {
    case COMMAND_HAND:
        view->owner[i] = client;
        hand->overridden = true;
        memcpy(hand->target_m, command.target_m, sizeof command.target_m);
        clamp_to_reach(&view->bank->view.tools[i], hand->target_m);
        break;
    case COMMAND_RELEASE:
        view->owner[i] = 0;
        hand->overridden = false;
        break;
    case COMMAND_ACKNOWLEDGE:
        view->input.acknowledge = true;
        break;
    case COMMAND_STOP:
        view->input.stop = true;
        break;
    case COMMAND_QUIT:
        view->input.quit = true;
        break;
    }
}

static void gone(void *context, uint64_t client)
{
    struct view *view = context;
    for (int i = 0; i < BANK_MAX_INSTRUMENTS; i++)
        if (view->owner[i] == client) {
            view->owner[i] = 0;
            view->input.hand[i].overridden = false;
        }
}

/* The page's greeting, with the scene's names where the bank tells them. */
static int greet(struct view *view, struct failure *why)
{
    struct scene *scene = bank_scene(view->bank);
    const char *names[BANK_MAX_INSTRUMENTS];
    for (size_t i = 0; i < BANK_MAX_INSTRUMENTS; i++)
        names[i] = scene && i < scene->instrument_count ? scene->instrument[i].name : "";
    int status = message_hello(&view->hello, &view->bank->view, scene ? scene->name : "", names, why);
    free(scene);
    return status;
}

int view_create(const struct bank_file *bank, uint16_t port, struct view **out, struct failure *why)
{
    struct view *view = calloc(1, sizeof *view);
    int status = STATUS_OK;
    if (view)
        view->u = calloc(3 * (size_t)bank->view.vertex_count, sizeof(double));
    if (!view || !view->u)
        status = failure_set(why, STATUS_MEMORY, "view", "", "no memory for %u vertices", bank->view.vertex_count);
    if (status >= 0) {
        view->bank = bank;
        status = greet(view, why);
    }
    if (status >= 0) {
        const struct server_events events = {view, greeting, newest, received, gone};
        status = server_create(port, &events, &view->server, why);
    }
    if (status < 0) {
        view_free(view);
        return status;
    }
    *out = view;
    return STATUS_OK;
}

uint16_t view_port(const struct view *view)
{
    return server_port(view->server);
}

/* Poses arrive at 50 or 100 Hz, frames leave at 30: the trace keeps every pose, so that a short poke is not lost between. */
static void trace_force(struct view *view, uint32_t number, const struct link *link)
{
    struct message_instrument *i = &view->state.instrument[number];
    if (link->pose_time_us == view->traced_us[number])
        return;
    view->traced_us[number] = link->pose_time_us;
    if (i->trace_count == MESSAGE_MAX_TRACE)
        i->trace_count = 0;
    const double *f = link->force_N;
    i->trace_time_s[i->trace_count] = 1e-6 * (double)link->pose_time_us;
    i->trace_force_N[i->trace_count++] = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
}

/* What only the controller's state tells. */
static void look_inside(struct view *view, const struct controller *c)
{
    const struct bank_view *bank = &view->bank->view;
    view->swings = c && bank->swing;
    if (view->swings)
        memcpy(view->amplitude, c->swing.amplitude, sizeof view->amplitude);
    for (uint32_t i = 0; i < BANK_MAX_INSTRUMENTS; i++)
        view->state.instrument[i].held_count = 0;
    for (uint32_t p = 0; c && bank->grasp && p < CONTACT_MAX; p++) {
        const struct grasp_point *point = &c->grasp.point[p];
        if (!point->held)
            continue;
        struct message_instrument *i = &view->state.instrument[p >= bank->tools[0].point_count];
        i->held[i->held_count++] = (struct link_contact){
            .triangle = point->triangle, .weights = {(double)point->weights[1], (double)point->weights[2]}};
    }
}

void view_update(struct view *view, const struct view_now *now)
{
    struct message_state *state = &view->state;
    for (uint32_t i = 0; i < now->instruments && view->trace_taken; i++)
        state->instrument[i].trace_count = 0;
    view->trace_taken = false;
    for (uint32_t i = 0; i < now->instruments; i++)
        trace_force(view, i, now->link[i]);
    if (now->time_s + 1e-9 < view->due_s)
        return;
    view->due_s = fmax(view->due_s, now->time_s - 1.0 / VIEW_RATE_HZ) + 1.0 / VIEW_RATE_HZ;

    state->number++;
    state->time_s = now->time_s;
    state->instruments = now->instruments;
    for (uint32_t i = 0; i < now->instruments; i++) {
        struct message_instrument *to = &state->instrument[i];
        view->link[i] = *now->link[i];
        to->link = &view->link[i];
        to->driven = view->input.hand[i].overridden;
        memcpy(to->hand_target_m, now->hand_target_m[i], sizeof to->hand_target_m);
    }
    look_inside(view, now->controller);
    view->encoded = false;
    server_notify(view->server);
}

void view_serve(struct view *view, int wait_ms)
{
    server_serve(view->server, wait_ms);
}

void view_input(struct view *view, struct view_input *input)
{
    *input = view->input;
    view->input.acknowledge = view->input.stop = view->input.quit = false;
}

uint64_t view_frames_sent(const struct view *view)
{
    return server_sent(view->server);
}

uint64_t view_frames_dropped(const struct view *view)
{
    return server_dropped(view->server);
}

uint64_t view_malformed(const struct view *view)
{
    return view->malformed;
}

unsigned view_clients(const struct view *view)
{
    return server_clients(view->server);
}

void view_free(struct view *view)
{
    if (!view)
        return;
    server_free(view->server);
    message_free(&view->hello);
    message_free(&view->frame);
    free(view->u);
    free(view);
}
