#include "message.h"

#include <json-c/json.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "safety.h"

static struct json_object *number(double value)
{
    if (!isfinite(value))
        return NULL;
    struct json_object *object = json_object_new_double(value);
    json_object_set_serializer(object, json_object_double_to_json_string, (void *)(uintptr_t) "%.9g", NULL);
    return object;
}

static struct json_object *numbers(size_t count, const double *values)
{
    struct json_object *array = json_object_new_array();
    for (size_t i = 0; i < count; i++)
        json_object_array_add(array, number(values[i]));
    return array;
}

static struct json_object *floats(size_t count, const float *values)
{
    struct json_object *array = json_object_new_array();
    for (size_t i = 0; i < count; i++)
        json_object_array_add(array, number((double)values[i]));
    return array;
}

static void put(struct json_object *object, const char *key, struct json_object *value)
{
    json_object_object_add(object, key, value);
}

/* Header and JSON into the message, with room for `array_bytes` behind them; returns where those go, NULL without memory. */
static unsigned char *begin(struct message *message, uint32_t kind, struct json_object *json, size_t array_bytes)
{
    size_t text_length = 0;
    const char *text = json_object_to_json_string_length(json, JSON_C_TO_STRING_PLAIN, &text_length);
    if (!text)
        return NULL;
    uint32_t padded = (uint32_t)((text_length + 3) & ~(size_t)3);
    size_t length = 8 + padded + array_bytes;
    if (length > message->capacity) {
        unsigned char *grown = realloc(message->buffer, MESSAGE_HEADROOM + length);
        if (!grown)
            return NULL;
        message->buffer = grown;
        message->capacity = length;
    }
    message->length = length;
    unsigned char *at = message->buffer + MESSAGE_HEADROOM;
    memcpy(at, &kind, 4);
    memcpy(at + 4, &padded, 4);
    memset(at + 8, ' ', padded);
    memcpy(at + 8, text, text_length);
    return at + 8 + padded;
}

static int no_memory(struct failure *why)
{
    return failure_set(why, STATUS_MEMORY, "view", "", "no memory for a message to the page");
}

static struct json_object *points(size_t count, const float (*point_m)[3])
{
    struct json_object *array = json_object_new_array();
    for (size_t i = 0; i < count; i++)
        json_object_array_add(array, floats(3, point_m[i]));
    return array;
}

/* The spheres of an instrument's shape: its share of TOOL's points. */
static struct json_object *spheres(const struct bank_view *bank, uint32_t t)
{
    struct json_object *array = json_object_new_array();
    const uint32_t first = t ? bank->tools[0].point_count : 0;
    for (uint32_t i = first; bank->shape && i < first + bank->tools[t].point_count && i < BANK_MAX_TOOL_POINTS; i++) {
        const struct bank_sphere *s = &bank->shape->sphere[i];
        const float values[6] = {s->centre_m[0], s->centre_m[1], s->centre_m[2], s->radius_m, s->along_m, s->side};
        json_object_array_add(array, floats(6, values));
    }
    return array;
}

static void put_obstacles(struct json_object *json, const struct bank_view *bank)
{
    struct json_object *list = json_object_new_array();
    const struct bank_rigid *rigid = bank->rigid;
    const struct bank_obstacle *obstacle = rigid ? (const void *)(rigid + 1) : NULL;
    for (uint32_t i = 0; rigid && i < rigid->obstacles; i++) {
        struct json_object *one = json_object_new_object();
        put(one, "radius_m", number((double)obstacle[i].radius_m));
        put(one, "points", points(obstacle[i].points, obstacle[i].point_m));
        json_object_array_add(list, one);
    }
    put(json, "obstacles", list);
    put(json, "cannula_m",
        floats(2, (const float[2]){rigid ? rigid->cannula_radius_m : 0, rigid ? rigid->cannula_inside_m : 0}));
}

