/* $NodeData: string tags (the first is the name), real tags, integer tags (step, components, count), then a line or record
 * per node. https://gmsh.info/doc/texinfo/gmsh.html, "MSH file format". */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh_data.h"
#include "read_gmsh.h"

enum { MOST_COMPONENTS = 9 };

/* The name of the array: the first of the tags in double quotes. */
static int read_strings(struct gmsh *g, char name[64])
{
    struct scan *s = g->s;
    size_t count;
    int status = scan_count(s, 2, &count, "string tags");
    *name = 0;
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        if (!scan_skip(s) || s->bytes[s->at] != '"')
            return scan_fail(s, STATUS_MESH_SYNTAX, "a name in double quotes should stand here");
        const char *open = (const char *)s->bytes + s->at + 1;
        scan_next_line(s);
        const char *close = memrchr(open, '"', (size_t)((const char *)s->bytes + s->at - open));
        if (!close)
            return scan_fail(s, STATUS_MESH_SYNTAX, "a name has no closing quote");
        if (i == 0)
            snprintf(name, 64, "%.*s", close - open < 63 ? (int)(close - open) : 63, open);
    }
    return status;
}

static int read_values(struct gmsh *g, size_t components, size_t count, double *value)
{
    struct scan *s = g->s;
    int status = g->binary ? gmsh_begin_binary(g) : STATUS_OK;
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        int64_t number = 0;
        int32_t short_number = 0;
        double ignored, row[MOST_COMPONENTS] = {0};
        if (g->binary) {
            status = scan_i32(s, &short_number, "a node");
            number = short_number;
        } else {
            status = scan_integer(s, INT32_MIN, INT64_MAX / 2, &number, "the number of a node");
        }
        for (size_t k = 0; k < components && status == STATUS_OK; k++) {
            double *to = k < MOST_COMPONENTS ? &row[k] : &ignored;
            status = g->binary ? scan_f64(s, to, "a value") : scan_double(s, to, "a value");
        }
        if (status)
            break;
        uint32_t place = node_ids_place(&g->ids, number);
        if (place == UINT32_MAX)
            return scan_fail(s, STATUS_MESH_INDEX, "a value is given to node %lld, which does not exist",
                             (long long)number);
        if (value)
            memcpy(value + components * place, row, components * sizeof *row);
    }
    return status;
}

int gmsh_node_data(struct gmsh *g)
{
    struct scan *s = g->s;
    struct mesh *mesh = g->build.mesh;
    char name[64];
    size_t reals;
    int64_t integers, tag[3] = {0, 0, 0};
    double ignored;
    if (!g->have_nodes)
        return scan_fail(s, STATUS_MESH_SYNTAX, "data of nodes stand before the nodes");
    int status = read_strings(g, name);
    if (status == STATUS_OK)
        status = scan_count(s, 2, &reals, "real tags");
    for (size_t i = 0; status == STATUS_OK && i < reals; i++)
        status = scan_double(s, &ignored, "a real tag");
    if (status == STATUS_OK)
        status = scan_integer(s, 3, 100, &integers, "the number of integer tags");
    for (int64_t i = 0; status == STATUS_OK && i < integers; i++) {
        int64_t value;
        status = scan_integer(s, 0, INT64_MAX / 2, &value, "an integer tag");
        if (i < 3)
            tag[i] = value;
    }
    if (status == STATUS_OK)
        status = scan_fits(s, (uint64_t)tag[2], g->binary ? 4 : 2, "values");
    if (status)
        return status;
    struct mesh_data *data = mesh_data_wanted(mesh, name);
    if (!data || data->value || tag[1] < 1 || tag[1] > MOST_COMPONENTS)
        return read_values(g, (size_t)tag[1], (size_t)tag[2], NULL);
    size_t all = (size_t)tag[1] * mesh->node_count;
    double *value = malloc((all + 1) * sizeof *value);
    if (!value)
        return scan_fail(s, STATUS_MEMORY, "no memory for the data of %zu nodes", mesh->node_count);
    for (size_t i = 0; i < all; i++)
        value[i] = NAN;
    status = read_values(g, (size_t)tag[1], (size_t)tag[2], value);
    if (status == STATUS_OK && !mesh_data_append(data, (size_t)tag[1], value, mesh->node_count))
        status = scan_fail(s, STATUS_MEMORY, "no memory for the data of %zu nodes", mesh->node_count);
    free(value);
    s->binary = g->binary;
    return status;
}
