/* Version 4.1: nodes and elements stand in blocks, one per geometrical entity; the physical group hangs on the entity.
 */
#include <stdlib.h>

#include "read_gmsh.h"

enum { MOST_NODES = 125 };

/* A number that is an int in binary files, and one that is a size_t there. */
static int small(struct gmsh *g, int64_t *value, const char *what)
{
    int32_t x = 0;
    if (!g->binary)
        return scan_integer(g->s, INT32_MIN, INT32_MAX, value, what);
    int status = scan_i32(g->s, &x, what);
    *value = x;
    return status;
}

static int large(struct gmsh *g, int64_t *value, const char *what)
{
    uint64_t x = 0;
    if (!g->binary)
        return scan_integer(g->s, 0, INT64_MAX / 2, value, what);
    int status = scan_u64(g->s, &x, what);
    if (status == STATUS_OK && x > INT64_MAX / 2)
        return scan_fail(g->s, STATUS_MESH_SYNTAX, "%s is out of its range", what);
    *value = (int64_t)x;
    return status;
}

static int coordinate(struct gmsh *g, double *value)
{
    return g->binary ? scan_f64(g->s, value, "a coordinate") : scan_double(g->s, value, "a coordinate");
}

static int begin(struct gmsh *g)
{
    return g->binary ? gmsh_begin_binary(g) : STATUS_OK;
}

static int read_entity(struct gmsh *g, int dimension, struct gmsh_entity *entity)
{
    double ignored;
    int64_t tag, count, value;
    int status = small(g, &tag, "the tag of an entity");
    for (int k = 0; k < (dimension == 0 ? 3 : 6) && status == STATUS_OK; k++)
        status = coordinate(g, &ignored);
    *entity = (struct gmsh_entity){.tag = tag};
    for (int list = 0; list < (dimension == 0 ? 1 : 2) && status == STATUS_OK; list++) { /* groups, then boundary */
        status = large(g, &count, "the length of a list");
        if (status == STATUS_OK)
            status = scan_fits(g->s, (uint64_t)count, g->binary ? 4 : 2, "tags");
        for (int64_t i = 0; i < count && status == STATUS_OK; i++) {
            status = small(g, &value, "a tag of an entity");
            if (list == 0 && i == 0 && status == STATUS_OK)
                entity->physical = (int32_t)value;
        }
    }
    return status;
}

static int by_tag(const void *a, const void *b)
{
    const struct gmsh_entity *x = a, *y = b;
    return x->tag < y->tag ? -1 : x->tag > y->tag;
}

int gmsh4_entities(struct gmsh *g)
{
    struct scan *s = g->s;
    int64_t count[4];
    int status = begin(g);
    for (int d = 0; d < 4 && status == STATUS_OK; d++) {
        status = large(g, &count[d], "the number of entities");
        if (status == STATUS_OK)
            status = scan_fits(s, (uint64_t)count[d], g->binary ? 36 : 10, "entities");
    }
    if (status)
        return status;
    g->volume = calloc((size_t)count[3] + 1, sizeof *g->volume);
    if (!g->volume)
        return scan_fail(s, STATUS_MEMORY, "no memory for %lld volumes", (long long)count[3]);
    for (int d = 0; d < 4 && status == STATUS_OK; d++)
        for (int64_t i = 0; i < count[d] && status == STATUS_OK; i++) {
            struct gmsh_entity entity;
            status = read_entity(g, d, &entity);
            if (d == 3 && status == STATUS_OK)
                g->volume[g->volume_count++] = entity;
        }
    qsort(g->volume, g->volume_count, sizeof *g->volume, by_tag);
    s->binary = g->binary;
    return status;
}

static int read_node_block(struct gmsh *g, size_t left, size_t *count)
{
    struct scan *s = g->s;
    int64_t dimension, tag, parametric, block, number;
    int status = small(g, &dimension, "the dimension of a block of nodes");
    if (status == STATUS_OK)
        status = small(g, &tag, "the entity of a block of nodes");
    if (status == STATUS_OK)
        status = small(g, &parametric, "the parametric mark of a block of nodes");
    if (status == STATUS_OK)
        status = large(g, &block, "the number of nodes of a block");
    if (status)
        return status;
    if (dimension < 0 || dimension > 3 || parametric < 0 || parametric > 1 || (uint64_t)block > left)
        return scan_fail(s, STATUS_MESH_SYNTAX, "a block of %lld nodes of dimension %lld where %zu nodes are left",
                         (long long)block, (long long)dimension, left);
    for (int64_t i = 0; i < block && status == STATUS_OK; i++) {
        status = large(g, &number, "the number of a node");
        if (status == STATUS_OK)
            node_ids_add(&g->ids, number);
    }
    for (int64_t i = 0; i < block && status == STATUS_OK; i++) {
        double *x = g->build.mesh->nodes + 3 * (*count + (size_t)i), ignored;
        for (int k = 0; k < 3 && status == STATUS_OK; k++)
            status = coordinate(g, x + k);
        for (int64_t k = 0; k < (parametric ? dimension : 0) && status == STATUS_OK; k++)
            status = coordinate(g, &ignored);
    }
    *count += (size_t)block;
    return status;
}

