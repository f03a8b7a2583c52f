#include "mesh_build.h"

#include <stdlib.h>
#include <string.h>

static int no_memory(struct scan *s)
{
    return scan_fail(s, STATUS_MEMORY, "no memory for the mesh");
}

int build_nodes(struct build *b, struct scan *s, size_t count)
{
    struct mesh *mesh = b->mesh;
    if (count > UINT32_MAX - 1 - mesh->node_count)
        return scan_fail(s, STATUS_MESH_TOO_LARGE, "more than %u nodes", UINT32_MAX - 1);
    size_t wanted = mesh->node_count + count;
    if (wanted > b->node_room || !mesh->nodes) {
        size_t room = wanted > 2 * b->node_room ? wanted : 2 * b->node_room;
        double *nodes = realloc(mesh->nodes, (room ? room : 1) * 3 * sizeof *nodes);
        if (!nodes)
            return no_memory(s);
        mesh->nodes = nodes;
        b->node_room = room;
    }
    memset(mesh->nodes + 3 * mesh->node_count, 0, 3 * count * sizeof *mesh->nodes);
    mesh->node_count = wanted;
    return STATUS_OK;
}

int build_tetrahedron(struct build *b, struct scan *s, const uint32_t corner[4], int32_t label)
{
    struct mesh *mesh = b->mesh;
    size_t n = mesh->tetrahedron_count;
    if (n == b->tetrahedron_room) {
        size_t room = n ? 2 * n : 1024;
        uint32_t *tetrahedra = realloc(mesh->tetrahedra, room * 4 * sizeof *tetrahedra);
        if (!tetrahedra)
            return no_memory(s);
        mesh->tetrahedra = tetrahedra;
        int32_t *labels = realloc(mesh->labels, room * sizeof *labels);
        if (!labels)
            return no_memory(s);
        mesh->labels = labels;
        b->tetrahedron_room = room;
    }
    memcpy(mesh->tetrahedra + 4 * n, corner, 4 * sizeof *corner);
    mesh->labels[n] = label;
    mesh->tetrahedron_count = n + 1;
    return STATUS_OK;
}

int build_name(struct build *b, struct scan *s, int32_t number, const char *name, size_t length)
{
    if (b->name_count == b->name_room) {
        size_t room = b->name_room ? 2 * b->name_room : 16;
        struct mesh_label *larger = realloc(b->name, room * sizeof *larger);
        if (!larger)
            return no_memory(s);
        b->name = larger;
        b->name_room = room;
    }
    struct mesh_label *label = &b->name[b->name_count++];
    memset(label, 0, sizeof *label);
    label->number = number;
    memcpy(label->name, name, length < sizeof label->name - 1 ? length : sizeof label->name - 1);
    return STATUS_OK;
}

int build_refuse(struct scan *s, int64_t element, const struct cell_kind *kind)
{
    return scan_fail_remedy(s, STATUS_MESH_FORMAT, "split such elements into tetrahedra, then export again",
                            "element %lld is a %s", (long long)element, kind->name);
}

static int by_value(const void *a, const void *b)
{
    int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return x < y ? -1 : x > y;
}

static int by_label(const void *a, const void *b)
{
    return by_value(&((const struct mesh_label *)a)->number, &((const struct mesh_label *)b)->number);
}

int build_finish(struct build *b, struct scan *s)
{
    struct mesh *mesh = b->mesh;
    size_t count = mesh->tetrahedron_count;
    if (count == 0)
        return failure_set(s->why, STATUS_MESH_EMPTY, s->path, NULL,
                           "the file has %zu nodes and %zu points, lines or surface elements, but no tetrahedron",
                           mesh->node_count, mesh->ignored_elements);
    int32_t *sorted = malloc(count * sizeof *sorted);
    if (!sorted)
        return no_memory(s);
    memcpy(sorted, mesh->labels, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, by_value);
    size_t distinct = 0;
    for (size_t i = 0; i < count; i++)
        if (i == 0 || sorted[i] != sorted[i - 1])
            sorted[distinct++] = sorted[i];
    mesh->label = calloc(distinct, sizeof *mesh->label);
    if (!mesh->label) {
        free(sorted);
        return no_memory(s);
    }
    mesh->label_count = distinct;
    for (size_t i = 0; i < distinct; i++)
        mesh->label[i].number = sorted[i];
    free(sorted);
    for (size_t i = b->name_count; i-- > 0;) { /* backwards: the first name of a number stays */
        struct mesh_label *label = bsearch(&b->name[i], mesh->label, distinct, sizeof *mesh->label, by_label);
        if (label)
            memcpy(label->name, b->name[i].name, sizeof label->name);
    }
    return STATUS_OK;
}

void build_free(struct build *b)
{
    free(b->name);
    b->name = NULL;
}
