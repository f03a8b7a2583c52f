/* VTU and VTP. One pass of expat notes where each array's bytes stand, up to the appended data, which need not be XML; the
 * arrays are decoded after it. Document types (and with them entities) are refused. */
#include <expat.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "mesh_data.h"
#include "mesh_readers.h"
#include "vtk_xml_data.h"

enum section { NO_SECTION, POINTS, CELLS, CELL_DATA, POINT_DATA, POLYS, STRIPS, SECTIONS };

static const char *const section_name[SECTIONS] = {"", "Points", "Cells", "CellData", "PointData", "Polys", "Strips"};

struct piece {
    uint64_t points, cells, polys, strips;
    size_t first, count; /* its arrays */
    long line;
};

struct noted {
    struct xml_array array;
    enum section section;
    bool appended;
    uint64_t offset;
};

struct document {
    struct scan *s;
    XML_Parser parser;
    int status;
    int depth;
    bool is_surface;
    char compressor[80];
    struct xml_encoding encoding;
    enum section section;
    bool in_array, appended_base64;
    struct piece *piece;
    size_t piece_count, piece_room;
    struct noted *noted;
    size_t noted_count, noted_room;
};

__attribute__((format(printf, 3, 4))) static void stop(struct document *d, enum status status, const char *cause, ...)
{
    char text[300];
    va_list arguments;
    va_start(arguments, cause);
    vsnprintf(text, sizeof text, cause, arguments);
    va_end(arguments);
    d->s->line = (long)XML_GetCurrentLineNumber(d->parser);
    d->status = scan_fail(d->s, status, "%s", text);
    XML_StopParser(d->parser, XML_FALSE);
}

static const char *attribute(const char **list, const char *name)
{
    for (; *list; list += 2)
        if (strcmp(list[0], name) == 0)
            return list[1];
    return "";
}

static uint64_t number(struct document *d, const char **list, const char *name)
{
    const char *text = attribute(list, name);
    char *end;
    unsigned long long value = strtoull(text, &end, 10);
    if (*text && (*end || *text == '-' || value > INT64_MAX))
        stop(d, STATUS_MESH_SYNTAX, "%s is \"%.40s\"", name, text);
    return value;
}

static bool grow(struct document *d, void *list, size_t count, size_t *room, size_t each)
{
    if (count < *room)
        return true;
    void *old = *(void **)list, *larger = realloc(old, (*room ? 2 * *room : 16) * each);
    if (!larger) {
        stop(d, STATUS_MEMORY, "no memory for the list of arrays");
        return false;
    }
    *room = *room ? 2 * *room : 16;
    *(void **)list = larger;
    return true;
}

static void start_file(struct document *d, const char **list)
{
    const char *type = attribute(list, "type"), *order = attribute(list, "byte_order");
    const char *header = attribute(list, "header_type");
    bool big = strcmp(order, "BigEndian") == 0;
    d->is_surface = strcmp(type, "PolyData") == 0;
    if (!d->is_surface && strcmp(type, "UnstructuredGrid") != 0)
        stop(d, STATUS_MESH_FORMAT, "the VTK file holds \"%.40s\", not UnstructuredGrid or PolyData", type);
    d->encoding.swap = big == (__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__);
    if (!big && *order && strcmp(order, "LittleEndian") != 0)
        stop(d, STATUS_MESH_SYNTAX, "the byte order is \"%.40s\"", order);
    if (!*order)
        d->encoding.swap = false;
    d->encoding.wide_header = strcmp(header, "UInt64") == 0;
    if (*header && !d->encoding.wide_header && strcmp(header, "UInt32") != 0)
        stop(d, STATUS_MESH_SYNTAX, "the header type is \"%.40s\"", header);
    snprintf(d->compressor, sizeof d->compressor, "%s", attribute(list, "compressor"));
    d->encoding.zlib = *d->compressor != 0;
}

static void start_piece(struct document *d, const char **list)
{
    if (!grow(d, &d->piece, d->piece_count, &d->piece_room, sizeof *d->piece))
        return;
    d->piece[d->piece_count++] = (struct piece){.points = number(d, list, "NumberOfPoints"),
                                                .cells = number(d, list, "NumberOfCells"),
                                                .polys = number(d, list, "NumberOfPolys"),
                                                .strips = number(d, list, "NumberOfStrips"),
                                                .first = d->noted_count,
                                                .line = (long)XML_GetCurrentLineNumber(d->parser)};
}