static struct json_object *tool_json(const struct bank_view *bank, uint32_t t, const char *name)
{
    const struct bank_tool *tool = &bank->tools[t];
    float minimum[3], maximum[3];
    for (size_t a = 0; a < 3; a++) {
        minimum[a] = tool->axis[a].minimum;
        maximum[a] = tool->axis[a].maximum;
    }
    struct json_object *json = json_object_new_object();
    put(json, "name", json_object_new_string(name));
    put(json, "trocar_m", floats(3, tool->trocar_m));
    put(json, "rotation", floats(9, tool->rotation));
    put(json, "tip_radius_m", number((double)tool->tip_radius_m));
    put(json, "joint_min", floats(3, minimum));
    put(json, "joint_max", floats(3, maximum));
    put(json, "opening_rad", number(bank->shape ? (double)bank->shape->opening_rad[t] : 0));
    put(json, "spheres", spheres(bank, t));
    return json;
}

int message_hello(struct message *message, const struct bank_view *bank, const char *scene,
                  const char *const names[BANK_MAX_INSTRUMENTS], struct failure *why)
{
    size_t n = bank->vertex_count, t = bank->triangle_count;
    int fixed = 0;
    for (size_t v = 0; v < n; v++)
        fixed += bank->row_of[v] == BANK_NONE;

    struct json_object *json = json_object_new_object(), *list = json_object_new_array();
    put(json, "protocol", json_object_new_int(2));
    put(json, "scene", json_object_new_string(scene));
    put(json, "vertices", json_object_new_int64((int64_t)n));
    put(json, "triangles", json_object_new_int64((int64_t)t));
    put(json, "fixed", json_object_new_int(fixed));
    put(json, "jaws", json_object_new_boolean(bank->grasp != NULL));
    put(json, "force_limit_N", number((double)bank->contact->force_limit_N));
    struct json_object *health = json_object_new_array();
    for (unsigned i = 0; link_health_name(i); i++)
        json_object_array_add(health, json_object_new_string(link_health_name(i)));
    put(json, "health_names", health);
    for (uint32_t i = 0; i < bank->tool_count && i < BANK_MAX_INSTRUMENTS; i++)
        json_object_array_add(list, tool_json(bank, i, names[i]));
    put(json, "instruments", list);
    put_obstacles(json, bank);

    unsigned char *at = begin(message, MESSAGE_HELLO, json, 12 * n + 6 * t + n);
    json_object_put(json);
    if (!at)
        return no_memory(why);
    memcpy(at, bank->positions, 12 * n);
    at += 12 * n;
    for (size_t i = 0; i < t; i++, at += 6)
        memcpy(at, bank->triangles[i].vertex, 6);
    for (size_t v = 0; v < n; v++)
        *at++ = bank->row_of[v] == BANK_NONE;
    return STATUS_OK;
}

static const char *state_name(unsigned state)
{
    static const char *const names[] = {"INIT", "READY", "RUN", "SAFE"};
    return state <= SAFETY_SAFE ? names[state] : "INIT";
}

static struct json_object *point_json(const struct bank_view *bank, const struct link_contact *contact,
                                      const double displacement_m[3])
{
    const uint16_t *vertex = bank->triangles[contact->triangle].vertex;
    double weight[3] = {1 - contact->weights[0] - contact->weights[1], contact->weights[0], contact->weights[1]};
    double point[3];
    for (size_t a = 0; a < 3; a++) {
        point[a] = displacement_m[a];
        for (size_t k = 0; k < 3; k++)
            point[a] += weight[k] * (double)bank->positions[3 * vertex[k] + a];
    }
    return numbers(3, point);
}

static struct json_object *contact_points(const struct bank_view *bank, const struct link *link)
{
    struct json_object *array = json_object_new_array();
    for (size_t c = 0; c < link->contact_count && c < LINK_MAX_CONTACTS; c++)
        if (link->contact[c].triangle < bank->triangle_count)
            json_object_array_add(array, point_json(bank, &link->contact[c], link->contact[c].displacement_m));
    return array;
}

static double silent_s(const struct link *link, double time_s)
{
    uint64_t heard_us = link->heartbeat_time_us > link->pose_time_us ? link->heartbeat_time_us : link->pose_time_us;
    return fmax(0, time_s - 1e-6 * (double)heard_us);
}

