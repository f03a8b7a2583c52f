#include "provenance.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

struct buffer {
    char *bytes;
    size_t used, room;
};

static int grow(void *context, unsigned char *bytes, size_t length)
{
    struct buffer *b = context;
    if (b->room - b->used < length) {
        size_t room = 2 * (b->used + length) + 4096;
        char *larger = realloc(b->bytes, room);
        if (!larger)
            return 0;
        b->bytes = larger;
        b->room = room;
    }
    memcpy(b->bytes + b->used, bytes, length);
    b->used += length;
    return 1;
}

static bool emit_scalar(yaml_emitter_t *out, const char *text, yaml_scalar_style_t style)
{
    yaml_event_t event;
    return yaml_scalar_event_initialize(&event, NULL, NULL, (yaml_char_t *)text, (int)strlen(text), 1, 1, style) &&
           yaml_emitter_emit(out, &event);
}

static bool emit_pair(yaml_emitter_t *out, const char *key, const char *value, yaml_scalar_style_t style)
{
    return emit_scalar(out, key, YAML_PLAIN_SCALAR_STYLE) && emit_scalar(out, value, style);
}

static bool emit_number(yaml_emitter_t *out, const char *key, const char *format, double value)
{
    char text[64];
    snprintf(text, sizeof text, format, value);
    return emit_pair(out, key, text, YAML_PLAIN_SCALAR_STYLE);
}

static bool emit(yaml_emitter_t *out, const struct provenance *p)
{
    yaml_event_t event;
    yaml_scalar_style_t quoted = YAML_DOUBLE_QUOTED_SCALAR_STYLE;
    yaml_emitter_set_unicode(out, 1);
    yaml_emitter_set_width(out, -1);
    bool good = yaml_stream_start_event_initialize(&event, YAML_UTF8_ENCODING) && yaml_emitter_emit(out, &event) &&
                yaml_document_start_event_initialize(&event, NULL, NULL, NULL, 1) && yaml_emitter_emit(out, &event) &&
                yaml_mapping_start_event_initialize(&event, NULL, NULL, 1, YAML_BLOCK_MAPPING_STYLE) &&
                yaml_emitter_emit(out, &event);
    good = good && emit_pair(out, "program", p->program, quoted) && emit_pair(out, "mesh_path", p->mesh_path, quoted) &&
           emit_pair(out, "mesh_from_bank", p->mesh_from_bank, quoted) &&
           emit_pair(out, "discretisation", p->discretisation, quoted) &&
           emit_number(out, "nodes", "%.0f", (double)p->nodes) &&
           emit_number(out, "tetrahedra", "%.0f", (double)p->tetrahedra) &&
           emit_number(out, "build_seconds", "%.3f", p->build_seconds);
    if (p->force_error_max >= 0)
        good = good && emit_number(out, "force_error_p95", "%.3e", p->force_error_p95) &&
               emit_number(out, "force_error_max", "%.3e", p->force_error_max);
    if (*p->measured)
        good = good && emit_pair(out, "force_error_percent", p->measured, quoted);
    if (p->step > 0)
        good = good && emit_number(out, "step", "%.6g", p->step);
    if (p->scene)
        good = good && emit_pair(out, "scene", p->scene, YAML_LITERAL_SCALAR_STYLE);
    return good && yaml_mapping_end_event_initialize(&event) && yaml_emitter_emit(out, &event) &&
           yaml_document_end_event_initialize(&event, 1) && yaml_emitter_emit(out, &event) &&
           yaml_stream_end_event_initialize(&event) && yaml_emitter_emit(out, &event);
}

int provenance_print(const struct provenance *p, char **text, size_t *length, struct failure *why)
{
    struct buffer buffer = {0};
    yaml_emitter_t out;
    *text = NULL;
    *length = 0;
    if (!yaml_emitter_initialize(&out))
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the provenance");
    yaml_emitter_set_output(&out, grow, &buffer);
    bool good = emit(&out, p);
    bool memory = out.error == YAML_MEMORY_ERROR || out.error == YAML_WRITER_ERROR;
    yaml_emitter_delete(&out);
    if (!good) {
        free(buffer.bytes);
        return failure_set(why, memory ? STATUS_MEMORY : STATUS_SCENE_SYNTAX, p->mesh_path,
                           memory ? NULL : "use names in UTF-8", "the provenance cannot be written as YAML");
    }
    *text = buffer.bytes;
    *length = buffer.used;
    return STATUS_OK;
}

