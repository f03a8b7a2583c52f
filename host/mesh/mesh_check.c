#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh_repair.h"
#include "mesh_topology.h"

static const double pi = 3.14159265358979323846;

/* Below this share of the cube of its own mean edge, an element is flat: about eps of double times the condition number
 * that still lets its stiffness be summed with others (a regular tetrahedron has 0.118). */
static const double flat_share = 1e-9;

/* The dihedral angles of element e at its six edges, in degrees: between the outward normals of the two faces that meet
 * at an edge, 180 minus the angle. atan2 keeps its accuracy for slivers where acos loses half the digits. */
static void dihedral_angles(const struct mesh *mesh, size_t e, double angle[6])
{
    const uint32_t *corner = mesh->tetrahedra + 4 * e;
    for (int i = 0; i < 6; i++) {
        int a = edge_ends[i][0], b = edge_ends[i][1], c = edge_ends[5 - i][0], d = edge_ends[5 - i][1];
        const double *p[4] = {mesh->nodes + 3 * (size_t)corner[a], mesh->nodes + 3 * (size_t)corner[b],
                              mesh->nodes + 3 * (size_t)corner[c], mesh->nodes + 3 * (size_t)corner[d]};
        double u[3], v[3], w[3], m[3], n[3];
        for (int k = 0; k < 3; k++) {
            u[k] = p[1][k] - p[0][k];
            v[k] = p[2][k] - p[0][k];
            w[k] = p[3][k] - p[0][k];
        }
        for (int k = 0; k < 3; k++) {
            m[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
            n[k] = u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3];
        }
        double dot = m[0] * n[0] + m[1] * n[1] + m[2] * n[2];
        double cross = hypot(hypot(m[1] * n[2] - m[2] * n[1], m[2] * n[0] - m[0] * n[2]), m[0] * n[1] - m[1] * n[0]);
        angle[i] = atan2(cross, dot) * 180 / pi;
    }
}

static void measure(const struct mesh *mesh, struct mesh_report *report, size_t *first_flat)
{
    double edge_sum = 0;
    report->edge_min = INFINITY;
    report->dihedral_min_deg = 180;
    for (int k = 0; k < 3; k++) {
        report->minimum[k] = INFINITY;
        report->maximum[k] = -INFINITY;
    }
    for (size_t i = 0; i < 3 * mesh->node_count; i++) {
        report->minimum[i % 3] = fmin(report->minimum[i % 3], mesh->nodes[i]);
        report->maximum[i % 3] = fmax(report->maximum[i % 3], mesh->nodes[i]);
    }
    for (int k = 0; k < 3; k++)
        report->extent[k] = report->maximum[k] - report->minimum[k];
    for (size_t e = 0; e < mesh->tetrahedron_count; e++) {
        double volume = tetrahedron_volume(mesh, e), length[6], angle[6], mean = 0;
        tetrahedron_edges(mesh, e, length);
        for (int i = 0; i < 6; i++) {
            mean += length[i] / 6;
            report->edge_min = fmin(report->edge_min, length[i]);
            report->edge_max = fmax(report->edge_max, length[i]);
        }
        edge_sum += mean;
        report->volume += volume;
        /* divided three times: the cube of a small mean could be zero */
        if (!(fabs(volume) / mean / mean / mean >= flat_share) && report->degenerate++ == 0)
            *first_flat = e;
        dihedral_angles(mesh, e, angle);
        for (int i = 0; i < 6; i++) {
            int bin = (int)(angle[i] / 10);
            report->dihedral_histogram[bin < 0 ? 0 : bin > 17 ? 17 : bin]++;
            report->dihedral_min_deg = fmin(report->dihedral_min_deg, angle[i]);
            report->dihedral_max_deg = fmax(report->dihedral_max_deg, angle[i]);
        }
    }
    report->edge_mean = edge_sum / (double)mesh->tetrahedron_count;
}

/* Faces with two elements on the same side, or more than two elements; the pieces that hang together over faces. */
static void compare_neighbours(const struct face *face, size_t count, uint32_t *piece, struct mesh_report *report,
                               size_t *first_overlap)
{
    for (size_t i = 0, end; i < count; i = end) {
        for (end = i + 1; end < count && same_face(&face[i], &face[end]); end++)
            sets_join(piece, face[i].element, face[end].element);
        bool overlap = end - i > 2 || (end - i == 2 && face[i].odd == face[i + 1].odd);
        if (overlap && report->overlapping++ == 0)
            *first_overlap = face[i + 1].element;
    }
}

