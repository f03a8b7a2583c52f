#include "read_gmsh.h"

#include <stdlib.h>
#include <string.h>

#include "mesh_readers.h"

enum { MOST_NODES = 125 }; /* of one element: type 92, a hexahedron of order 4 */

static const struct cell_kind kinds[] = {
    [1] = {CELL_IGNORED, 2, "line"},
    [2] = {CELL_IGNORED, 3, "triangle"},
    [3] = {CELL_IGNORED, 4, "quadrangle"},
    [4] = {CELL_TETRAHEDRON, 4, "tetrahedron"},
    [5] = {CELL_REFUSED, 8, "hexahedron"},
    [6] = {CELL_REFUSED, 6, "prism"},
    [7] = {CELL_REFUSED, 5, "pyramid"},
    [8] = {CELL_IGNORED, 3, "line"},
    [9] = {CELL_IGNORED, 6, "triangle"},
    [10] = {CELL_IGNORED, 9, "quadrangle"},
    [11] = {CELL_TETRAHEDRON, 10, "tetrahedron"},
    [12] = {CELL_REFUSED, 27, "hexahedron"},
    [13] = {CELL_REFUSED, 18, "prism"},
    [14] = {CELL_REFUSED, 14, "pyramid"},
    [15] = {CELL_IGNORED, 1, "point"},
    [16] = {CELL_IGNORED, 8, "quadrangle"},
    [17] = {CELL_REFUSED, 20, "hexahedron"},
    [18] = {CELL_REFUSED, 15, "prism"},
    [19] = {CELL_REFUSED, 13, "pyramid"},
    [20] = {CELL_IGNORED, 9, "triangle"},
    [21] = {CELL_IGNORED, 10, "triangle"},
    [22] = {CELL_IGNORED, 12, "triangle"},
    [23] = {CELL_IGNORED, 15, "triangle"},
    [24] = {CELL_IGNORED, 15, "triangle"},
    [25] = {CELL_IGNORED, 21, "triangle"},
    [26] = {CELL_IGNORED, 4, "line"},
    [27] = {CELL_IGNORED, 5, "line"},
    [28] = {CELL_IGNORED, 6, "line"},
    [29] = {CELL_TETRAHEDRON, 20, "tetrahedron"},
    [30] = {CELL_TETRAHEDRON, 35, "tetrahedron"},
    [31] = {CELL_TETRAHEDRON, 56, "tetrahedron"},
    [92] = {CELL_REFUSED, 64, "hexahedron"},
    [93] = {CELL_REFUSED, 125, "hexahedron"},
};

const struct cell_kind *gmsh_kind(int64_t type)
{
    if (type < 0 || type >= (int64_t)(sizeof kinds / sizeof kinds[0]) || kinds[type].use == CELL_UNKNOWN)
        return NULL;
    return &kinds[type];
}

int gmsh_element(struct gmsh *g, const struct cell_kind *kind, int64_t number, const int64_t *node, int32_t label)
{
    struct scan *s = g->s;
    if (kind->use == CELL_REFUSED)
        return build_refuse(s, number, kind);
    if (kind->use == CELL_IGNORED) {
        g->build.mesh->ignored_elements++;
        return STATUS_OK;
    }
    uint32_t corner[4];
    for (int k = 0; k < 4; k++) {
        corner[k] = node_ids_place(&g->ids, node[k]);
        if (corner[k] == UINT32_MAX)
            return scan_fail(s, STATUS_MESH_INDEX, "element %lld names node %lld, which does not exist",
                             (long long)number, (long long)node[k]);
    }
    return build_tetrahedron(&g->build, s, corner, label);
}

int gmsh_finish_nodes(struct gmsh *g)
{
    int64_t twice;
    g->have_nodes = true;
    if (!node_ids_finish(&g->ids, &twice))
        return scan_fail(g->s, STATUS_MESH_SYNTAX, "two nodes have the number %lld", (long long)twice);
    return STATUS_OK;
}

