/* Test specimens: generated meshes, their scene filled as a struct, their model. For the accuracy tests only. */
#ifndef TROCAR_SPECIMEN_H
#define TROCAR_SPECIMEN_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "model.h"

struct specimen {
    struct mesh mesh;
    struct surface surface;
    struct scene scene;
    struct model *model;
};

/* Repeatable numbers in [0, 1): xorshift64*. */
static inline double draw(uint64_t *state)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return (double)((*state * 0x2545F4914F6CDD1DULL) >> 11) / 9007199254740992.0;
}

static inline void *room(size_t bytes)
{
    void *memory = calloc(1, bytes + 1);
    assert_non_null(memory);
    return memory;
}

static inline void mesh_room(struct mesh *mesh, size_t nodes, size_t tetrahedra)
{
    memset(mesh, 0, sizeof *mesh);
    mesh->node_count = nodes;
    mesh->nodes = room(3 * nodes * sizeof(double));
    mesh->tetrahedron_count = tetrahedra;
    mesh->tetrahedra = room(4 * tetrahedra * sizeof(uint32_t));
    mesh->labels = room(tetrahedra * sizeof(int32_t));
    mesh->label_count = 1;
    mesh->label = room(4 * sizeof *mesh->label);
    snprintf(mesh->path, sizeof mesh->path, "specimen");
}

/* A box [0,lx] x [0,ly] x [0,lz] of nx x ny x nz cells, each cut into six tetrahedra around its diagonal (Kuhn), so that
 * neighbouring cells match. Node i + (nx+1) (j + (ny+1) k). */
static inline void specimen_block(struct specimen *s, size_t nx, size_t ny, size_t nz, double lx, double ly, double lz)
{
    memset(s, 0, sizeof *s);
    mesh_room(&s->mesh, (nx + 1) * (ny + 1) * (nz + 1), 6 * nx * ny * nz);
    size_t n = 0, t = 0;
    for (size_t k = 0; k <= nz; k++)
        for (size_t j = 0; j <= ny; j++)
            for (size_t i = 0; i <= nx; i++, n++) {
                s->mesh.nodes[3 * n] = lx * (double)i / (double)nx;
                s->mesh.nodes[3 * n + 1] = ly * (double)j / (double)ny;
                s->mesh.nodes[3 * n + 2] = lz * (double)k / (double)nz;
            }
    const size_t stride[3] = {1, nx + 1, (nx + 1) * (ny + 1)};
    static const int order[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    for (size_t k = 0; k < nz; k++)
        for (size_t j = 0; j < ny; j++)
            for (size_t i = 0; i < nx; i++)
                for (int p = 0; p < 6; p++, t++) {
                    uint32_t *vertex = s->mesh.tetrahedra + 4 * t;
                    size_t at = i + stride[1] * j + stride[2] * k;
                    vertex[0] = (uint32_t)at;
                    for (int step = 0; step < 3; step++)
                        vertex[step + 1] = (uint32_t)(at += stride[order[p][step]]);
                    if (p >= 3) { /* odd permutation: mirrored */
                        uint32_t swap = vertex[1];
                        vertex[1] = vertex[2];
                        vertex[2] = swap;
                    }
                }
}

/* A bar along x with one triangle (0,0) (w,0) (0,w) as its cross-section: all three nodes of an end carry the same share
 * of a uniform traction. Node 3 k + c lies in layer k. */
static inline void specimen_prism(struct specimen *s, size_t layers, double length, double width)
{
    memset(s, 0, sizeof *s);
    mesh_room(&s->mesh, 3 * (layers + 1), 3 * layers);
    for (size_t k = 0; k <= layers; k++)
        for (size_t c = 0; c < 3; c++) {
            double *x = s->mesh.nodes + 3 * (3 * k + c);
            x[0] = length * (double)k / (double)layers;
            x[1] = c == 1 ? width : 0;
            x[2] = c == 2 ? width : 0;
        }
    static const uint32_t cut[3][4] = {{0, 1, 2, 5}, {0, 4, 1, 5}, {0, 3, 4, 5}};
    for (size_t k = 0; k < layers; k++)
        for (int p = 0; p < 3; p++) {
            uint32_t *v = s->mesh.tetrahedra + 4 * (3 * k + (size_t)p);
            for (int c = 0; c < 4; c++)
                v[c] = (uint32_t)(3 * k) + cut[p][c];
            const double *x = s->mesh.nodes;
            double e[3][3];
            for (int c = 0; c < 3; c++)
                for (int a = 0; a < 3; a++)
                    e[c][a] = x[3 * v[c + 1] + (uint32_t)a] - x[3 * v[0] + (uint32_t)a];
            double six_volumes = e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) -
                                 e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
                                 e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
            if (six_volumes < 0) {
                uint32_t swap = v[1];
                v[1] = v[2];
                v[2] = swap;
            }
        }
}