static int store(struct provenance *p, const char *key, const char *value, size_t length)
{
    struct {
        const char *key;
        char *text;
        size_t room;
    } texts[] = {{"program", p->program, sizeof p->program},
                 {"mesh_path", p->mesh_path, sizeof p->mesh_path},
                 {"mesh_from_bank", p->mesh_from_bank, sizeof p->mesh_from_bank},
                 {"discretisation", p->discretisation, sizeof p->discretisation},
                 {"force_error_percent", p->measured, sizeof p->measured}};
    for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++)
        if (!strcmp(key, texts[k].key))
            snprintf(texts[k].text, texts[k].room, "%s", value);
    if (!strcmp(key, "nodes"))
        p->nodes = strtoull(value, NULL, 10);
    if (!strcmp(key, "tetrahedra"))
        p->tetrahedra = strtoull(value, NULL, 10);
    if (!strcmp(key, "build_seconds"))
        p->build_seconds = strtod(value, NULL);
    if (!strcmp(key, "step"))
        p->step = strtod(value, NULL);
    if (!strcmp(key, "force_error_p95"))
        p->force_error_p95 = strtod(value, NULL);
    if (!strcmp(key, "force_error_max"))
        p->force_error_max = strtod(value, NULL);
    if (!strcmp(key, "scene") && !p->scene) {
        p->scene = malloc(length + 1);
        if (!p->scene)
            return STATUS_MEMORY;
        memcpy(p->scene, value, length);
        p->scene[length] = 0;
    }
    return STATUS_OK;
}

/* The events of one mapping: scalars at depth 1 are key and value in turn, deeper ones are skipped. Aliases are never
 * expanded, so the work is bounded by the length. */
static int parse_events(yaml_parser_t *in, struct provenance *p)
{
    char key[64] = "";
    bool have_key = false, mapping = false;
    for (int depth = 0;;) {
        yaml_event_t event;
        if (!yaml_parser_parse(in, &event))
            return STATUS_BANK_SECTION;
        int status = STATUS_OK;
        yaml_event_type_t type = event.type;
        if (type == YAML_MAPPING_START_EVENT || type == YAML_SEQUENCE_START_EVENT) {
            mapping = mapping || (depth == 0 && type == YAML_MAPPING_START_EVENT);
            depth++;
        } else if (type == YAML_MAPPING_END_EVENT || type == YAML_SEQUENCE_END_EVENT) {
            if (--depth == 1)
                have_key = !have_key;
        } else if (type == YAML_ALIAS_EVENT && depth == 1) {
            have_key = !have_key;
        } else if (type == YAML_SCALAR_EVENT && depth == 1) {
            const char *value = (const char *)event.data.scalar.value;
            if (!have_key)
                snprintf(key, sizeof key, "%s", value);
            else
                status = store(p, key, value, event.data.scalar.length);
            have_key = !have_key;
        }
        yaml_event_delete(&event);
        if (status)
            return status;
        if (type == YAML_STREAM_END_EVENT)
            return mapping ? STATUS_OK : STATUS_BANK_SECTION;
    }
}

int provenance_parse(const char *text, size_t length, const char *place, struct provenance *p, struct failure *why)
{
    *p = (struct provenance){.force_error_p95 = -1, .force_error_max = -1};
    yaml_parser_t in;
    if (!yaml_parser_initialize(&in))
        return failure_set(why, STATUS_MEMORY, place, NULL, "no memory to read the provenance");
    yaml_parser_set_encoding(&in, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(&in, (const unsigned char *)text, length);
    int status = parse_events(&in, p);
    char problem[200];
    snprintf(problem, sizeof problem, "%s at line %zu", in.problem ? in.problem : "not one mapping", in.mark.line + 1);
    yaml_parser_delete(&in);
    if (status)
        provenance_free(p);
    if (status == STATUS_MEMORY)
        return failure_set(why, STATUS_MEMORY, place, NULL, "no memory to read the provenance");
    if (status)
        return failure_set(why, STATUS_BANK_SECTION, place, NULL, "section PROV is not YAML: %s", problem);
    return STATUS_OK;
}

void provenance_free(struct provenance *p)
{
    free(p->scene);
    *p = (struct provenance){0};
}
