#include "model_state.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "rigid.h"
#include "stiffness.h"

enum { SOLVE_BLOCK = 64 }; /* right-hand sides per solve: wide enough for matrix products, small beside the factor */

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
    size_t node = 0;
    for (size_t i = 0; i < 3 * model->mesh->node_count; i++)
        if (model->unknown[i] >= 0 && (size_t)model->unknown[i] == unknown)
            node = i / 3;
    const double *x = model->mesh->nodes + 3 * node;
    return failure_set(why, STATUS_MODEL_FACTOR, model->place,
                       "look for slivers or a hinge there with trocar mesh, or lower nu",
                       "the stiffness matrix is not positive definite to rounding at node %zu (%.4g, %.4g, %.4g) m",
                       node, x[0], x[1], x[2]);
}

static int check_materials(const struct scene *scene, struct failure *why)
{
    for (size_t m = 0; m < scene->material_count; m++) {
        const struct scene_material *material = &scene->material[m];
        if (!(material->E_Pa > 0 && isfinite(material->E_Pa)))
            return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, material->line, "give E > 0",
                              "material '%s' has E = %g Pa", material->label, material->E_Pa);
        if (!(material->nu >= 0 && material->nu < 0.5))
            return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, material->line,
                              "give 0 <= nu < 0.5 (soft tissue: 0.45 to 0.49)", "material '%s' has nu = %g",
                              material->label, material->nu);
        if (!(material->rho_kg_m3 >= 0 && isfinite(material->rho_kg_m3)))
            return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, material->line, "give rho > 0",
                              "material '%s' has rho = %g kg/m3", material->label, material->rho_kg_m3);
    }
    return STATUS_OK;
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

/* What holds the body: flags per component (3 per node), springs, and one support per held direction. */
struct holding {
    bool *fixed;
    double (*spring)[6];
    struct support *support;
    size_t supports, room;
};

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