/* Move every node that is strictly inside the box of the mesh by up to `share` of `step` in each direction. */
static inline void specimen_shake(struct specimen *s, double share, double step, uint64_t *seed)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * s->mesh.node_count; i++) {
        low[i % 3] = fmin(low[i % 3], s->mesh.nodes[i]);
        high[i % 3] = fmax(high[i % 3], s->mesh.nodes[i]);
    }
    for (size_t n = 0; n < s->mesh.node_count; n++) {
        double *x = s->mesh.nodes + 3 * n;
        bool inside = true;
        for (int a = 0; a < 3; a++)
            inside = inside && x[a] > low[a] && x[a] < high[a];
        for (int a = 0; a < 3 && inside; a++)
            x[a] += step * share * (2 * draw(seed) - 1);
    }
}

/* Give the nodes other numbers, at random. */
static inline void specimen_renumber(struct specimen *s, uint64_t *seed)
{
    size_t count = s->mesh.node_count;
    uint32_t *number = room(count * sizeof *number);
    double *nodes = room(3 * count * sizeof *nodes);
    for (size_t n = 0; n < count; n++)
        number[n] = (uint32_t)n;
    for (size_t n = count - 1; n > 0; n--) {
        size_t other = (size_t)(draw(seed) * (double)(n + 1));
        uint32_t swap = number[n];
        number[n] = number[other];
        number[other] = swap;
    }
    for (size_t n = 0; n < count; n++)
        memcpy(nodes + 3 * number[n], s->mesh.nodes + 3 * n, 3 * sizeof *nodes);
    for (size_t i = 0; i < 4 * s->mesh.tetrahedron_count; i++)
        s->mesh.tetrahedra[i] = number[s->mesh.tetrahedra[i]];
    free(s->mesh.nodes);
    s->mesh.nodes = nodes;
    free(number);
}

static inline void specimen_material(struct specimen *s, const char *label, double E_Pa, double nu)
{
    struct scene_material *material = &s->scene.material[s->scene.material_count++];
    snprintf(material->label, sizeof material->label, "%s", label);
    material->E_Pa = E_Pa;
    material->nu = nu;
    material->rho_kg_m3 = 1060;
}

static inline struct selection box(double x0, double y0, double z0, double x1, double y1, double z1)
{
    const double slack = 1e-9; /* m: coordinates are rounded, specimens are millimetres at least */
    return (struct selection){
        .kind = SELECT_BOX, .a = {x0 - slack, y0 - slack, z0 - slack}, .b = {x1 + slack, y1 + slack, z1 + slack}};
}

/* `axes`: any of "xyz". */
static inline void specimen_fix(struct specimen *s, struct selection where, const char *axes)
{
    struct scene_fixed *fixed = &s->scene.fixed[s->scene.fixed_count++];
    fixed->where = where;
    for (int a = 0; a < 3; a++)
        fixed->component[a] = strchr(axes, 'x' + a) != NULL;
}

static inline int specimen_try(struct specimen *s, struct failure *why)
{
    int status = mesh_surface(&s->mesh, &s->surface, why);
    assert_int_equal(status, STATUS_OK);
    return model_create(&s->scene, &s->mesh, &s->surface, &s->model, why);
}

static inline void must(int status, const struct failure *why)
{
    if (status)
        failure_print(stderr, why);
    assert_int_equal(status, STATUS_OK);
}

static inline void specimen_model(struct specimen *s)
{
    struct failure why;
    must(specimen_try(s, &why), &why);
}

static inline void specimen_free(struct specimen *s)
{
    model_free(s->model);
    surface_free(&s->surface);
    mesh_free(&s->mesh);
}