static void start_array(struct document *d, const char **list)
{
    const char *format = attribute(list, "format");
    if (!grow(d, &d->noted, d->noted_count, &d->noted_room, sizeof *d->noted))
        return;
    struct noted *n = &d->noted[d->noted_count];
    *n = (struct noted){.section = d->section};
    snprintf(n->array.name, sizeof n->array.name, "%s", d->section == POINTS ? "Points" : attribute(list, "Name"));
    n->array.type = vtk_type_of(attribute(list, "type"));
    n->array.components = *attribute(list, "NumberOfComponents") ? (size_t)number(d, list, "NumberOfComponents") : 1;
    n->array.line = (long)XML_GetCurrentLineNumber(d->parser);
    n->array.at = (size_t)(XML_GetCurrentByteIndex(d->parser) + XML_GetCurrentByteCount(d->parser));
    n->appended = strcmp(format, "appended") == 0;
    n->array.form = strcmp(format, "binary") == 0 ? XML_BASE64 : XML_TEXT;
    n->offset = n->appended ? number(d, list, "offset") : 0;
    if (!n->appended && n->array.form == XML_TEXT && *format && strcmp(format, "ascii") != 0)
        stop(d, STATUS_MESH_SYNTAX, "the format of an array is \"%.40s\"", format);
    if (n->array.type == VTK_NONE && d->section != CELL_DATA && d->section != POINT_DATA)
        stop(d, STATUS_MESH_SYNTAX, "the type of an array is \"%.40s\"", attribute(list, "type"));
    d->in_array = true;
    d->noted_count++;
    d->piece[d->piece_count - 1].count++;
}

static void on_start(void *user, const char *name, const char **list)
{
    struct document *d = user;
    if (d->depth++ == 0 && strcmp(name, "VTKFile") != 0)
        stop(d, STATUS_MESH_FORMAT, "this is XML, but its root is <%.40s>, not <VTKFile>", name);
    else if (d->depth == 1)
        start_file(d, list);
    else if (strcmp(name, "Piece") == 0)
        start_piece(d, list);
    else if (strcmp(name, "AppendedData") == 0)
        d->appended_base64 = strcmp(attribute(list, "encoding"), "base64") == 0;
    else if (d->piece_count && strcmp(name, "DataArray") == 0 && d->section != NO_SECTION && !d->in_array)
        start_array(d, list);
    for (int i = 1; i < SECTIONS; i++)
        if (strcmp(name, section_name[i]) == 0)
            d->section = (enum section)i;
}

static void on_end(void *user, const char *name)
{
    struct document *d = user;
    d->depth--;
    if (d->in_array && strcmp(name, "DataArray") == 0) {
        struct xml_array *array = &d->noted[d->noted_count - 1].array;
        size_t end = (size_t)XML_GetCurrentByteIndex(d->parser);
        array->end = end > array->at ? end : array->at; /* <DataArray .../> ends where it starts */
        d->in_array = false;
    }
    if (d->section != NO_SECTION && strcmp(name, section_name[d->section]) == 0)
        d->section = NO_SECTION;
}

static void on_doctype(void *user, const char *name, const char *system, const char *public, int internal)
{
    (void)name, (void)system, (void)public, (void)internal;
    stop(user, STATUS_MESH_SYNTAX, "a VTK file has no document type");
}

/* Parse the XML up to its end or to the appended data; `appended` is where those begin, or SIZE_MAX. */
static int parse(struct document *d, size_t *appended)
{
    struct scan *s = d->s;
    static const char mark[] = "<AppendedData";
    const unsigned char *found = memmem(s->bytes, s->length, mark, sizeof mark - 1), *close = NULL;
    size_t length = s->length;
    *appended = SIZE_MAX;
    if (found) {
        close = memchr(found, '>', s->length - (size_t)(found - s->bytes));
        const unsigned char *begin = close;
        while (begin && begin < s->bytes + s->length && *begin != '_')
            begin++;
        if (!begin || begin == s->bytes + s->length)
            return scan_fail(s, STATUS_MESH_SYNTAX, "the appended data do not begin with _");
        length = (size_t)(close + 1 - s->bytes);
        *appended = (size_t)(begin + 1 - s->bytes);
    }
    for (size_t at = 0; d->status == STATUS_OK && at < length;) {
        size_t n = length - at < 1 << 28 ? length - at : 1 << 28;
        enum XML_Status result =
            XML_Parse(d->parser, (const char *)s->bytes + at, (int)n, at + n == length && *appended == SIZE_MAX);
        if (result != XML_STATUS_OK && d->status == STATUS_OK) {
            s->line = (long)XML_GetCurrentLineNumber(d->parser);
            return scan_fail(s, STATUS_MESH_SYNTAX, "the XML is damaged: %s",
                             XML_ErrorString(XML_GetErrorCode(d->parser)));
        }
        at += n;
    }
    return d->status;
}

