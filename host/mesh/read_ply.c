/* PLY, text and binary of either byte order: the elements vertex (x, y, z) and face (vertex_indices); others are skipped.
 * http://paulbourke.net/dataformats/ply/ */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh_readers.h"
#include "vtk_values.h"

enum { MOST_ELEMENTS = 16, MOST_PROPERTIES = 64 };

struct property {
    char name[32];
    enum vtk_type type, count_type; /* count_type: VTK_NONE if it is no list */
};

struct element {
    char name[32];
    size_t count, property_count;
    struct property property[MOST_PROPERTIES];
};

struct ply {
    struct scan *s;
    bool binary;
    size_t element_count;
    struct element element[MOST_ELEMENTS];
};

static enum vtk_type ply_type(const char *name)
{
    static const struct {
        const char *name;
        enum vtk_type type;
    } types[] = {{"char", VTK_I8},   {"uchar", VTK_U8},   {"short", VTK_I16},   {"ushort", VTK_U16},
                 {"int", VTK_I32},   {"uint", VTK_U32},   {"float", VTK_F32},   {"double", VTK_F64},
                 {"int8", VTK_I8},   {"uint8", VTK_U8},   {"int16", VTK_I16},   {"uint16", VTK_U16},
                 {"int32", VTK_I32}, {"uint32", VTK_U32}, {"float32", VTK_F32}, {"float64", VTK_F64}};
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
        if (strcmp(types[i].name, name) == 0)
            return types[i].type;
    return VTK_NONE;
}

static int read_property(struct ply *p)
{
    struct scan *s = p->s;
    char type[16];
    struct element *e = p->element_count ? &p->element[p->element_count - 1] : NULL;
    if (!e || e->property_count == MOST_PROPERTIES)
        return scan_fail(s, STATUS_MESH_SYNTAX, e ? "more than %d properties" : "a property before any element (%d)",
                         MOST_PROPERTIES);
    struct property *q = &e->property[e->property_count++];
    int status = scan_word(s, type, sizeof type, "the type of a property");
    if (status == STATUS_OK && strcmp(type, "list") == 0) {
        status = scan_word(s, type, sizeof type, "the type of a list's length");
        q->count_type = status ? VTK_NONE : ply_type(type);
        if (status == STATUS_OK && (q->count_type == VTK_NONE || q->count_type >= VTK_F32))
            return scan_fail(s, STATUS_MESH_SYNTAX, "a list's length of type \"%s\"", type);
        if (status == STATUS_OK)
            status = scan_word(s, type, sizeof type, "the type of a list");
    }
    q->type = status ? VTK_NONE : ply_type(type);
    if (status == STATUS_OK && q->type == VTK_NONE)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the type \"%s\" is not known", type);
    return status ? status : scan_word(s, q->name, sizeof q->name, "the name of a property");
}

static int read_element_head(struct ply *p)
{
    struct scan *s = p->s;
    if (p->element_count == MOST_ELEMENTS)
        return scan_fail(s, STATUS_MESH_SYNTAX, "more than %d kinds of elements", MOST_ELEMENTS);
    struct element *e = &p->element[p->element_count++];
    int status = scan_word(s, e->name, sizeof e->name, "the name of an element");
    return status ? status : scan_count(s, 1, &e->count, "elements");
}

static int read_head(struct ply *p)
{
    struct scan *s = p->s;
    char word[32], format[32] = "";
    int status = STATUS_OK;
    scan_next_line(s);
    for (;;) {
        status = scan_word(s, word, sizeof word, "end_header");
        if (status)
            return status;
        if (strcmp(word, "end_header") == 0)
            break;
        if (strcmp(word, "format") == 0)
            status = scan_word(s, format, sizeof format, "the format");
        else if (strcmp(word, "element") == 0)
            status = read_element_head(p);
        else if (strcmp(word, "property") == 0)
            status = read_property(p);
        else if (strcmp(word, "comment") != 0 && strcmp(word, "obj_info") != 0)
            status = scan_fail(s, STATUS_MESH_SYNTAX, "the keyword \"%.30s\" is not known", word);
        if (status)
            return status;
        scan_next_line(s);
    }
    bool little = strcmp(format, "binary_little_endian") == 0, big = strcmp(format, "binary_big_endian") == 0;
    p->binary = little || big;
    if (!p->binary && strcmp(format, "ascii") != 0)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the format is \"%.30s\"", format);
    s->swap = big == (__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__);
    scan_next_line(s);
    s->binary = p->binary;
    return STATUS_OK;
}