/* The head of both sections: blocks, things, lowest and highest number. */
static int read_head(struct gmsh *g, size_t bytes_each, const char *what, int64_t *blocks, size_t *count)
{
    int64_t value[4] = {0};
    int status = begin(g);
    for (int k = 0; k < 4 && status == STATUS_OK; k++)
        status = large(g, &value[k], what);
    if (status == STATUS_OK)
        status = scan_fits(g->s, (uint64_t)value[0], g->binary ? 20 : 8, "blocks");
    if (status == STATUS_OK)
        status = scan_fits(g->s, (uint64_t)value[1], bytes_each, what);
    *blocks = value[0];
    *count = (size_t)value[1];
    return status;
}

int gmsh4_nodes(struct gmsh *g)
{
    struct scan *s = g->s;
    int64_t blocks;
    size_t count, done = 0;
    int status = read_head(g, g->binary ? 32 : 8, "nodes", &blocks, &count);
    if (status == STATUS_OK)
        status = build_nodes(&g->build, s, count);
    if (status == STATUS_OK)
        status = node_ids_start(&g->ids, count, s->path, s->why);
    for (int64_t i = 0; i < blocks && status == STATUS_OK; i++)
        status = read_node_block(g, count - done, &done);
    if (status == STATUS_OK && done != count)
        status = scan_fail(s, STATUS_MESH_SYNTAX, "the blocks hold %zu of the %zu nodes announced", done, count);
    s->binary = g->binary;
    return status ? status : gmsh_finish_nodes(g);
}

static int read_element_block(struct gmsh *g, size_t left, size_t *count)
{
    struct scan *s = g->s;
    int64_t dimension, tag, type, block, number, node[MOST_NODES];
    int status = small(g, &dimension, "the dimension of a block of elements");
    if (status == STATUS_OK)
        status = small(g, &tag, "the entity of a block of elements");
    if (status == STATUS_OK)
        status = small(g, &type, "the type of a block of elements");
    if (status == STATUS_OK)
        status = large(g, &block, "the number of elements of a block");
    if (status)
        return status;
    const struct cell_kind *kind = gmsh_kind(type);
    if (!kind)
        return scan_fail(s, STATUS_MESH_FORMAT, "elements of type %lld, which is not known", (long long)type);
    if ((uint64_t)block > left)
        return scan_fail(s, STATUS_MESH_SYNTAX, "a block of %lld elements where %zu elements are left",
                         (long long)block, left);
    struct gmsh_entity key = {.tag = tag}, *volume = NULL;
    if (g->volume && kind->use == CELL_TETRAHEDRON)
        volume = bsearch(&key, g->volume, g->volume_count, sizeof key, by_tag);
    for (int64_t i = 0; i < block && status == STATUS_OK; i++) {
        status = large(g, &number, "the number of an element");
        for (int k = 0; k < kind->nodes && status == STATUS_OK; k++)
            status = large(g, &node[k], "a node of an element");
        if (status == STATUS_OK)
            status = gmsh_element(g, kind, number, node, volume ? volume->physical : 0);
    }
    *count += (size_t)block;
    return status;
}

int gmsh4_elements(struct gmsh *g)
{
    struct scan *s = g->s;
    int64_t blocks;
    size_t count, done = 0;
    g->have_elements = true;
    int status = read_head(g, g->binary ? 16 : 3, "elements", &blocks, &count);
    for (int64_t i = 0; i < blocks && status == STATUS_OK; i++)
        status = read_element_block(g, count - done, &done);
    if (status == STATUS_OK && done != count)
        status = scan_fail(s, STATUS_MESH_SYNTAX, "the blocks hold %zu of the %zu elements announced", done, count);
    s->binary = g->binary;
    return status;
}
