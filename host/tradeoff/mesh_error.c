#include "mesh_error.h"

#include <math.h>
#include <stdlib.h>

#include "progress.h"
#include "refine.h"

enum { MAX_DRAWS = 4000 };

static const double MIDDLE[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};

int tool_compliance(struct model *model, const struct patch *tool, const double normal[3], double *compliance_m_N,
                    struct failure *why)
{
    size_t n = model_unknowns(model);
    double *f = calloc(n + 1, sizeof *f), *u = malloc((n + 1) * sizeof *u), sum = 0;
    int status = f && u ? STATUS_OK : failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for a solve");
    for (size_t k = 0; k < tool->count && !status; k++)
        for (int a = 0; a < 3; a++)
            model_load(model, tool->vertex[k], a, tool->weight[k] * normal[a], f);
    if (!status)
        status = model_solve(model, 1, f, u, why);
    for (size_t k = 0; k < tool->count && !status; k++)
        for (int a = 0; a < 3; a++)
            sum += tool->weight[k] * normal[a] * model_displacement(model, tool->vertex[k], a, u);
    *compliance_m_N = sum;
    free(f);
    free(u);
    return status;
}

void triangle_centre(const struct mesh *mesh, const struct surface *surface, uint32_t triangle, double centre_m[3])
{
    for (size_t a = 0; a < 3; a++) {
        centre_m[a] = 0;
        for (size_t k = 0; k < 3; k++)
            centre_m[a] += mesh->nodes[3 * (size_t)surface->node[surface->triangles[3 * (size_t)triangle + k]] + a] / 3;
    }
}

uint32_t triangle_at(const struct mesh *mesh, const struct surface *surface, const double centre_m[3])
{
    double least = INFINITY;
    uint32_t best = 0;
    for (uint32_t t = 0; t < surface->triangle_count; t++) {
        double c[3], d = 0;
        triangle_centre(mesh, surface, t, c);
        for (int a = 0; a < 3; a++)
            d += (c[a] - centre_m[a]) * (c[a] - centre_m[a]);
        if (d < least) {
            least = d;
            best = t;
        }
    }
    return best;
}

static uint64_t random_bits(uint64_t *state) /* splitmix64 */
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

/* No part of a tool of this radius is held there. */
static int is_free(const struct body *body, uint32_t triangle, double radius_m, bool *is, struct failure *why)
{
    const bool *fixed = model_fixed_vertices(body->model);
    struct patch tool;
    int status = patch_create(&body->mesh, &body->surface, triangle, MIDDLE, radius_m, &tool, why);
    if (status)
        return status;
    *is = true;
    for (size_t k = 0; k < tool.count; k++)
        *is = *is && !fixed[tool.vertex[k]];
    patch_free(&tool);
    return STATUS_OK;
}

static int draw_sites(const struct body *body, uint64_t seed, struct mesh_truth *truth, struct failure *why)
{
    double widest = 0;
    for (int r = 0; r < MESH_ERROR_RADII; r++)
        widest = fmax(widest, truth->radius_m[r]);
    for (int k = 0; k < MAX_DRAWS && truth->sites < MESH_ERROR_SITES; k++) {
        bool good;
        uint32_t t = (uint32_t)(random_bits(&seed) % body->surface.triangle_count);
        int status = is_free(body, t, widest, &good, why);
        if (status)
            return status;
        if (good)
            triangle_centre(&body->mesh, &body->surface, t, truth->centre_m[truth->sites++]);
    }
    return STATUS_OK;
}

/* Compliance at a site, along `normal`; along the tool's own, which `normal` then takes, when it is zero. */
static int at_site(struct body *body, const double centre_m[3], double radius_m, double normal[3],
                   double *compliance_m_N, struct failure *why)
{
    struct patch tool;
    if (interrupted())
        return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while measuring the mesh error");
    uint32_t t = triangle_at(&body->mesh, &body->surface, centre_m);
    int status = patch_create(&body->mesh, &body->surface, t, MIDDLE, radius_m, &tool, why);
    if (status)
        return status;
    bool given = normal[0] != 0 || normal[1] != 0 || normal[2] != 0;
    for (int a = 0; a < 3 && !given; a++)
        normal[a] = tool.normal[a];
    status = tool_compliance(body->model, &tool, normal, compliance_m_N, why);
    patch_free(&tool);
    return status;
}

static int solve_truth(struct body *fine, struct mesh_truth *truth, struct failure *why)
{
    int status = STATUS_OK;
    for (size_t k = 0; k < truth->sites; k++)
        for (int r = 0; r < MESH_ERROR_RADII && !status; r++)
            status = at_site(fine, truth->centre_m[k], truth->radius_m[r], truth->normal[k],
                             &truth->compliance_m_N[k][r], why);
    return status;
}

int mesh_truth_make(const struct body *body, const double radius_m[MESH_ERROR_RADII], uint64_t seed,
                    struct mesh_truth *truth, struct failure *why)
{
    *truth = (struct mesh_truth){0};
    for (int r = 0; r < MESH_ERROR_RADII; r++)
        truth->radius_m[r] = radius_m[r];
    int status = draw_sites(body, seed, truth, why);
    if (status || truth->sites == 0)
        return status;
    struct body *fine = calloc(1, sizeof *fine);
    if (!fine)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the refined body");
    fine->scene = body->scene;
    fine->scene.order = ELEMENT_QUADRATIC;
    status = refine_mesh(&body->mesh, &fine->mesh, NULL, why);
    if (!status)
        status = mesh_surface(&fine->mesh, &fine->surface, why);
    if (!status)
        status = model_create(&fine->scene, &fine->mesh, &fine->surface, &fine->model, why);
    if (!status)
        status = solve_truth(fine, truth, why);
    body_close(fine);
    free(fine);
    return status;
}

int mesh_error_measure(const struct mesh_truth *truth, struct body *body, struct mesh_error *error, struct failure *why)
{
    for (int r = 0; r < MESH_ERROR_RADII; r++) {
        error[r] = (struct mesh_error){NAN, NAN};
        double sum = 0, max = 0;
        for (size_t k = 0; k < truth->sites; k++) {
            double compliance, normal[3] = {truth->normal[k][0], truth->normal[k][1], truth->normal[k][2]};
            int status = at_site(body, truth->centre_m[k], truth->radius_m[r], normal, &compliance, why);
            if (status)
                return status;
            double off = fabs(truth->compliance_m_N[k][r] / compliance - 1);
            sum += off;
            max = fmax(max, off);
        }
        if (truth->sites)
            error[r] = (struct mesh_error){sum / (double)truth->sites, max};
    }
    return STATUS_OK;
}