int gmsh_begin_binary(struct gmsh *g)
{
    struct scan *s = g->s;
    if (scan_more_on_line(s) || s->at >= s->length)
        return scan_fail(s, STATUS_MESH_SYNTAX, "binary data should begin on the next line");
    scan_next_line(s);
    s->binary = true;
    return STATUS_OK;
}

static int read_format(struct gmsh *g)
{
    struct scan *s = g->s;
    double version;
    int64_t type, size;
    int status = scan_double(s, &version, "the format's version");
    if (status == STATUS_OK)
        status = scan_integer(s, 0, 1, &type, "the file type (0 text, 1 binary)");
    if (status == STATUS_OK)
        status = scan_integer(s, 1, 16, &size, "the size of a number");
    if (status)
        return status;
    g->generation = (int)version;
    g->binary = type == 1;
    if (!(version >= 2 && version < 3) && version != 4.1)
        return scan_fail_remedy(s, STATUS_MESH_FORMAT, "save it as version 2.2 or 4.1",
                                "this is version %g of the Gmsh format; 1, 2 and 4.1 are read", version);
    if (size != 8)
        return scan_fail(s, STATUS_MESH_FORMAT, "numbers of %d bytes; 8 are read", (int)size);
    if (!g->binary)
        return STATUS_OK;
    int32_t one;
    status = gmsh_begin_binary(g);
    if (status == STATUS_OK)
        status = scan_i32(s, &one, "the mark of the byte order");
    if (status)
        return status;
    if (one != 1) {
        swap_bytes(&one, sizeof one);
        if (one != 1)
            return scan_fail(s, STATUS_MESH_SYNTAX, "the mark of the byte order is not 1 in either order");
        s->swap = true;
    }
    s->binary = g->binary;
    return STATUS_OK;
}

static int read_names(struct gmsh *g)
{
    struct scan *s = g->s;
    size_t count;
    int status = scan_count(s, 6, &count, "physical names");
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        int64_t dimension, number;
        status = scan_integer(s, 0, 3, &dimension, "the dimension of a physical group");
        if (status == STATUS_OK)
            status = scan_integer(s, INT32_MIN, INT32_MAX, &number, "the number of a physical group");
        if (status)
            break;
        const char *open = NULL, *close = NULL;
        if (scan_more_on_line(s) && s->bytes[s->at] == '"') {
            open = (const char *)s->bytes + s->at + 1;
            scan_next_line(s);
            close = memrchr(open, '"', (size_t)((const char *)s->bytes + s->at - open));
        }
        if (!close)
            return scan_fail(s, STATUS_MESH_SYNTAX, "a name in double quotes should follow the physical group");
        if (dimension == 3)
            status = build_name(&g->build, s, (int32_t)number, open, (size_t)(close - open));
    }
    return status;
}

static int read_nodes(struct gmsh *g)
{
    struct scan *s = g->s;
    bool binary = g->binary && g->generation == 2;
    size_t count;
    int status = scan_count(s, binary ? 28 : 8, &count, "nodes");
    if (status == STATUS_OK && binary)
        status = gmsh_begin_binary(g);
    if (status == STATUS_OK)
        status = build_nodes(&g->build, s, count);
    if (status == STATUS_OK)
        status = node_ids_start(&g->ids, count, s->path, s->why);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        double *x = g->build.mesh->nodes + 3 * i;
        int64_t number = 0;
        int32_t short_number = 0;
        if (binary) {
            status = scan_i32(s, &short_number, "a node");
            number = short_number;
        } else {
            status = scan_integer(s, INT32_MIN, INT64_MAX / 2, &number, "the number of a node");
        }
        for (int k = 0; k < 3 && status == STATUS_OK; k++)
            status = binary ? scan_f64(s, x + k, "a coordinate") : scan_double(s, x + k, "a coordinate");
        if (status == STATUS_OK)
            node_ids_add(&g->ids, number);
    }
    s->binary = g->binary;
    return status ? status : gmsh_finish_nodes(g);
}

