#include "holding.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool hold(struct holding *holding, size_t node, const double direction[3])
{
    if (holding->supports == holding->room) {
        size_t room = 2 * holding->room + 256;
        struct support *larger = realloc(holding->support, room * sizeof *larger);
        if (!larger)
            return false;
        holding->support = larger;
        holding->room = room;
    }
    struct support *support = &holding->support[holding->supports++];
    support->node = (uint32_t)node;
    memcpy(support->direction, direction, sizeof support->direction);
    return true;
}

static int fix(const struct scene *scene, const struct space *space, const struct surface *surface, const char *place,
               bool *inside, struct holding *holding, struct failure *why)
{
    const struct mesh *mesh = space->mesh;
    for (size_t f = 0; f < scene->fixed_count; f++) {
        memset(inside, 0, mesh->node_count * sizeof *inside);
        size_t count;
        int status = scene_select(&scene->fixed[f].where, scene, mesh, surface, inside, &count, why);
        if (status)
            return status;
        for (size_t i = 0; i < 3 * mesh->node_count; i++)
            if (inside[i / 3] && scene->fixed[f].component[i % 3])
                holding->fixed[i] = true;
    }
    static const double axis[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (size_t i = 0; i < 3 * mesh->node_count; i++)
        if (holding->fixed[i] && !hold(holding, i / 3, axis[i % 3]))
            return failure_set(why, STATUS_MEMORY, place, NULL, "no memory for the fixed nodes");
    for (size_t n = mesh->node_count; n < space->node_count; n++) {
        uint32_t ends[2];
        space_ends(space, n, ends);
        for (size_t a = 0; a < 3; a++)
            holding->fixed[3 * n + a] =
                holding->fixed[3 * (size_t)ends[0] + a] && holding->fixed[3 * (size_t)ends[1] + a];
    }
    return STATUS_OK;
}

static void add_spring(struct holding *holding, size_t node, double stiffness_N_m, const double unit[3])
{
    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    for (int c = 0; c < 6; c++)
        holding->spring[node][c] += stiffness_N_m * unit[row[c]] * unit[column[c]];
}

/* `share` on each selected vertex, and on the middles of the edges between them. */
static int share_stiffness(const struct space *space, const struct surface *surface, const bool *inside, double share,
                           const double unit[3], struct holding *holding, struct failure *why)
{
    static const double PASSED_ON = 16.0 / 19; /* of 6 corners of 3/57 and 6 middles of 16/57 around a vertex */
    unsigned *edges = calloc(surface->vertex_count + 1, sizeof *edges);
    if (!edges)
        return failure_set(why, STATUS_MEMORY, space->mesh->path, NULL, "no memory for the ligaments");
    bool middles = space->order == ELEMENT_QUADRATIC;
    for (int visit = 0; visit < 2; visit++) /* count the edges of each vertex, then pass on; each edge from one side */
        for (size_t i = 0; middles && i < 3 * surface->triangle_count; i++) {
            uint32_t a = surface->triangles[i], b = surface->triangles[i - i % 3 + (i + 1) % 3];
            if (a > b || !inside[surface->node[a]] || !inside[surface->node[b]])
                continue;
            if (visit == 0) {
                edges[a]++;
                edges[b]++;
            } else
                add_spring(holding, space_middle(space, surface->node[a], surface->node[b]),
                           PASSED_ON * share * (1.0 / edges[a] + 1.0 / edges[b]), unit);
        }
    for (size_t v = 0; v < surface->vertex_count; v++)
        if (inside[surface->node[v]])
            add_spring(holding, surface->node[v], edges[v] ? (1 - PASSED_ON) * share : share, unit);
    free(edges);
    return STATUS_OK;
}

static int tie(const struct scene *scene, const struct space *space, const struct surface *surface, const char *place,
               bool *inside, struct holding *holding, struct failure *why)
{
    const struct mesh *mesh = space->mesh;
    for (size_t l = 0; l < scene->ligament_count; l++) {
        const struct scene_ligament *ligament = &scene->ligament[l];
        const double *d = ligament->direction;
        double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        if (!(ligament->stiffness_N_m >= 0 && isfinite(ligament->stiffness_N_m) && length > 0 && isfinite(length)))
            return failure_at(
                why, STATUS_SCENE_VALUE, scene->path, ligament->where.line, "give a stiffness >= 0 and a direction",
                "a ligament has stiffness %g N/m, direction %g %g %g", ligament->stiffness_N_m, d[0], d[1], d[2]);
        memset(inside, 0, mesh->node_count * sizeof *inside);
        size_t count, vertices = 0;
        int status = scene_select(&ligament->where, scene, mesh, surface, inside, &count, why);
        if (status)
            return status;
        for (size_t v = 0; v < surface->vertex_count; v++)
            vertices += inside[surface->node[v]];
        if (vertices == 0)
            return failure_at(why, STATUS_SCENE_SELECTION, scene->path, ligament->where.line,
                              "move it to the body's surface", "a ligament holds no surface vertex");
        if (ligament->stiffness_N_m == 0)
            continue;
        if (!holding->spring)
            holding->spring = calloc(space->node_count, sizeof *holding->spring);
        double unit[3] = {d[0] / length, d[1] / length, d[2] / length};
        double share = ligament->stiffness_N_m / (double)vertices;
        if (!holding->spring)
            return failure_set(why, STATUS_MEMORY, place, NULL, "no memory for the ligaments");
        for (size_t v = 0; v < surface->vertex_count; v++)
            if (inside[surface->node[v]] && !hold(holding, surface->node[v], unit))
                return failure_set(why, STATUS_MEMORY, place, NULL, "no memory for the ligaments");
        status = share_stiffness(space, surface, inside, share, unit, holding, why);
        if (status)
            return status;
    }
    return STATUS_OK;
}

int holding_find(const struct scene *scene, const struct space *space, const struct surface *surface, const char *place,
                 struct holding *holding, struct failure *why)
{
    *holding = (struct holding){.fixed = calloc(3 * space->node_count + 1, sizeof(bool))};
    bool *inside = calloc(space->mesh->node_count + 1, sizeof *inside);
    int status = STATUS_OK;
    if (!holding->fixed || !inside)
        status = failure_set(why, STATUS_MEMORY, place, NULL, "no memory for %zu nodes", space->node_count);
    if (status == STATUS_OK)
        status = fix(scene, space, surface, place, inside, holding, why);
    if (status == STATUS_OK)
        status = tie(scene, space, surface, place, inside, holding, why);
    free(inside);
    return status;
}

void holding_free(struct holding *holding)
{
    free(holding->fixed);
    free(holding->spring);
    free(holding->support);
    *holding = (struct holding){0};
}
