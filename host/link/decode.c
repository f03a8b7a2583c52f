#include "decode.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

const char *decode_data(const struct can_frame_t *frame, char text[129])
{
    text[0] = 0;
    for (unsigned i = 0; i < frame->length && i < sizeof frame->data; i++)
        sprintf(text + 2 * (size_t)i, "%02X", frame->data[i]);
    return text;
}

static const struct dbc_message *find(const struct dbc *dbc, const struct can_frame_t *frame, unsigned *node)
{
    *node = 0;
    return frame->flags == 0 ? dbc_find(dbc, frame->id, node) : NULL;
}

const struct dbc_message *decode_text(const struct dbc *dbc, const struct can_frame_t *frame, char text[DECODE_TEXT])
{
    struct dbc_reading reading[DBC_MAX_SIGNALS];
    unsigned node;
    const struct dbc_message *m = find(dbc, frame, &node);
    if (!m) {
        snprintf(text, DECODE_TEXT, "%s", frame->flags & CAN_FLAG_ERROR ? "error frame" : "not of the protocol");
        return NULL;
    }
    const size_t count = dbc_decode(m, frame->data, frame->length, reading);
    if (count == 0) {
        snprintf(text, DECODE_TEXT, "%s, malformed", m->name);
        return NULL;
    }
    size_t n = (size_t)(node ? snprintf(text, DECODE_TEXT, "%s %u:", m->name, node)
                             : snprintf(text, DECODE_TEXT, "%s:", m->name));
    for (size_t i = 0; i < count && n < DECODE_TEXT; i++) {
        const struct dbc_reading *r = &reading[i];
        n += (size_t)snprintf(text + n, DECODE_TEXT - n, "%s %s ", i ? "," : "", r->signal->name);
        if (n >= DECODE_TEXT)
            break;
        if (r->name)
            n += (size_t)snprintf(text + n, DECODE_TEXT - n, "%s", r->name);
        else
            n += (size_t)snprintf(text + n, DECODE_TEXT - n, r->signal->factor == 1 ? "%.10g%s%s" : "%.6g%s%s",
                                  r->value, *r->signal->unit ? " " : "", r->signal->unit);
    }
    return m;
}

struct json_object *decode_json(const struct dbc *dbc, const struct can_frame_t *frame, uint64_t time_us)
{
    struct dbc_reading reading[DBC_MAX_SIGNALS];
    unsigned node;
    char data[129];
    struct json_object *object = json_object_new_object();
    json_object_object_add(object, "time_us", json_object_new_int64((int64_t)time_us));
    json_object_object_add(object, "id", json_object_new_int64(frame->id));
    json_object_object_add(object, "data", json_object_new_string(decode_data(frame, data)));
    const struct dbc_message *m = find(dbc, frame, &node);
    const size_t count = m ? dbc_decode(m, frame->data, frame->length, reading) : 0;
    if (count == 0)
        return object;
    json_object_object_add(object, "name", json_object_new_string(m->name));
    json_object_object_add(object, "node", json_object_new_int((int)node));
    struct json_object *signals = json_object_new_object();
    for (size_t i = 0; i < count; i++)
        json_object_object_add(signals, reading[i].signal->name, json_object_new_double(reading[i].value));
    json_object_object_add(object, "signals", signals);
    return object;
}
