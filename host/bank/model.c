#include "model_state.h"

#include <stdlib.h>
#include <string.h>

#include "holding.h"
#include "material.h"
#include "rigid.h"
#include "stiffness.h"

int model_cholmod_failure(struct model *model, const char *what, struct failure *why)
{
    int status = model->common.status;
    if (status == CHOLMOD_OUT_OF_MEMORY || status == CHOLMOD_TOO_LARGE)
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory to %s %zu unknowns (%.0f MB were in use)",
                           what, model->unknowns, (double)model->common.memory_inuse / 1e6);
    return failure_set(why, STATUS_MODEL_FACTOR, model->place, NULL, "could not %s %zu unknowns (CHOLMOD status %d)",
                       what, model->unknowns, status);
}

int model_indefinite(const struct model *model, size_t unknown, struct failure *why)
{
    uint32_t ends[2];
    space_ends(&model->space, model->node[unknown], ends);
    const double *a = model->mesh->nodes + 3 * (size_t)ends[0], *b = model->mesh->nodes + 3 * (size_t)ends[1];
    char where[60];
    if (ends[0] == ends[1])
        snprintf(where, sizeof where, "at node %u", ends[0]);
    else
        snprintf(where, sizeof where, "between nodes %u and %u", ends[0], ends[1]);
    return failure_set(why, STATUS_MODEL_FACTOR, model->place,
                       "look for slivers or a hinge there with trocar mesh, or lower nu",
                       "the stiffness matrix is not positive definite to rounding %s (%.4g, %.4g, %.4g) m", where,
                       (a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2);
}

static int check_elements(const struct model *model, struct failure *why)
{
    const struct mesh *mesh = model->mesh;
    bool *used = calloc(mesh->node_count + 1, sizeof *used);
    if (!used)
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for %zu nodes", mesh->node_count);
    int status = STATUS_OK;
    for (size_t t = 0; t < mesh->tetrahedron_count && status == STATUS_OK; t++) {
        const uint32_t *vertex = mesh->tetrahedra + 4 * t;
        for (int k = 0; k < 4; k++)
            used[vertex[k]] = true;
        double volume = element_geometry(mesh->nodes, vertex).volume_m3;
        if (!(volume > 0))
            status = failure_set(why, STATUS_MESH_DEGENERATE, mesh->path, NULL,
                                 "element %zu (nodes %u %u %u %u) has volume %g m3", t, vertex[0], vertex[1], vertex[2],
                                 vertex[3], volume);
    }
    for (size_t n = 0; n < mesh->node_count && status == STATUS_OK; n++)
        if (!used[n])
            status = failure_set(why, STATUS_MODEL_FREE_MOTION, mesh->path, "remove it from the mesh",
                                 "node %zu belongs to no element", n);
    free(used);
    return status;
}

static int number_unknowns(struct model *model, const bool *fixed, struct failure *why)
{
    size_t components = 3 * model->space.node_count;
    if (components > INT32_MAX)
        return failure_set(why, STATUS_MESH_TOO_LARGE, model->place, NULL,
                           "%zu nodes are more than the solver can number", model->space.node_count);
    model->unknown = malloc((components + 1) * sizeof *model->unknown);
    model->node = malloc((components + 1) * sizeof *model->node);
    if (!model->unknown || !model->node)
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for %zu nodes", model->space.node_count);
    for (size_t i = 0; i < components; i++) {
        model->node[model->unknowns] = (uint32_t)(i / 3); /* overwritten by the next when this one is fixed */
        model->unknown[i] = fixed[i] ? -1 : (int32_t)model->unknowns++;
    }
    for (size_t v = 0; v < model->surface->vertex_count; v++) {
        const int32_t *u = model->unknown + 3 * (size_t)model->surface->node[v];
        model->fixed_vertex[v] = u[0] < 0 && u[1] < 0 && u[2] < 0;
    }
    if (model->unknowns == 0)
        return failure_set(why, STATUS_SCENE_VALUE, model->place, "fix fewer nodes", "every node of the body is fixed");
    return STATUS_OK;
}

/* Diagonal masses in the proportion of the consistent matrix's diagonal (Hinton, Rock, Zienkiewicz 1976): for quadratic
 * elements 1/36 at a corner and 4/27 in the middle of an edge, which keeps all of them positive. */
static int lump_mass(struct model *model, const double *element_kg, struct failure *why)
{
    const struct space *space = &model->space;
    size_t per_element = element_nodes(space->order);
    model->mass_kg = calloc(model->unknowns + 1, sizeof *model->mass_kg);
    if (!model->mass_kg)
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for %zu masses", model->unknowns);
    for (size_t e = 0; e < model->mesh->tetrahedron_count; e++) {
        model->total_mass_kg += element_kg[e];
        for (size_t k = 0; k < per_element; k++) {
            double share = per_element == 4 ? 1.0 / 4 : k < 4 ? 1.0 / 36 : 4.0 / 27;
            for (int c = 0; c < 3; c++) {
                int32_t unknown = model_unknown(model, space->nodes[per_element * e + k], c);
                if (unknown >= 0)
                    model->mass_kg[unknown] += share * element_kg[e];
            }
        }
    }
    return STATUS_OK;
}

int model_create(const struct scene *scene, const struct mesh *mesh, const struct surface *surface, struct model **out,
                 struct failure *why)
{
    *out = NULL;
    struct model *model = calloc(1, sizeof *model);
    if (!model)
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for the model");
    model->mesh = mesh;
    model->surface = surface;
    snprintf(model->place, sizeof model->place, "%.290s", *scene->path ? scene->path : mesh->path);
    cholmod_start(&model->common);
    model->common.print = 0; /* failures are reported by us */
    model->common.supernodal = CHOLMOD_SUPERNODAL;

    struct holding holding = {0};
    model->fixed_vertex = calloc(surface->vertex_count + 1, sizeof *model->fixed_vertex);
    int status = STATUS_OK;
    if (!model->fixed_vertex)
        status =
            failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for %zu vertices", surface->vertex_count);
    if (status == STATUS_OK)
        status = material_check(scene, why);
    if (status == STATUS_OK)
        status = check_elements(model, why);
    if (status == STATUS_OK)
        status = space_create(mesh, scene->order, &model->space, why);
    if (status == STATUS_OK)
        status = projection_create(&model->space, surface, &model->projection, why);
    if (status == STATUS_OK)
        status = holding_find(scene, &model->space, surface, model->place, &holding, why);
    if (status == STATUS_OK)
        status = rigid_check(mesh, holding.supports, holding.support, model->place, why);
    if (status == STATUS_OK)
        status = number_unknowns(model, holding.fixed, why);
    if (status == STATUS_OK)
        status = material_find(scene, mesh, &model->materials, why);
    if (status == STATUS_OK)
        status = holding_stiffen(&holding, &model->space, &model->materials, model->place, why);
    if (status == STATUS_OK)
        status = stiffness_assemble(&model->space, model->materials.hooke, model->materials.of, model->unknown,
                                    model->unknowns, (struct springs){holding.spring}, &model->common, &model->K, why);
    if (status == STATUS_OK)
        status = lump_mass(model, model->materials.mass_kg, why);
    model->spring = holding.spring;
    holding.spring = NULL;
    holding_free(&holding);
    if (status) {
        model_free(model);
        return status;
    }
    *out = model;
    return STATUS_OK;
}

void model_free(struct model *model)
{
    if (!model)
        return;
    cholmod_free_factor(&model->factor, &model->common);
    cholmod_free_factor(&model->pattern, &model->common);
    cholmod_free_sparse(&model->K, &model->common);
    cholmod_finish(&model->common);
    free(model->mass_kg);
    free(model->unknown);
    free(model->node);
    projection_free(&model->projection);
    space_free(&model->space);
    material_free(&model->materials);
    free(model->spring);
    free(model->fixed_vertex);
    free(model);
}

size_t model_unknowns(const struct model *model)
{
    return model->unknowns;
}

int32_t model_unknown(const struct model *model, size_t node, int c)
{
    return model->unknown[3 * node + (size_t)c];
}

const bool *model_fixed_vertices(const struct model *model)
{
    return model->fixed_vertex;
}

double model_mass(const struct model *model)
{
    return model->total_mass_kg;
}

const char *model_discretisation(const struct model *model)
{
    return model->space.order == ELEMENT_QUADRATIC ? "P2 projected" : "P1";
}

void model_load(const struct model *model, uint32_t vertex, int c, double force_N, double *f)
{
    const struct projection *R = &model->projection;
    if (model_unknown(model, model->surface->node[vertex], c) < 0)
        return;
    for (size_t k = R->start[vertex]; k < R->start[vertex + 1]; k++) {
        int32_t unknown = model_unknown(model, R->node[k], c);
        if (unknown >= 0)
            f[unknown] += R->weight[k] * force_N;
    }
}

double model_displacement(const struct model *model, uint32_t vertex, int c, const double *u)
{
    const struct projection *R = &model->projection;
    double sum = 0;
    if (model_unknown(model, model->surface->node[vertex], c) < 0)
        return 0;
    for (size_t k = R->start[vertex]; k < R->start[vertex + 1]; k++) {
        int32_t unknown = model_unknown(model, R->node[k], c);
        sum += unknown >= 0 ? R->weight[k] * u[unknown] : 0;
    }
    return sum;
}
