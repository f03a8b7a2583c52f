#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "crc.h"
#include "mesh_build.h"
#include "mesh_node_ids.h"
#include "mesh_readers.h"
#include "progress.h"

/* "count dimension attributes markers", then "number x y z attributes marker" per node. */
static int read_nodes(struct scan *s, struct build *build, struct node_ids *ids)
{
    size_t count;
    int64_t dimension, attributes, markers = 0, number, twice;
    int status = scan_count(s, 8, &count, "nodes");
    if (status == STATUS_OK)
        status = scan_integer(s, 3, 3, &dimension, "the dimension (3)");
    if (status == STATUS_OK)
        status = scan_integer(s, 0, 1000, &attributes, "the number of attributes");
    if (status == STATUS_OK && scan_more_on_line(s))
        status = scan_integer(s, 0, 1, &markers, "the number of boundary markers");
    if (status == STATUS_OK)
        status = build_nodes(build, s, count);
    if (status == STATUS_OK)
        status = node_ids_start(ids, count, s->path, s->why);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        double ignored;
        status = scan_integer(s, 0, INT32_MAX, &number, "the number of a node");
        for (int k = 0; k < 3 && status == STATUS_OK; k++)
            status = scan_double(s, build->mesh->nodes + 3 * i + k, "a coordinate");
        for (int64_t k = 0; k < attributes + markers && status == STATUS_OK; k++)
            status = scan_double(s, &ignored, "an attribute");
        if (status == STATUS_OK)
            node_ids_add(ids, number);
    }
    if (status == STATUS_OK && !node_ids_finish(ids, &twice))
        status = scan_fail(s, STATUS_MESH_SYNTAX, "two nodes have the number %lld", (long long)twice);
    if (status == STATUS_OK && scan_skip(s))
        status = scan_fail(s, STATUS_MESH_SYNTAX, "something follows the last node");
    return status;
}

/* "count corners attributes", then "number corners attributes" per tetrahedron; the first attribute is the region. */
static int read_elements(struct scan *s, struct build *build, const struct node_ids *ids)
{
    size_t count;
    int64_t corners, attributes, number, node;
    int status = scan_count(s, 10, &count, "tetrahedra");
    if (status == STATUS_OK)
        status = scan_integer(s, 4, 10, &corners, "the number of corners");
    if (status == STATUS_OK)
        status = scan_integer(s, 0, 1000, &attributes, "the number of attributes");
    if (status == STATUS_OK && corners != 4 && corners != 10)
        status = scan_fail(s, STATUS_MESH_SYNTAX, "tetrahedra of %lld nodes; 4 or 10 are possible", (long long)corners);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        uint32_t corner[4];
        double attribute, label = 0;
        status = scan_integer(s, 0, INT32_MAX, &number, "the number of a tetrahedron");
        for (int64_t k = 0; k < corners && status == STATUS_OK; k++) {
            status = scan_integer(s, INT32_MIN, INT32_MAX, &node, "a corner");
            if (status || k >= 4)
                continue;
            corner[k] = node_ids_place(ids, node);
            if (corner[k] == UINT32_MAX)
                status = scan_fail(s, STATUS_MESH_INDEX, "tetrahedron %lld names node %lld, which does not exist",
                                   (long long)number, (long long)node);
        }
        for (int64_t k = 0; k < attributes && status == STATUS_OK; k++) {
            status = scan_double(s, &attribute, "an attribute");
            if (k == 0 && status == STATUS_OK && attribute == floor(attribute) && fabs(attribute) <= INT32_MAX)
                label = attribute;
        }
        if (status == STATUS_OK)
            status = build_tetrahedron(build, s, corner, (int32_t)label);
    }
    if (status == STATUS_OK && scan_skip(s))
        status = scan_fail(s, STATUS_MESH_SYNTAX, "something follows the last tetrahedron");
    return status;
}

int read_tetgen(struct scan *s, struct mesh *mesh)
{
    bool given_nodes = mesh_has_extension(s->path, ".node");
    size_t stem = strlen(s->path) - strlen(given_nodes ? ".node" : ".ele");
    char *path = malloc(stem + sizeof ".node");
    if (!path)
        return scan_fail(s, STATUS_MEMORY, "no memory for a path");
    memcpy(path, s->path, stem);
    strcpy(path + stem, given_nodes ? ".ele" : ".node");
    unsigned char *bytes;
    size_t length;
    int status = file_load(path, &bytes, &length, s->why);
    if (status) {
        if (status == STATUS_FILE_OPEN)
            snprintf(s->why->remedy, sizeof s->why->remedy, "TetGen meshes are a .node and an .ele file side by side");
        free(path);
        return status;
    }
    struct scan other = scan_start(path, bytes, length, s->why), *nodes = given_nodes ? s : &other,
                *elements = given_nodes ? &other : s;
    struct build build = {.mesh = mesh};
    struct node_ids ids = {0};
    nodes->comment = elements->comment = '#';
    status = read_nodes(nodes, &build, &ids);
    if (status == STATUS_OK)
        status = read_elements(elements, &build, &ids);
    if (status == STATUS_OK)
        status = build_finish(&build, elements);
    mesh->file_hash = crc32_update(crc32_update(0, nodes->bytes, nodes->length), elements->bytes, elements->length);
    build_free(&build);
    node_ids_free(&ids);
    free(bytes);
    free(path);
    return status;
}
