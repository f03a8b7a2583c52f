#include "effects.h"

#include <string.h>

#include "bank_format.h"
#include "effects/image.h"

static const struct effect table[] = {
#define EFFECT(bit, NAME, name, tag, parts, what)                                                                      \
    {#name, what, EFFECT_##NAME, tag, scene_##name##_parse, scene_##name##_print, scene_##name##_section},
#include "effects.def"
#undef EFFECT
};

size_t effects_count(void)
{
    return sizeof table / sizeof *table;
}

const struct effect *effects_at(size_t index)
{
    return &table[index];
}

const struct effect *effects_find(const char *name)
{
    for (size_t i = 0; i < effects_count(); i++)
        if (!strcmp(table[i].name, name))
            return &table[i];
    return NULL;
}

static const char *name_of(uint32_t bit)
{
    for (size_t i = 0; i < effects_count(); i++)
        if (table[i].bit == bit)
            return table[i].name;
    return NULL;
}

void effects_names(uint32_t bits, const char *between, char *text, size_t room)
{
    size_t used = 0;
    snprintf(text, room, "none");
    for (int k = 0; k < 32 && used < room; k++) {
        uint32_t bit = (uint32_t)1 << k;
        if (!(bits & bit))
            continue;
        const char *name = name_of(bit);
        char number[16];
        snprintf(number, sizeof number, "bit %d", k);
        used += (size_t)snprintf(text + used, room - used, "%s%s", used ? between : "", name ? name : number);
    }
}