static int locate_appended(struct document *d, size_t appended)
{
    for (size_t i = 0; i < d->noted_count; i++) {
        struct noted *n = &d->noted[i];
        if (!n->appended)
            continue;
        d->s->line = n->array.line;
        if (appended == SIZE_MAX || n->offset >= d->s->length - appended)
            return scan_fail(d->s, STATUS_MESH_SYNTAX, "the array \"%.60s\" begins behind the end of the file",
                             n->array.name);
        n->array.form = d->appended_base64 ? XML_BASE64 : XML_RAW;
        n->array.at = appended + (size_t)n->offset;
        n->array.end = d->s->length;
    }
    return STATUS_OK;
}

/* The numbers of an array of a piece by section and name (NULL: the first). */
static int fetch(struct document *d, const struct piece *p, enum section section, const char *name, uint64_t expected,
                 double **values, size_t *count)
{
    for (size_t i = p->first; i < p->first + p->count; i++) {
        const struct noted *n = &d->noted[i];
        if (n->section != section || (name && strcmp(n->array.name, name) != 0))
            continue;
        d->s->line = n->array.line;
        if (section == POINTS && n->array.components != 3)
            return scan_fail(d->s, STATUS_MESH_SYNTAX, "points have %zu components instead of 3", n->array.components);
        return xml_numbers(d->s, &n->array, &d->encoding, (size_t)expected, true, values, count);
    }
    d->s->line = p->line;
    d->s->binary = false;
    return scan_fail(d->s, STATUS_MESH_SYNTAX, "the piece has no array %s in %s", name ? name : "",
                     section_name[section]);
}

static int fetch_label(struct document *d, const struct piece *p, struct vtk_label *label)
{
    for (size_t i = p->first; i < p->first + p->count; i++) {
        const struct noted *n = &d->noted[i];
        double *values;
        size_t count;
        if (n->section != CELL_DATA || n->array.components != 1 || n->array.type == VTK_NONE)
            continue;
        int status = xml_numbers(d->s, &n->array, &d->encoding, (size_t)p->cells, false, &values, &count);
        if (status)
            return status;
        vtk_offer_label(label, n->array.name, values, count);
    }
    return STATUS_OK;
}

/* The wanted arrays of node data of a piece. */
static int fetch_data(struct document *d, const struct piece *p, struct mesh *mesh)
{
    for (size_t i = p->first; i < p->first + p->count; i++) {
        const struct noted *n = &d->noted[i];
        double *values;
        size_t count;
        struct mesh_data *data = n->section == POINT_DATA ? mesh_data_wanted(mesh, n->array.name) : NULL;
        if (!data || n->array.type == VTK_NONE || n->array.components > 9)
            continue;
        int status =
            xml_numbers(d->s, &n->array, &d->encoding, (size_t)p->points * n->array.components, false, &values, &count);
        if (status)
            return status;
        bool good = mesh_data_append(data, n->array.components, values, (size_t)p->points);
        free(values);
        if (!good)
            return scan_fail(d->s, STATUS_MEMORY, "no memory for the data of %zu nodes", (size_t)p->points);
    }
    return STATUS_OK;
}

/* Decoded arrays of a piece. */
struct decoded {
    double *points, *connectivity, *end, *type;
    size_t point_numbers, connectivity_count, ends, types;
    struct vtk_label label;
};

static int decode(struct document *d, const struct piece *p, enum section section, uint64_t cells, struct decoded *a)
{
    int status = fetch(d, p, POINTS, NULL, 3 * p->points, &a->points, &a->point_numbers);
    if (status == STATUS_OK)
        status = fetch(d, p, section, "connectivity", SIZE_MAX, &a->connectivity, &a->connectivity_count);
    if (status == STATUS_OK)
        status = fetch(d, p, section, "offsets", cells, &a->end, &a->ends);
    if (status == STATUS_OK && section == CELLS)
        status = fetch(d, p, section, "types", cells, &a->type, &a->types);
    return status;
}