/* Version 1: number type physical elementary node-count nodes. Version 2: number type tag-count tags nodes. */
static int read_text_element(struct gmsh *g)
{
    struct scan *s = g->s;
    int64_t number, type, tags = 2, label = 0, node[MOST_NODES], nodes;
    int status = scan_integer(s, INT32_MIN, INT64_MAX, &number, "the number of an element");
    if (status == STATUS_OK)
        status = scan_integer(s, INT32_MIN, INT32_MAX, &type, "the type of an element");
    if (status)
        return status;
    const struct cell_kind *kind = gmsh_kind(type);
    if (!kind)
        return scan_fail(s, STATUS_MESH_FORMAT, "element %lld has type %lld, which is not known", (long long)number,
                         (long long)type);
    if (g->generation == 2)
        status = scan_integer(s, 0, 1000, &tags, "the number of tags");
    for (int64_t i = 0; i < tags && status == STATUS_OK; i++) {
        int64_t tag;
        status = scan_integer(s, INT32_MIN, INT32_MAX, &tag, "a tag of an element");
        if (i == 0 && status == STATUS_OK)
            label = tag;
    }
    if (g->generation == 1 && status == STATUS_OK) {
        status = scan_integer(s, INT32_MIN, INT32_MAX, &nodes, "the number of nodes of an element");
        if (status == STATUS_OK && nodes != kind->nodes)
            return scan_fail(s, STATUS_MESH_SYNTAX, "element %lld is a %s with %lld nodes instead of %d",
                             (long long)number, kind->name, (long long)nodes, kind->nodes);
    }
    for (int k = 0; k < kind->nodes && status == STATUS_OK; k++)
        status = scan_integer(s, INT64_MIN, INT64_MAX, &node[k], "a node of an element");
    return status ? status : gmsh_element(g, kind, number, node, (int32_t)label);
}

/* Blocks: type, how many, tags each; then per element number, tags, nodes. */
static int read_binary_elements(struct gmsh *g, size_t count)
{
    struct scan *s = g->s;
    int status = gmsh_begin_binary(g);
    for (size_t done = 0; done < count && status == STATUS_OK;) {
        int32_t type, block, tags;
        status = scan_i32(s, &type, "the head of a block of elements");
        if (status == STATUS_OK)
            status = scan_i32(s, &block, "the head of a block of elements");
        if (status == STATUS_OK)
            status = scan_i32(s, &tags, "the head of a block of elements");
        if (status)
            return status;
        const struct cell_kind *kind = gmsh_kind(type);
        if (!kind)
            return scan_fail(s, STATUS_MESH_FORMAT, "elements of type %d, which is not known", type);
        if (block < 1 || (size_t)block > count - done || tags < 0 || tags > 1000)
            return scan_fail(s, STATUS_MESH_SYNTAX, "a block of %d elements with %d tags where %zu elements are left",
                             block, tags, count - done);
        for (int32_t i = 0; i < block && status == STATUS_OK; i++) {
            int32_t number, value, label = 0;
            int64_t node[MOST_NODES];
            status = scan_i32(s, &number, "an element");
            for (int32_t k = 0; k < tags + kind->nodes && status == STATUS_OK; k++) {
                status = scan_i32(s, &value, "an element");
                if (status == STATUS_OK && k == 0 && tags > 0)
                    label = value;
                if (status == STATUS_OK && k >= tags)
                    node[k - tags] = value;
            }
            if (status == STATUS_OK)
                status = gmsh_element(g, kind, number, node, label);
        }
        done += (size_t)block;
    }
    s->binary = g->binary;
    return status;
}

static int read_elements(struct gmsh *g)
{
    struct scan *s = g->s;
    bool binary = g->binary && g->generation == 2;
    size_t count;
    int status = scan_count(s, 6, &count, "elements");
    g->have_elements = true;
    if (status == STATUS_OK && binary)
        return read_binary_elements(g, count);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = read_text_element(g);
    return status;
}