static int read_value(struct ply *p, enum vtk_type type, double *value)
{
    struct scan *s = p->s;
    unsigned char bytes[8];
    if (!p->binary) {
        const char *token;
        size_t n = scan_peek(s, &token);
        if (n == 0)
            return scan_fail(s, STATUS_MESH_SYNTAX, "the file ends where a number should follow");
        char *end;
        *value = strtod(token, &end);
        if (end != token + n)
            return scan_fail(s, STATUS_MESH_SYNTAX, "\"%.*s\" stands where a number should", (int)(n < 30 ? n : 30),
                             token);
        s->at += n;
        return STATUS_OK;
    }
    int status = scan_bytes(s, bytes, vtk_size(type), "a property");
    if (status == STATUS_OK)
        *value = vtk_value(bytes, type, s->swap);
    return status;
}

/* A vertex: x, y, z wherever they stand among its properties. */
static int read_vertex(struct ply *p, const struct element *e, struct soup *soup)
{
    double x[3] = {0}, value;
    for (size_t i = 0; i < e->property_count; i++) {
        const struct property *q = &e->property[i];
        int status = q->count_type ? scan_fail(p->s, STATUS_MESH_SYNTAX, "a vertex with the list \"%s\"", q->name)
                                   : read_value(p, q->type, &value);
        if (status)
            return status;
        if (strlen(q->name) == 1 && q->name[0] >= 'x' && q->name[0] <= 'z') {
            if (!isfinite(value))
                return scan_fail(p->s, STATUS_MESH_NONFINITE, "a coordinate is not finite");
            x[q->name[0] - 'x'] = value;
        }
    }
    return soup_vertex(soup, p->s, x);
}

/* A face, or an element that is skipped (soup NULL). */
static int read_lists(struct ply *p, const struct element *e, struct soup *soup)
{
    struct scan *s = p->s;
    for (size_t i = 0; i < e->property_count; i++) {
        const struct property *q = &e->property[i];
        double count = 1, value;
        uint32_t corner[SOUP_POLYGON];
        bool indices =
            soup && q->count_type && (strcmp(q->name, "vertex_indices") == 0 || strcmp(q->name, "vertex_index") == 0);
        int status = q->count_type ? read_value(p, q->count_type, &count) : STATUS_OK;
        if (status)
            return status;
        if (!(count >= 0 && count <= (double)(s->length - s->at)) || count != floor(count) ||
            (indices && (count < 3 || count > SOUP_POLYGON)))
            return scan_fail(s, STATUS_MESH_SYNTAX, "a list of %g numbers", count);
        for (size_t k = 0; k < (size_t)count; k++) {
            status = read_value(p, q->type, &value);
            if (status)
                return status;
            if (indices && !(value >= 0 && value < (double)soup->vertex_count && value == floor(value)))
                return scan_fail(s, STATUS_MESH_INDEX, "a face names vertex %.17g of %zu (counted from 0)", value,
                                 soup->vertex_count);
            if (indices)
                corner[k] = (uint32_t)value;
        }
        if (indices)
            status = soup_polygon(soup, s, corner, (size_t)count);
        if (status)
            return status;
    }
    return STATUS_OK;
}

static bool has_coordinates(const struct element *e)
{
    int found = 0;
    for (size_t i = 0; i < e->property_count; i++)
        found += strlen(e->property[i].name) == 1 && e->property[i].name[0] >= 'x' && e->property[i].name[0] <= 'z';
    return found == 3;
}

int read_ply(struct scan *s, struct soup *soup)
{
    struct ply *p = calloc(1, sizeof *p);
    if (!p)
        return scan_fail(s, STATUS_MEMORY, "no memory for the file's head");
    p->s = s;
    int status = read_head(p);
    for (size_t i = 0; i < p->element_count && status == STATUS_OK; i++) {
        const struct element *e = &p->element[i];
        bool vertex = strcmp(e->name, "vertex") == 0, face = strcmp(e->name, "face") == 0;
        if (vertex && !has_coordinates(e))
            status = scan_fail(s, STATUS_MESH_SYNTAX, "vertices without x, y and z");
        if (e->property_count == 0)
            continue;
        for (size_t k = 0; k < e->count && status == STATUS_OK; k++)
            status = vertex ? read_vertex(p, e, soup) : read_lists(p, e, face ? soup : NULL);
    }
    free(p);
    return status;
}