static int add_volume(struct document *d, const struct piece *p, struct build *build, struct decoded *a)
{
    struct mesh *mesh = build->mesh;
    size_t first = mesh->node_count;
    int status = decode(d, p, CELLS, p->cells, a);
    if (status == STATUS_OK)
        status = fetch_label(d, p, &a->label);
    if (status == STATUS_OK)
        status = fetch_data(d, p, mesh);
    if (status == STATUS_OK)
        status = build_nodes(build, d->s, (size_t)p->points);
    if (status)
        return status;
    memcpy(mesh->nodes + 3 * first, a->points, 3 * (size_t)p->points * sizeof *a->points);
    struct vtk_cells cells = {.count = (size_t)p->cells,
                              .connectivity = a->connectivity,
                              .end = a->end,
                              .type = a->type,
                              .connectivity_count = a->connectivity_count,
                              .first_node = first,
                              .node_count = (size_t)p->points,
                              .label = a->label.values};
    return vtk_add_cells(d->s, build, &cells);
}

static int add_surface(struct document *d, const struct piece *p, struct soup *soup, struct decoded *a)
{
    d->s->line = p->line;
    if (p->strips)
        return scan_fail_remedy(d->s, STATUS_MESH_FORMAT, "export triangles", "the surface has %llu triangle strips",
                                (unsigned long long)p->strips);
    int status = decode(d, p, POLYS, p->polys, a);
    if (status)
        return status;
    struct vtk_polygons polygons = {a->points, (size_t)p->points,    (size_t)p->polys, a->connectivity,
                                    a->end,    a->connectivity_count};
    return vtk_add_polygons(d->s, soup, &polygons);
}

static int add_pieces(struct document *d, struct mesh *mesh, struct soup *soup)
{
    struct build build = {.mesh = mesh};
    int status = STATUS_OK;
    for (size_t i = 0; i < d->piece_count && status == STATUS_OK; i++) {
        const struct piece *p = &d->piece[i];
        struct decoded a = {0};
        d->s->binary = false;
        d->s->line = p->line;
        if (p->points > UINT32_MAX || p->cells > UINT32_MAX || p->polys > UINT32_MAX)
            status = scan_fail(d->s, STATUS_MESH_SYNTAX, "the piece announces %llu points and %llu cells",
                               (unsigned long long)p->points, (unsigned long long)(p->cells + p->polys));
        else
            status = d->is_surface ? add_surface(d, p, soup, &a) : add_volume(d, p, &build, &a);
        free(a.points);
        free(a.connectivity);
        free(a.end);
        free(a.type);
        free(a.label.values);
    }
    if (status == STATUS_OK && !d->is_surface)
        status = build_finish(&build, d->s);
    build_free(&build);
    return status;
}

int read_vtk_xml(struct scan *s, struct mesh *mesh, struct soup *soup, bool *is_surface)
{
    struct document d = {.s = s, .parser = XML_ParserCreate(NULL)};
    size_t appended;
    if (!d.parser)
        return scan_fail(s, STATUS_MEMORY, "no memory for the XML parser");
    XML_SetUserData(d.parser, &d);
    XML_SetElementHandler(d.parser, on_start, on_end);
    XML_SetStartDoctypeDeclHandler(d.parser, on_doctype);
    int status = parse(&d, &appended);
    if (status == STATUS_OK)
        status = locate_appended(&d, appended);
    bool text = true;
    for (size_t i = 0; i < d.noted_count; i++)
        text = text && d.noted[i].array.form == XML_TEXT;
    if (status == STATUS_OK && !text && *d.compressor && strcmp(d.compressor, "vtkZLibDataCompressor") != 0)
        status = failure_set(s->why, STATUS_MESH_FORMAT, s->path, "export with zlib or without compression",
                             "the data are compressed by %.60s", d.compressor);
    if (status == STATUS_OK)
        status = add_pieces(&d, mesh, soup);
    *is_surface = d.is_surface;
    XML_ParserFree(d.parser);
    free(d.piece);
    free(d.noted);
    return status;
}