static struct json_object *instrument_json(const struct bank_view *bank, const struct message_instrument *i,
                                           double time_s)
{
    const struct link *link = i->link;
    struct json_object *json = json_object_new_object();
    put(json, "tip_m", numbers(3, link->tip_m));
    put(json, "force_N", numbers(3, link->force_N));
    put(json, "grip", number((double)link->grip / BANK_MAX_GRIP));
    put(json, "roll_rad", number(M_PI * ((double)link->roll - BANK_MIDDLE_ROLL) / BANK_MIDDLE_ROLL));
    put(json, "contacts", contact_points(bank, link));
    struct json_object *held = json_object_new_array();
    for (size_t k = 0; k < i->held_count; k++)
        json_object_array_add(held, point_json(bank, &i->held[k], i->held[k].displacement_m));
    put(json, "held", held);
    put(json, "state", json_object_new_string(state_name(link->state)));
    put(json, "reason", json_object_new_string(link->reason ? status_name(link->reason) : ""));
    put(json, "meaning", json_object_new_string(link->reason ? status_meaning(link->reason) : ""));
    put(json, "remedy", json_object_new_string(link->reason ? status_remedy(link->reason) : ""));
    put(json, "silent_s", number(silent_s(link, time_s)));
    struct json_object *health = json_object_new_array();
    for (unsigned k = 0; link_health_name(k); k++)
        json_object_array_add(health, json_object_new_int64(link->health[k]));
    put(json, "health", health);
    struct json_object *trace = json_object_new_array();
    for (unsigned k = 0; k < i->trace_count; k++)
        json_object_array_add(trace, numbers(2, (double[2]){i->trace_time_s[k], i->trace_force_N[k]}));
    put(json, "trace", trace);
    put(json, "hand_m", numbers(3, i->hand_target_m));
    put(json, "driven", json_object_new_boolean(i->driven));
    return json;
}

static struct json_object *state_json(const struct bank_view *bank, const struct message_state *state, double max_m,
                                      double scale_m)
{
    struct json_object *json = json_object_new_object(), *list = json_object_new_array();
    put(json, "frame", json_object_new_int64((int64_t)state->number));
    put(json, "time_s", number(state->time_s));
    put(json, "clients", json_object_new_int64(state->clients));
    put(json, "dropped", json_object_new_int64((int64_t)state->dropped));
    put(json, "malformed", json_object_new_int64((int64_t)state->malformed));
    put(json, "field_error", json_object_new_string(state->field_error));
    put(json, "max_m", number(max_m));
    put(json, "scale_m", number(scale_m));
    for (uint32_t i = 0; i < state->instruments; i++)
        json_object_array_add(list, instrument_json(bank, &state->instrument[i], state->time_s));
    put(json, "instruments", list);
    return json;
}

int message_frame(struct message *message, const struct bank_view *bank, const struct message_state *state,
                  const double *u, struct failure *why)
{
    size_t n = bank->vertex_count;
    double max_m = 0, max_component = 0;
    for (size_t v = 0; v < n; v++) {
        max_m = fmax(max_m, sqrt(u[3 * v] * u[3 * v] + u[3 * v + 1] * u[3 * v + 1] + u[3 * v + 2] * u[3 * v + 2]));
        for (size_t a = 0; a < 3; a++)
            max_component = fmax(max_component, fabs(u[3 * v + a]));
    }
    double scale_m = max_component > 0 && isfinite(max_component) ? max_component / 32767 : 1e-9;

    struct json_object *json = state_json(bank, state, max_m, scale_m);
    unsigned char *at = begin(message, MESSAGE_FRAME, json, 6 * n);
    json_object_put(json);
    if (!at)
        return no_memory(why);
    for (size_t i = 0; i < 3 * n; i++, at += 2) {
        double scaled = u[i] / scale_m;
        int16_t rounded = isfinite(scaled) ? (int16_t)lrint(fmin(fmax(scaled, -32767), 32767)) : 0;
        memcpy(at, &rounded, 2);
    }
    return STATUS_OK;
}

void message_free(struct message *message)
{
    free(message->buffer);
    *message = (struct message){0};
}