/* Skip a section that is of no use here, text or binary, to its end mark. */
static int skip_section(struct gmsh *g, const char *name)
{
    struct scan *s = g->s;
    char end[80];
    snprintf(end, sizeof end, "$End%.60s", name + 1);
    const unsigned char *from = s->bytes + s->at;
    const unsigned char *found = memmem(from, s->length - s->at, end, strlen(end));
    if (!found)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the section %.60s has no end", name);
    for (; from < found; from++)
        s->line += *from == '\n';
    s->at = (size_t)(found - s->bytes);
    return STATUS_OK;
}

static int read_section(struct gmsh *g, const char *name)
{
    struct scan *s = g->s;
    if (strcmp(name, "$MeshFormat") == 0)
        return g->generation ? scan_fail(s, STATUS_MESH_SYNTAX, "a second $MeshFormat") : read_format(g);
    bool first = strcmp(name, "$NOD") == 0 || strcmp(name, "$ELM") == 0;
    bool nodes = strcmp(name, "$NOD") == 0 || strcmp(name, "$Nodes") == 0;
    bool elements = strcmp(name, "$ELM") == 0 || strcmp(name, "$Elements") == 0;
    if (first && g->generation == 0)
        g->generation = 1;
    if (strcmp(name, "$Comments") == 0)
        return skip_section(g, name);
    if (g->generation == 0 || first != ((nodes || elements) && g->generation == 1))
        return scan_fail(s, STATUS_MESH_SYNTAX, "the section %.60s does not belong to version %d of the format", name,
                         g->generation);
    if ((nodes && g->have_nodes) || (elements && g->have_elements))
        return scan_fail(s, STATUS_MESH_SYNTAX, "a second section %.60s", name);
    if (elements && !g->have_nodes)
        return scan_fail(s, STATUS_MESH_SYNTAX, "elements stand before the nodes");
    if (nodes)
        return g->generation == 4 ? gmsh4_nodes(g) : read_nodes(g);
    if (elements)
        return g->generation == 4 ? gmsh4_elements(g) : read_elements(g);
    if (strcmp(name, "$PhysicalNames") == 0)
        return read_names(g);
    if (strcmp(name, "$Entities") == 0 && g->generation == 4 && !g->volume)
        return gmsh4_entities(g);
    if (strcmp(name, "$NodeData") == 0 && g->build.mesh->data_count)
        return gmsh_node_data(g);
    return skip_section(g, name);
}

int read_gmsh(struct scan *s, struct mesh *mesh)
{
    struct gmsh g = {.s = s, .build = {.mesh = mesh}};
    int status = STATUS_OK;
    while (status == STATUS_OK && scan_skip(s)) {
        char name[64], end[80], found[64];
        status = scan_word(s, name, sizeof name, "a section");
        if (status == STATUS_OK && name[0] != '$')
            status = scan_fail(s, STATUS_MESH_SYNTAX, "\"%.30s\" stands where a section should begin", name);
        if (status == STATUS_OK)
            status = read_section(&g, name);
        if (status)
            break;
        snprintf(end, sizeof end, g.generation == 1 && strcmp(name, "$Comments") ? "$END%.60s" : "$End%.60s", name + 1);
        status = scan_word(s, found, sizeof found, end);
        if (status == STATUS_OK && strcmp(found, end) != 0)
            status = scan_fail(s, STATUS_MESH_SYNTAX, "\"%.30s\" stands where %s should", found, end);
    }
    if (status == STATUS_OK && !g.have_elements)
        status = scan_fail(s, STATUS_MESH_SYNTAX, "the file ends before its elements");
    if (status == STATUS_OK)
        status = build_finish(&g.build, s);
    build_free(&g.build);
    node_ids_free(&g.ids);
    free(g.volume);
    return status;
}
