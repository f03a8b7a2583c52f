#include "command.h"

#include <json-c/json.h>
#include <math.h>
#include <string.h>

#include "bank_format.h"

static bool read_hand(const struct json_object *value, struct command *command)
{
    if (!value) {
        command->kind = COMMAND_RELEASE;
        return true;
    }
    if (!json_object_is_type(value, json_type_array) || json_object_array_length(value) != 3)
        return false;
    command->kind = COMMAND_HAND;
    for (size_t i = 0; i < 3; i++) {
        struct json_object *number = json_object_array_get_idx(value, i);
        if (!json_object_is_type(number, json_type_double) && !json_object_is_type(number, json_type_int))
            return false;
        command->target_m[i] = json_object_get_double(number);
        if (!isfinite(command->target_m[i]) || fabs(command->target_m[i]) > 1)
            return false;
    }
    return true;
}

static bool read_instrument(bool named, const struct json_object *value, struct command *command)
{
    const int64_t number = named ? json_object_get_int64(value) : 0;
    if ((named && !json_object_is_type(value, json_type_int)) || number < 0 || number >= BANK_MAX_INSTRUMENTS)
        return false;
    command->instrument = (uint32_t)number;
    return true;
}

static bool read_do(const struct json_object *value, struct command *command)
{
    static const struct {
        const char *name;
        enum command_kind kind;
    } words[] = {{"acknowledge", COMMAND_ACKNOWLEDGE}, {"stop", COMMAND_STOP}, {"quit", COMMAND_QUIT}};

    if (!json_object_is_type(value, json_type_string))
        return false;
    const char *word = json_object_get_string((struct json_object *)value);
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strcmp(word, words[i].name) == 0) {
            command->kind = words[i].kind;
            return true;
        }
    return false;
}

bool command_parse(const char *text, size_t length, struct command *command)
{
    if (length == 0 || length > COMMAND_MAX_BYTES)
        return false;
    struct json_tokener *tokener = json_tokener_new_ex(4); /* an object of an array of numbers nests 3 deep */
    if (!tokener)
        return false;
    json_tokener_set_flags(tokener, JSON_TOKENER_STRICT | JSON_TOKENER_VALIDATE_UTF8);
    struct json_object *message = json_tokener_parse_ex(tokener, text, (int)length);
    bool whole =
        json_tokener_get_error(tokener) == json_tokener_success && json_tokener_get_parse_end(tokener) == length;
    struct command read = {0};
    bool good = false;
    if (whole && json_object_is_type(message, json_type_object)) {
        struct json_object *value, *instrument = NULL;
        const int keys = json_object_object_length(message);
        const bool named = json_object_object_get_ex(message, "instrument", &instrument);
        if (json_object_object_get_ex(message, "hand", &value))
            good = keys == 1 + named && read_instrument(named, instrument, &read) && read_hand(value, &read);
        else if (keys == 1 && json_object_object_get_ex(message, "do", &value))
            good = read_do(value, &read);
    }
    json_object_put(message);
    json_tokener_free(tokener);
    if (good)
        *command = read;
    return good;
}
