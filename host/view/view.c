#include "view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "message.h"
#include "server.h"

struct view {
    const struct bank_file *bank;
    struct server *server;
    struct message hello, frame;
    double *u; /* 3 per vertex, m */

    struct link link; /* of the newest update */
    struct message_state state;
    bool encoded;       /* `frame` is of `state.number` */
    bool trace_taken;   /* the trace's points are in an encoded frame */
    double due_s;       /* time of the run at which the next frame is due */
    uint64_t traced_us; /* pose that the trace ends with */

    uint64_t malformed, owner; /* `owner`: client that holds the hand, 0 none */
    struct view_input input;
    struct failure field;
};

static const struct message *greeting(void *context)
{
    struct view *view = context;
    return &view->hello;
}

/* Contacts whose triangle this bank does not have came from a controller with another bank: they are left out. */
static void compute_field(struct view *view)
{
    const struct bank_view *bank = &view->bank->view;
    uint32_t triangle[LINK_MAX_CONTACTS];
    double weights[2 * LINK_MAX_CONTACTS], displacement[3 * LINK_MAX_CONTACTS];
    size_t count = 0;
    for (size_t c = 0; c < view->link.contact_count && c < LINK_MAX_CONTACTS; c++) {
        const struct link_contact *contact = &view->link.contact[c];
        if (contact->triangle >= bank->triangle_count)
            continue;
        triangle[count] = contact->triangle;
        memcpy(weights + 2 * count, contact->weights, sizeof contact->weights);
        memcpy(displacement + 3 * count, contact->displacement_m, sizeof contact->displacement_m);
        count++;
    }
    view->field = (struct failure){0};
    if (count == 0 ||
        field_from_contacts(bank, count, triangle, weights, displacement, view->u, NULL, &view->field) < 0)
        memset(view->u, 0, 3 * sizeof(double) * bank->vertex_count);
}

static const struct message *newest(void *context, uint64_t *number)
{
    struct view *view = context;
    if (view->state.number == 0)
        return NULL;
    if (!view->encoded) {
        struct failure why;
        compute_field(view);
        view->state.field_error = view->field.status < 0 ? view->field.cause : "";
        view->state.clients = server_clients(view->server);
        view->state.dropped = server_dropped(view->server);
        view->state.malformed = view->malformed;
        if (message_frame(&view->frame, &view->bank->view, &view->state, view->u, &why) < 0)
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
    switch (command.kind) {
    case COMMAND_HAND:
        view->owner = client;
        view->input.overridden = true;
        memcpy(view->input.target_m, command.target_m, sizeof command.target_m);
        clamp_to_reach(view->bank->view.tools, view->input.target_m);
        break;
    case COMMAND_RELEASE:
        view->owner = 0;
        view->input.overridden = false;
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
    if (view->owner == client) {
        view->owner = 0;
        view->input.overridden = false;
    }
}

static int scene_name(const struct bank_file *bank, char **name, struct failure *why)
{
    struct scene *scene = bank_scene(bank);
    *name = strdup(scene ? scene->name : "");
    free(scene);
    return *name ? STATUS_OK : failure_set(why, STATUS_MEMORY, "view", "", "no memory for the scene");
}

int view_create(const struct bank_file *bank, uint16_t port, struct view **out, struct failure *why)
{
    struct view *view = calloc(1, sizeof *view);
    char *name = NULL;
    int status = STATUS_OK;
    if (view)
        view->u = calloc(3 * (size_t)bank->view.vertex_count, sizeof(double));
    if (!view || !view->u)
        status = failure_set(why, STATUS_MEMORY, "view", "", "no memory for %u vertices", bank->view.vertex_count);
    if (status >= 0) {
        view->bank = bank;
        view->state.link = &view->link;
        status = scene_name(bank, &name, why);
    }
    if (status >= 0)
        status = message_hello(&view->hello, &bank->view, name, why);
    free(name);
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

/* Poses arrive at 100 Hz, frames leave at 30: the trace keeps every pose, so that a short poke is not lost between. */
static void trace_force(struct view *view, const struct link *link)
{
    if (link->pose_time_us == view->traced_us)
        return;
    view->traced_us = link->pose_time_us;
    struct message_state *state = &view->state;
    if (view->trace_taken || state->trace_count == MESSAGE_MAX_TRACE)
        state->trace_count = 0;
    view->trace_taken = false;
    const double *f = link->force_N;
    state->trace_time_s[state->trace_count] = 1e-6 * (double)link->pose_time_us;
    state->trace_force_N[state->trace_count++] = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
}

void view_update(struct view *view, const struct link *link, double time_s, const double hand_target_m[3])
{
    trace_force(view, link);
    if (time_s + 1e-9 < view->due_s)
        return;
    view->due_s = fmax(view->due_s, time_s - 1.0 / VIEW_RATE_HZ) + 1.0 / VIEW_RATE_HZ;

    view->link = *link;
    view->state.number++;
    view->state.time_s = time_s;
    view->state.driven = view->input.overridden;
    memcpy(view->state.hand_target_m, hand_target_m, sizeof view->state.hand_target_m);
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
