#include "material.h"

#include <math.h>
#include <stdlib.h>

int material_check(const struct scene *scene, struct failure *why)
{
    for (size_t m = 0; m < scene->material_count; m++) {
        const struct scene_material *material = &scene->material[m];
        struct hooke unused;
        int status = hooke_of_material(scene, material, NULL, &unused, why);
        if (status)
            return status;
        if (!(material->rho_kg_m3 >= 0 && isfinite(material->rho_kg_m3)))
            return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, material->line, "give rho > 0",
                              "material '%s' has rho = %g kg/m3", material->label, material->rho_kg_m3);
    }
    return STATUS_OK;
}

int material_find(const struct scene *scene, const struct mesh *mesh, struct materials *materials, struct failure *why)
{
    size_t elements = mesh->tetrahedron_count;
    uint8_t *material_of = malloc(elements + 1);
    *materials = (struct materials){.hooke = malloc((scene->material_count + 1) * sizeof *materials->hooke),
                                    .of = malloc((elements + 1) * sizeof *materials->of)};
    int status = STATUS_OK;
    if (!material_of || !materials->hooke || !materials->of)
        status = failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for the materials");
    if (status == STATUS_OK)
        status = scene_materials(scene, mesh, material_of, why);
    for (size_t m = 0; m < scene->material_count && status == STATUS_OK; m++)
        status = hooke_of_material(scene, &scene->material[m], NULL, &materials->hooke[m], why);
    for (size_t e = 0; e < elements && status == STATUS_OK; e++) {
        materials->of[e] = material_of[e];
        materials->mass_kg += scene->material[material_of[e]].rho_kg_m3 *
                              element_geometry(mesh->nodes, mesh->tetrahedra + 4 * e).volume_m3;
    }
    free(material_of);
    return status;
}

void material_free(struct materials *materials)
{
    free(materials->hooke);
    free(materials->of);
    *materials = (struct materials){0};
}