static int check_surface(const struct mesh *mesh, struct mesh_report *report, struct manifold *found,
                         struct failure *why)
{
    struct surface surface;
    int status = mesh_surface(mesh, &surface, why);
    if (status)
        return status;
    report->surface_vertices = surface.vertex_count;
    report->surface_triangles = surface.triangle_count;
    status = manifold_of(surface.triangles, surface.triangle_count, surface.vertex_count, mesh->path, found, why);
    if (status == STATUS_OK) {
        report->nonmanifold_edges = found->crowded_edges;
        report->nonmanifold_vertices = found->pinched_vertices;
        int64_t twice = 2 * (int64_t)found->shells - found->euler;
        report->genus = found->crowded_edges == 0 && twice > 0 ? (size_t)twice / 2 : 0;
    }
    surface_free(&surface);
    return status;
}

struct judgement {
    size_t first_flat, first_overlap, pieces; /* pieces: hanging together over faces */
    bool allow_components;
};

static int judge(const struct mesh *mesh, const struct mesh_report *r, const struct judgement *j, struct failure *why)
{
    if (r->degenerate)
        return failure_set(why, STATUS_MESH_DEGENERATE, mesh->path, NULL,
                           "%zu of %zu tetrahedra have no volume, the first is number %zu of the file", r->degenerate,
                           r->tetrahedra, j->first_flat + 1);
    if (r->overlapping)
        return failure_set(why, STATUS_MESH_INVERTED, mesh->path, NULL,
                           "at %zu faces tetrahedra lie one inside the other, the first is number %zu of the file",
                           r->overlapping, j->first_overlap + 1);
    if (j->pieces > r->components)
        return failure_set(
            why, STATUS_MESH_NONMANIFOLD, mesh->path, "remesh the body so that its parts share faces",
            "%zu parts hang together only at single nodes or edges, like hinges (%zu such edges, %zu such "
            "nodes)",
            j->pieces, r->nonmanifold_edges, r->nonmanifold_vertices);
    if (r->components > 1 && !j->allow_components)
        return failure_set(why, STATUS_MESH_COMPONENTS, mesh->path, NULL,
                           "the body is in %zu pieces that share no node", r->components);
    return STATUS_OK;
}

int mesh_check(struct mesh *mesh, bool allow_components, struct mesh_report *report, struct failure *why)
{
    struct judgement j = {.allow_components = allow_components};
    *report = (struct mesh_report){.nodes = mesh->node_count, .tetrahedra = mesh->tetrahedron_count};
    if (mesh->tetrahedron_count == 0 || mesh->tetrahedron_count > UINT32_MAX / 4)
        return failure_set(why, mesh->tetrahedron_count ? STATUS_MESH_TOO_LARGE : STATUS_MESH_EMPTY, mesh->path, NULL,
                           "the mesh has %zu tetrahedra", mesh->tetrahedron_count);
    for (size_t i = 0; i < 3 * mesh->node_count; i++)
        if (!isfinite(mesh->nodes[i]))
            return failure_set(why, STATUS_MESH_NONFINITE, mesh->path, NULL, "a coordinate of node %zu is not finite",
                               i / 3 + 1);
    for (size_t i = 0; i < 4 * mesh->tetrahedron_count; i++)
        if (mesh->tetrahedra[i] >= mesh->node_count)
            return failure_set(why, STATUS_MESH_INDEX, mesh->path, NULL, "tetrahedron %zu names node %u of %zu",
                               i / 4 + 1, mesh->tetrahedra[i], mesh->node_count);
    int status = mesh_repair(mesh, report, why);
    if (status)
        return status;
    measure(mesh, report, &j.first_flat);
    size_t faces = 4 * mesh->tetrahedron_count;
    struct manifold found;
    struct face *face = NULL;
    uint32_t *piece = sets_start(mesh->tetrahedron_count, mesh->path, why);
    uint32_t *body = sets_start(mesh->node_count, mesh->path, why);
    status = piece && body ? mesh_faces(mesh, &face, why) : STATUS_MEMORY;
    if (status == STATUS_OK) {
        compare_neighbours(face, faces, piece, report, &j.first_overlap);
        for (size_t i = 0; i < faces; i++)
            sets_join(body, mesh->tetrahedra[i], mesh->tetrahedra[i / 4 * 4]);
        for (size_t e = 0; e < mesh->tetrahedron_count; e++)
            j.pieces += piece[e] == e;
        for (size_t i = 0; i < mesh->node_count; i++)
            report->components += body[i] == i;
        status = check_surface(mesh, report, &found, why);
    }
    free(face);
    free(piece);
    free(body);
    return status ? status : judge(mesh, report, &j, why);
}
