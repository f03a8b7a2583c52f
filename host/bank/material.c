#include "material.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

#include "mesh_data.h"

/* Axes that are data are not known before the mesh: any do to judge the constants. */
static const double plain_axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

static int own_tensor(const struct scene *scene, const struct scene_material *material, struct hooke *hooke,
                      struct failure *why)
{
    return hooke_of_material(scene, material, *material->along_array ? plain_axes : NULL, hooke, why);
}

int material_check(const struct scene *scene, struct failure *why)
{
    for (size_t m = 0; m < scene->material_count; m++) {
        const struct scene_material *material = &scene->material[m];
        struct hooke unused;
        int status = own_tensor(scene, material, &unused, why);
        if (status)
            return status;
        if (!(material->rho_kg_m3 >= 0 && isfinite(material->rho_kg_m3)))
            return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, material->line, "give rho > 0",
                              "material '%s' has rho = %g kg/m3", material->label, material->rho_kg_m3);
    }
    return STATUS_OK;
}

static int direction_data(const struct scene *scene, const struct mesh *mesh, const struct scene_material *material,
                          const struct mesh_data **data, struct failure *why)
{
    *data = mesh_data_find(mesh, material->along_array);
    if (!*data)
        return failure_at(why, STATUS_MODEL_DATA, scene->path, material->line,
                          "name an array of the mesh's node data (VTK POINT_DATA, Gmsh $NodeData)",
                          "%s has no node data '%s'", mesh->path, material->along_array);
    if ((*data)->components != 3)
        return failure_at(why, STATUS_MODEL_DATA, scene->path, material->line, "name an array of vectors",
                          "the node data '%s' of %s have %zu components", material->along_array, mesh->path,
                          (*data)->components);
    return STATUS_OK;
}

/* The axis of an element from the directions at its vertices. */
static int mean_axis(const struct mesh *mesh, const struct mesh_data *data, size_t e, double along[3],
                     struct failure *why)
{
    double sum[9] = {0}, weight[3];
    for (size_t k = 0; k < 4; k++) {
        uint32_t node = mesh->tetrahedra[4 * e + k];
        const double *d = data->value + 3 * (size_t)node, *x = mesh->nodes + 3 * (size_t)node;
        double square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        if (!(square > 0 && isfinite(square)))
            return failure_set(why, STATUS_MODEL_DATA, mesh->path, NULL,
                               "node %u at (%.4g, %.4g, %.4g) m has no direction '%s'", node, x[0], x[1], x[2],
                               data->name);
        for (size_t i = 0; i < 9; i++)
            sum[i] += d[i / 3] * d[i % 3] / square;
    }
    if (LAPACKE_dsyev(LAPACK_COL_MAJOR, 'V', 'L', 3, sum, 3, weight) != 0 || !(weight[2] > 2 * weight[1]))
        return failure_set(why, STATUS_MODEL_DATA, mesh->path, "use a finer mesh there, or correct the directions",
                           "the directions '%s' at the nodes of element %zu point every way", data->name, e);
    for (size_t a = 0; a < 3; a++)
        along[a] = sum[6 + a];
    return STATUS_OK;
}

/* A tensor for each element whose material takes its directions from data. */
static int turn(const struct scene *scene, const struct mesh *mesh, struct materials *materials, struct failure *why)
{
    size_t turned = 0;
    for (size_t e = 0; e < mesh->tetrahedron_count; e++)
        turned += *scene->material[materials->of[e]].along_array != 0;
    if (turned == 0)
        return STATUS_OK;
    struct hooke *larger = realloc(materials->hooke, (scene->material_count + turned) * sizeof *larger);
    if (!larger)
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for %zu materials", turned);
    materials->hooke = larger;
    size_t next = scene->material_count;
    for (size_t e = 0; e < mesh->tetrahedron_count; e++) {
        const struct scene_material *material = &scene->material[materials->of[e]];
        const struct mesh_data *data;
        double along[3], axis[3][3];
        if (!*material->along_array)
            continue;
        int status = direction_data(scene, mesh, material, &data, why);
        if (status == STATUS_OK)
            status = mean_axis(mesh, data, e, along, why);
        if (status)
            return status;
        if (!hooke_axes(along, material->symmetry == SYMMETRY_ORTHOTROPIC ? material->across : NULL, axis))
            return failure_set(why, STATUS_MODEL_DATA, mesh->path, NULL,
                               "the direction '%s' in element %zu is that of across", data->name, e);
        status = hooke_of_material(scene, material, (const double(*)[3])axis, &larger[next], why);
        if (status)
            return status;
        materials->of[e] = (uint32_t)next++;
    }
    return STATUS_OK;
}

int material_find(const struct scene *scene, const struct mesh *mesh, struct materials *materials, struct failure *why)
{
    size_t elements = mesh->tetrahedron_count;
    uint8_t *material_of = malloc(elements + 1);
    *materials = (struct materials){.hooke = malloc((scene->material_count + 1) * sizeof *materials->hooke),
                                    .of = malloc((elements + 1) * sizeof *materials->of),
                                    .mass_kg = malloc((elements + 1) * sizeof *materials->mass_kg)};
    int status = STATUS_OK;
    if (!material_of || !materials->hooke || !materials->of || !materials->mass_kg)
        status = failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for the materials");
    if (status == STATUS_OK)
        status = scene_materials(scene, mesh, material_of, why);
    for (size_t m = 0; m < scene->material_count && status == STATUS_OK; m++)
        status = own_tensor(scene, &scene->material[m], &materials->hooke[m], why);
    for (size_t e = 0; e < elements && status == STATUS_OK; e++) {
        materials->of[e] = material_of[e];
        materials->mass_kg[e] = scene->material[material_of[e]].rho_kg_m3 *
                                element_geometry(mesh->nodes, mesh->tetrahedra + 4 * e).volume_m3;
    }
    if (status == STATUS_OK)
        status = turn(scene, mesh, materials, why);
    free(material_of);
    return status;
}

void material_free(struct materials *materials)
{
    free(materials->hooke);
    free(materials->of);
    free(materials->mass_kg);
    *materials = (struct materials){0};
}
