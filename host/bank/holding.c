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

static bool let_slide(struct holding *holding, size_t node, const double direction[3])
{
    if (holding->slides == holding->slide_room) {
        size_t room = 2 * holding->slide_room + 256;
        struct slide *larger = realloc(holding->slide, room * sizeof *larger);
        if (!larger)
            return false;
        holding->slide = larger;
        holding->slide_room = room;
    }
    struct slide *slide = &holding->slide[holding->slides++];
    slide->node = (uint32_t)node;
    memcpy(slide->direction, direction, sizeof slide->direction);
    return true;
}

/* The selected nodes, and the middles of edges between them. */
static int fix_along(const struct space *space, const char *place, const bool *inside, const double direction[3],
                     struct holding *holding, struct failure *why)
{
    bool good = true;
    for (size_t n = 0; n < space->node_count && good; n++) {
        uint32_t ends[2];
        space_ends(space, n, ends);
        if (!inside[ends[0]] || !inside[ends[1]])
            continue;
        good = let_slide(holding, n, direction);
        if (good && n < space->mesh->node_count)
            good = hold(holding, n, direction);
    }
    return good ? STATUS_OK : failure_set(why, STATUS_MEMORY, place, NULL, "no memory for the fixed nodes");
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
        if (scene->fixed[f].slides)
            status = fix_along(space, place, inside, scene->fixed[f].along, holding, why);
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

static double area(const struct mesh *mesh, const uint32_t node[3])
{
    const double *p = mesh->nodes + 3 * (size_t)node[0], *q = mesh->nodes + 3 * (size_t)node[1];
    const double *r = mesh->nodes + 3 * (size_t)node[2];
    double sum = 0;
    for (int a = 0, b = 1, c = 2; a < 3; a++, b = (a + 1) % 3, c = (a + 2) % 3) {
        double normal = (q[b] - p[b]) * (r[c] - p[c]) - (q[c] - p[c]) * (r[b] - p[b]);
        sum += normal * normal;
    }
    return sqrt(sum) / 2;
}

/* Whether triangle t is selected as a whole; its mesh nodes. */
static bool selected(const struct surface *surface, size_t t, const bool *inside, uint32_t node[3])
{
    bool all = true;
    for (size_t k = 0; k < 3; k++) {
        node[k] = surface->node[surface->triangles[3 * t + k]];
        all = all && inside[node[k]];
    }
    return all;
}

/* The stiffness over the selected triangles by area, lumped as a mass is (the diagonal of the mass matrix, scaled); over
 * the selected vertices in equal parts when they span no triangle. */
static void share_stiffness(const struct space *space, const struct surface *surface, const bool *inside,
                            double stiffness_N_m, const double unit[3], struct holding *holding)
{
    bool middles = space->order == ELEMENT_QUADRATIC;
    double corner = middles ? 3.0 / 57 : 1.0 / 3, middle = 16.0 / 57, total = 0, vertices = 0;
    uint32_t node[3];
    for (size_t t = 0; t < surface->triangle_count; t++)
        if (selected(surface, t, inside, node))
            total += area(space->mesh, node);
    for (size_t v = 0; v < surface->vertex_count; v++)
        vertices += inside[surface->node[v]];
    for (size_t v = 0; v < surface->vertex_count && total == 0; v++)
        if (inside[surface->node[v]])
            add_spring(holding, surface->node[v], stiffness_N_m / vertices, unit);
    for (size_t t = 0; t < surface->triangle_count && total > 0; t++) {
        if (!selected(surface, t, inside, node))
            continue;
        double part = stiffness_N_m * area(space->mesh, node) / total;
        for (int k = 0; k < 3; k++) {
            add_spring(holding, node[k], corner * part, unit);
            if (middles)
                add_spring(holding, space_middle(space, node[k], node[(k + 1) % 3]), middle * part, unit);
        }
    }
}

/* The vertices of `inside` that no selected triangle has do not hold, when there are triangles at all. */
static int keep_triangles(const struct mesh *mesh, const struct surface *surface, bool *inside, struct failure *why)
{
    bool *kept = calloc(mesh->node_count + 1, sizeof *kept), any = false;
    uint32_t node[3];
    if (!kept)
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for the ligaments");
    for (size_t t = 0; t < surface->triangle_count; t++)
        if (selected(surface, t, inside, node)) {
            any = true;
            kept[node[0]] = kept[node[1]] = kept[node[2]] = true;
        }
    if (any)
        memcpy(inside, kept, mesh->node_count * sizeof *inside);
    free(kept);
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
        if (!holding->spring)
            return failure_set(why, STATUS_MEMORY, place, NULL, "no memory for the ligaments");
        status = keep_triangles(mesh, surface, inside, why);
        if (status)
            return status;
        for (size_t v = 0; v < surface->vertex_count; v++)
            if (inside[surface->node[v]] && !hold(holding, surface->node[v], unit))
                return failure_set(why, STATUS_MEMORY, place, NULL, "no memory for the ligaments");
        share_stiffness(space, surface, inside, ligament->stiffness_N_m, unit, holding);
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

int holding_stiffen(struct holding *holding, const struct space *space, const struct materials *materials,
                    const char *place, struct failure *why)
{
    if (holding->slides == 0)
        return STATUS_OK;
    double *stiffness_N_m = calloc(space->node_count, sizeof *stiffness_N_m);
    if (!holding->spring)
        holding->spring = calloc(space->node_count, sizeof *holding->spring);
    if (!stiffness_N_m || !holding->spring) {
        free(stiffness_N_m);
        return failure_set(why, STATUS_MEMORY, place, NULL, "no memory for %zu nodes", space->node_count);
    }
    size_t per_element = element_nodes(space->order);
    for (size_t e = 0; e < space->mesh->tetrahedron_count; e++) {
        const struct hooke *law = &materials->hooke[materials->of[e]];
        double shear_Pa = law->isotropic ? law->lame.mu_Pa : fmax(law->C[3][3], fmax(law->C[4][4], law->C[5][5]));
        double size_m = cbrt(element_geometry(space->mesh->nodes, space->mesh->tetrahedra + 4 * e).volume_m3);
        for (size_t k = 0; k < per_element; k++)
            stiffness_N_m[space->nodes[per_element * e + k]] += shear_Pa * size_m;
    }
    for (size_t s = 0; s < holding->slides; s++) {
        const struct slide *slide = &holding->slide[s];
        add_spring(holding, slide->node, HOLDING_SLIDE_STIFFNESS * stiffness_N_m[slide->node], slide->direction);
    }
    free(stiffness_N_m);
    return STATUS_OK;
}

void holding_free(struct holding *holding)
{
    free(holding->slide);
    free(holding->fixed);
    free(holding->spring);
    free(holding->support);
    *holding = (struct holding){0};
}