static int fix(const struct scene *scene, const struct model *model, bool *inside, struct holding *holding,
               struct failure *why)
{
    for (size_t f = 0; f < scene->fixed_count; f++) {
        memset(inside, 0, model->mesh->node_count * sizeof *inside);
        size_t count;
        int status = scene_select(&scene->fixed[f].where, scene, model->mesh, model->surface, inside, &count, why);
        if (status)
            return status;
        for (size_t i = 0; i < 3 * model->mesh->node_count; i++)
            if (inside[i / 3] && scene->fixed[f].component[i % 3])
                holding->fixed[i] = true;
    }
    static const double axis[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (size_t i = 0; i < 3 * model->mesh->node_count; i++)
        if (holding->fixed[i] && !hold(holding, i / 3, axis[i % 3]))
            return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the fixed nodes");
    return STATUS_OK;
}

/* A ligament's stiffness is shared equally by the surface vertices that it selects. */
static int tie(const struct scene *scene, const struct model *model, bool *inside, struct holding *holding,
               struct failure *why)
{
    for (size_t l = 0; l < scene->ligament_count; l++) {
        const struct scene_ligament *ligament = &scene->ligament[l];
        const double *d = ligament->direction;
        double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        if (!(ligament->stiffness_N_m >= 0 && isfinite(ligament->stiffness_N_m) && length > 0 && isfinite(length)))
            return failure_at(
                why, STATUS_SCENE_VALUE, scene->path, ligament->where.line, "give a stiffness >= 0 and a direction",
                "a ligament has stiffness %g N/m, direction %g %g %g", ligament->stiffness_N_m, d[0], d[1], d[2]);
        memset(inside, 0, model->mesh->node_count * sizeof *inside);
        size_t count, vertices = 0;
        int status = scene_select(&ligament->where, scene, model->mesh, model->surface, inside, &count, why);
        if (status)
            return status;
        for (size_t v = 0; v < model->surface->vertex_count; v++)
            vertices += inside[model->surface->node[v]];
        if (vertices == 0)
            return failure_at(why, STATUS_SCENE_SELECTION, scene->path, ligament->where.line,
                              "move it to the body's surface", "a ligament holds no surface vertex");
        if (ligament->stiffness_N_m == 0)
            continue;
        if (!holding->spring)
            holding->spring = calloc(model->mesh->node_count, sizeof *holding->spring);
        double unit[3] = {d[0] / length, d[1] / length, d[2] / length};
        double share = ligament->stiffness_N_m / (double)vertices;
        for (size_t v = 0; v < model->surface->vertex_count && holding->spring; v++) {
            uint32_t node = model->surface->node[v];
            if (!inside[node])
                continue;
            static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
            for (int c = 0; c < 6; c++)
                holding->spring[node][c] += share * unit[row[c]] * unit[column[c]];
            if (!hold(holding, node, unit))
                return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the ligaments");
        }
        if (!holding->spring)
            return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the ligaments");
    }
    return STATUS_OK;
}

static int number_unknowns(struct model *model, const bool *fixed, struct failure *why)
{
    size_t components = 3 * model->mesh->node_count;
    if (components > INT32_MAX)
        return failure_set(why, STATUS_MESH_TOO_LARGE, model->place, NULL,
                           "%zu nodes are more than the solver can number", model->mesh->node_count);
    for (size_t i = 0; i < components; i++)
        model->unknown[i] = fixed[i] ? -1 : (int32_t)model->unknowns++;
    for (size_t v = 0; v < model->surface->vertex_count; v++) {
        const int32_t *u = model->unknown + 3 * (size_t)model->surface->node[v];
        model->fixed_vertex[v] = u[0] < 0 && u[1] < 0 && u[2] < 0;
    }
    if (model->unknowns == 0)
        return failure_set(why, STATUS_SCENE_VALUE, model->place, "fix fewer nodes", "every node of the body is fixed");
    return STATUS_OK;
}

static int assemble(const struct scene *scene, struct model *model, const struct holding *holding, struct failure *why)
{
    const struct mesh *mesh = model->mesh;
    uint8_t *material_of = malloc(mesh->tetrahedron_count + 1);
    if (!material_of)
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the materials");
    int status = scene_materials(scene, mesh, material_of, why);
    struct lame lame[SCENE_MAX_MATERIALS];
    for (size_t m = 0; m < scene->material_count; m++)
        lame[m] = lame_from_young(scene->material[m].E_Pa, scene->material[m].nu);
    for (size_t t = 0; t < mesh->tetrahedron_count && status == STATUS_OK; t++) {
        if (material_of[t] >= scene->material_count)
            status = failure_set(why, STATUS_MODEL_LABEL, model->place, NULL, "element %zu (label %d) has no material",
                                 t, mesh->labels ? (int)mesh->labels[t] : 0);
        else
            model->mass_kg += scene->material[material_of[t]].rho_kg_m3 *
                              element_geometry(mesh->nodes, mesh->tetrahedra + 4 * t).volume_m3;
    }
    if (status == STATUS_OK)
        status = stiffness_assemble(mesh, lame, material_of, model->unknown, model->unknowns,
                                    (struct springs){holding->spring}, &model->common, &model->K, why);
    free(material_of);
    return status;
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

    struct holding holding = {.fixed = calloc(3 * mesh->node_count + 1, sizeof(bool))};
    bool *inside = calloc(mesh->node_count + 1, sizeof *inside);
    model->unknown = malloc((3 * mesh->node_count + 1) * sizeof *model->unknown);
    model->fixed_vertex = calloc(surface->vertex_count + 1, sizeof *model->fixed_vertex);
    int status = STATUS_OK;
    if (!holding.fixed || !inside || !model->unknown || !model->fixed_vertex)
        status = failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for %zu nodes", mesh->node_count);
    if (status == STATUS_OK)
        status = check_materials(scene, why);
    if (status == STATUS_OK)
        status = check_elements(model, why);
    if (status == STATUS_OK)
        status = fix(scene, model, inside, &holding, why);
    if (status == STATUS_OK)
        status = tie(scene, model, inside, &holding, why);
    if (status == STATUS_OK)
        status = rigid_check(mesh, holding.supports, holding.support, model->place, why);
    if (status == STATUS_OK)
        status = number_unknowns(model, holding.fixed, why);
    if (status == STATUS_OK)
        status = assemble(scene, model, &holding, why);
    free(holding.fixed);
    free(holding.spring);
    free(holding.support);
    free(inside);
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
    cholmod_free_sparse(&model->K, &model->common);
    cholmod_finish(&model->common);
    free(model->unknown);
    free(model->fixed_vertex);
    free(model);
}

size_t model_unknowns(const struct model *model)
{
    return model->unknowns;
}

size_t model_nonzeros(const struct model *model)
{
    return (size_t)((const int32_t *)model->K->p)[model->unknowns];
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
    return model->mass_kg;
}

void model_multiply(const struct model *model, const double *x, double *y)
{
    const int32_t *start = model->K->p, *row = model->K->i;
    const double *value = model->K->x;
    memset(y, 0, model->unknowns * sizeof *y);
    for (size_t j = 0; j < model->unknowns; j++) {
        double sum = value[start[j]] * x[j]; /* the diagonal leads its column */
        for (int32_t i = start[j] + 1; i < start[j + 1]; i++) {
            y[row[i]] += value[i] * x[j];
            sum += value[i] * x[row[i]];
        }
        y[j] += sum;
    }
}

/* The first unknown whose pivot is only rounding, or `unknowns`. */
static size_t weak_pivot(const struct model *model, const cholmod_factor *L)
{
    const int32_t *first = L->super, *rows = L->pi, *values = L->px, *order = L->Perm, *start = model->K->p;
    const double *x = L->x, *K = model->K->x;
    for (size_t s = 0; s < L->nsuper; s++)
        for (int32_t k = 0; k < first[s + 1] - first[s]; k++) {
            double pivot = x[(size_t)values[s] + (size_t)k * ((size_t)(rows[s + 1] - rows[s]) + 1)];
            int32_t unknown = order[first[s] + k];
            if (!(pivot * pivot > MODEL_PIVOT_MIN * K[start[unknown]])) /* the diagonal leads its column */
                return (size_t)unknown;
        }
    return model->unknowns;
}

static int factor(struct model *model, struct failure *why)
{
    if (model->factor)
        return STATUS_OK;
    cholmod_common *common = &model->common;
    cholmod_factor *L = cholmod_analyze(model->K, common); /* AMD, and METIS when AMD fills much */
    if (!L)
        return model_cholmod_failure(model, "order", why);
    int status = STATUS_OK;
    cholmod_factorize(model->K, L, common);
    if (common->status == CHOLMOD_NOT_POSDEF || (common->status == CHOLMOD_OK && L->minor < model->unknowns))
        status = model_indefinite(model, (size_t)((const int32_t *)L->Perm)[L->minor], why);
    else if (common->status < CHOLMOD_OK)
        status = model_cholmod_failure(model, "factor", why);
    else if (weak_pivot(model, L) < model->unknowns)
        status = model_indefinite(model, weak_pivot(model, L), why);
    if (status)
        cholmod_free_factor(&L, common);
    model->factor = L;
    return status;
}

/* A caller's array as CHOLMOD sees it. */
static cholmod_dense dense(size_t rows, size_t columns, double *values)
{
    return (cholmod_dense){.nrow = rows,
                           .ncol = columns,
                           .nzmax = rows * columns,
                           .d = rows,
                           .x = values,
                           .xtype = CHOLMOD_REAL,
                           .dtype = CHOLMOD_DOUBLE};
}

int model_solve(struct model *model, size_t columns, const double *f, double *u, struct failure *why)
{
    int status = factor(model, why);
    cholmod_dense *X = NULL, *Y = NULL, *E = NULL; /* kept between blocks */
    for (size_t c = 0; c < columns && status == STATUS_OK; c += SOLVE_BLOCK) {
        size_t width = columns - c < SOLVE_BLOCK ? columns - c : SOLVE_BLOCK;
        cholmod_dense B = dense(model->unknowns, width, (double *)(f + c * model->unknowns)); /* read only */
        if (interrupted())
            status =
                failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted after %zu of %zu solves", c, columns);
        else if (!cholmod_solve2(CHOLMOD_A, model->factor, &B, NULL, &X, NULL, &Y, &E, &model->common))
            status = model_cholmod_failure(model, "solve", why);
        else
            memcpy(u + c * model->unknowns, X->x, width * model->unknowns * sizeof *u);
    }
    cholmod_free_dense(&X, &model->common);
    cholmod_free_dense(&Y, &model->common);
    cholmod_free_dense(&E, &model->common);
    return status;
}
