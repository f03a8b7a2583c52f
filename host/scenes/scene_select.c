#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scene_keys.h"

const char *scene_place(const struct scene *scene)
{
    return scene->path[0] ? scene->path : "the assumed scene";
}

bool scene_label_matches(const struct mesh_label *label, const char *text)
{
    if (label->name[0] && strcmp(label->name, text) == 0)
        return true;
    char *end;
    long number = strtol(text, &end, 10);
    return end != text && !*end && number == label->number;
}

void scene_list_labels(const struct mesh *mesh, char *text, size_t size)
{
    size_t used = 0;
    text[0] = 0;
    for (size_t i = 0; i < mesh->label_count && used < size; i++) {
        const struct mesh_label *label = &mesh->label[i];
        used += (size_t)snprintf(text + used, size - used, "%s%d", i ? ", " : "", (int)label->number);
        if (label->name[0] && used < size)
            used += (size_t)snprintf(text + used, size - used, " '%s'", label->name);
    }
}

/* Surface vertices by how far they are: key ascending, then number. */
struct ranked {
    double key;
    uint32_t vertex;
};

static int by_key(const void *a, const void *b)
{
    const struct ranked *p = a, *q = b;
    if (p->key != q->key)
        return p->key < q->key ? -1 : 1;
    return (p->vertex > q->vertex) - (p->vertex < q->vertex);
}

/* Bounding box; returns the longest axis and its length. */
static int span(const struct mesh *mesh, double low[3], double high[3], double *extent)
{
    int axis = 0;
    *extent = -1;
    for (int i = 0; i < 3; i++) {
        low[i] = INFINITY;
        high[i] = -INFINITY;
        for (size_t n = 0; n < mesh->node_count; n++) {
            low[i] = fmin(low[i], mesh->nodes[3 * n + i]);
            high[i] = fmax(high[i], mesh->nodes[3 * n + i]);
        }
        if (high[i] - low[i] > *extent) {
            *extent = high[i] - low[i];
            axis = i;
        }
    }
    return axis;
}

/* PATCH and AXIS_END: a share of the surface vertices. */
static int select_share(const struct selection *s, const struct mesh *mesh, const struct surface *surface, bool *inside,
                        int axis, double tie, struct failure *why)
{
    size_t total = surface->vertex_count;
    struct ranked *rank = malloc((total ? total : 1) * sizeof *rank);
    if (!rank)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to rank %zu vertices", total);
    for (size_t v = 0; v < total; v++) {
        const double *x = &mesh->nodes[3 * (size_t)surface->node[v]];
        double d[3] = {x[0] - s->a[0], x[1] - s->a[1], x[2] - s->a[2]};
        rank[v] = (struct ranked){s->kind == SELECT_AXIS_END ? x[axis] : d[0] * d[0] + d[1] * d[1] + d[2] * d[2],
                                  (uint32_t)v};
    }
    qsort(rank, total, sizeof *rank, by_key);
    /* 1e-9: a share like 4 % of 25 must not be rounded up to 2 by its own rounding */
    size_t wanted = (size_t)ceil(s->value * (double)total - 1e-9);
    if (wanted < 1)
        wanted = 1;
    for (size_t k = 0; k < total; k++)
        if (k < wanted || (s->kind == SELECT_AXIS_END && rank[k].key <= rank[wanted - 1].key + tie))
            inside[surface->node[rank[k].vertex]] = true;
    free(rank);
    return STATUS_OK;
}

static int select_label(const struct selection *s, const struct scene *scene, const struct mesh *mesh, bool *inside,
                        struct failure *why)
{
    bool known = false;
    for (size_t i = 0; i < mesh->label_count; i++) {
        if (!scene_label_matches(&mesh->label[i], s->label))
            continue;
        known = true;
        for (size_t e = 0; e < mesh->tetrahedron_count; e++)
            for (int k = 0; k < 4 && mesh->labels[e] == mesh->label[i].number; k++)
                inside[mesh->tetrahedra[4 * e + k]] = true;
    }
    if (known)
        return STATUS_OK;
    char labels[200];
    scene_list_labels(mesh, labels, sizeof labels);
    return failure_at(why, STATUS_SCENE_SELECTION, scene_place(scene), s->line, "name a label of the mesh",
                      "the mesh has no label '%s'; it has: %s", s->label, labels);
}

/* `slack`: what scaling to metres may have moved a node by. */
static bool holds(const struct selection *s, const double x[3], double slack)
{
    double d[3] = {x[0] - s->a[0], x[1] - s->a[1], x[2] - s->a[2]};
    switch (s->kind) {
    case SELECT_BOX:
        for (int i = 0; i < 3; i++)
            if (x[i] < s->a[i] - slack || x[i] > s->b[i] + slack)
                return false;
        return true;
    case SELECT_SPHERE:
        return d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= (s->value + slack) * (s->value + slack);
    case SELECT_PLANE:
        return d[0] * s->b[0] + d[1] * s->b[1] + d[2] * s->b[2] >= -slack;
    default:
        return false;
    }
}

int scene_select(const struct selection *selection, const struct scene *scene, const struct mesh *mesh,
                 const struct surface *surface, bool *inside, size_t *count, struct failure *why)
{
    static const char *const name[] = {"box", "sphere", "plane", "label", "patch", "axis_end"};
    int status = STATUS_OK;
    double low[3], high[3], extent;
    int axis = span(mesh, low, high, &extent);
    memset(inside, 0, mesh->node_count * sizeof *inside);
    *count = 0;
    if (selection->kind == SELECT_LABEL)
        status = select_label(selection, scene, mesh, inside, why);
    else if (selection->kind == SELECT_PATCH || selection->kind == SELECT_AXIS_END)
        status = select_share(selection, mesh, surface, inside, axis, 1e-6 * extent, why);
    else
        for (size_t n = 0; n < mesh->node_count; n++)
            inside[n] = holds(selection, &mesh->nodes[3 * n], 1e-9 * extent);
    if (status)
        return status;
    for (size_t n = 0; n < mesh->node_count; n++)
        *count += inside[n];
    if (*count)
        return STATUS_OK;
    return failure_at(why, STATUS_SCENE_SELECTION, scene_place(scene), selection->line, NULL,
                      "%s holds no node; the body spans [%.4g, %.4g, %.4g] to [%.4g, %.4g, %.4g] m",
                      name[selection->kind], low[0], low[1], low[2], high[0], high[1], high[2]);
}