/* Nodal forces (3 per node) of a uniform stress on the surface triangles for which `on` (of a centroid) holds. */
static inline void traction(const struct specimen *s, double stress[3][3], bool (*on)(const double *), double *force)
{
    for (size_t t = 0; t < s->surface.triangle_count; t++) {
        uint32_t node[3];
        double x[3][3], centre[3] = {0, 0, 0};
        for (int k = 0; k < 3; k++) {
            node[k] = s->surface.node[s->surface.triangles[3 * t + (size_t)k]];
            for (int a = 0; a < 3; a++) {
                x[k][a] = s->mesh.nodes[3 * (size_t)node[k] + (size_t)a];
                centre[a] += x[k][a] / 3;
            }
        }
        if (on && !on(centre))
            continue;
        for (int a = 0; a < 3; a++) {
            int b = (a + 1) % 3, c = (a + 2) % 3;
            double area_normal =
                ((x[1][b] - x[0][b]) * (x[2][c] - x[0][c]) - (x[1][c] - x[0][c]) * (x[2][b] - x[0][b])) / 2;
            for (int k = 0; k < 3; k++)
                for (int r = 0; r < 3; r++)
                    force[3 * (size_t)node[k] + (size_t)r] += stress[r][a] * area_normal / 3;
        }
    }
}

/* Displacements (3 per node, 0 where fixed) under nodal forces (3 per node). */
static inline void specimen_solve(struct specimen *s, const double *force, double *displacement)
{
    size_t n = model_unknowns(s->model);
    double *f = room(n * sizeof *f), *u = room(n * sizeof *u);
    for (size_t i = 0; i < 3 * s->mesh.node_count; i++) {
        int32_t unknown = model_unknown(s->model, i / 3, (int)(i % 3));
        if (unknown >= 0)
            f[unknown] = force[i];
    }
    struct failure why;
    must(model_solve(s->model, 1, f, u, &why), &why);
    for (size_t i = 0; i < 3 * s->mesh.node_count; i++) {
        int32_t unknown = model_unknown(s->model, i / 3, (int)(i % 3));
        displacement[i] = unknown >= 0 ? u[unknown] : 0;
    }
    free(f);
    free(u);
}

/* 25 x 20 x 20 cm with irregular cells and numbers, clamped at x = 0; its model. */
static inline void specimen_irregular(struct specimen *s, double nu, enum element_order order, uint64_t *seed)
{
    specimen_block(s, 5, 4, 4, 0.25, 0.2, 0.2);
    specimen_shake(s, 0.2, 0.05, seed);
    specimen_renumber(s, seed);
    specimen_material(s, "all", 4000, nu);
    specimen_fix(s, box(0, 0, 0, 0, 1, 1), "xyz");
    s->scene.order = order;
    specimen_model(s);
}

/* A mesh of the data folder scaled to 0.214 m, its surface and the assumed scene; false when the folder is not there. */
static inline bool specimen_data(struct specimen *s, const char *name, double nu)
{
    memset(s, 0, sizeof *s);
    const char *folder = getenv("TROCAR_DATA");
    char path[900];
    snprintf(path, sizeof path, "%s/%s", folder ? folder : "../shared/data", name);
    FILE *file = fopen(path, "r");
    if (!file) {
        print_message("# %s is not here: this case is skipped\n", path);
        return false;
    }
    fclose(file);
    struct failure why;
    struct mesh_report report;
    must(mesh_read(path, 0, &s->mesh, &why), &why);
    must(mesh_check(&s->mesh, true, &report, &why), &why);
    must(mesh_scale(&s->mesh, 0.214, MESH_UNIT_NONE, &why), &why);
    print_message("# %s: %zu nodes, %zu tetrahedra, dihedral angles from %.2f degrees\n", name, report.nodes,
                  report.tetrahedra, report.dihedral_min_deg);
    specimen_material(s, "all", 4000, nu);
    struct scene_fixed *fixed = &s->scene.fixed[s->scene.fixed_count++];
    fixed->where = (struct selection){.kind = SELECT_AXIS_END, .value = 0.04};
    fixed->component[0] = fixed->component[1] = fixed->component[2] = true;
    return true;
}

#endif
