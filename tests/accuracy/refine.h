/* Specimens for the mesh error: an organ of the thesis' size, and any specimen with every tetrahedron cut into eight. */
#ifndef TROCAR_REFINE_H
#define TROCAR_REFINE_H

#include <unistd.h>

#include "space.h"
#include "specimen.h"

/* The same body with each tetrahedron cut at its edges' middles: four corners, and the octahedron between them along its
 * shortest diagonal. Labels and the scene go along; the model is not made. */
static inline void specimen_refine(const struct specimen *coarse, struct specimen *fine)
{
    struct failure why;
    struct space p2;
    must(space_create(&coarse->mesh, ELEMENT_QUADRATIC, &p2, &why), &why);
    memset(fine, 0, sizeof *fine);
    fine->scene = coarse->scene;
    mesh_room(&fine->mesh, p2.node_count, 8 * coarse->mesh.tetrahedron_count);
    fine->mesh.label_count = coarse->mesh.label_count;
    memcpy(fine->mesh.label, coarse->mesh.label, coarse->mesh.label_count * sizeof *fine->mesh.label);
    for (size_t n = 0; n < p2.node_count; n++) {
        uint32_t ends[2];
        space_ends(&p2, n, ends);
        for (size_t a = 0; a < 3; a++)
            fine->mesh.nodes[3 * n + a] =
                (coarse->mesh.nodes[3 * (size_t)ends[0] + a] + coarse->mesh.nodes[3 * (size_t)ends[1] + a]) / 2;
    }
    /* middles: 4 = 01, 5 = 02, 6 = 03, 7 = 12, 8 = 13, 9 = 23; the ring of the octahedron around each diagonal */
    static const int corner[4][4] = {{0, 4, 5, 6}, {4, 1, 7, 8}, {5, 7, 2, 9}, {6, 8, 9, 3}};
    static const int diagonal[3][2] = {{4, 9}, {5, 8}, {6, 7}}, ring[3][4] = {{5, 7, 8, 6}, {4, 7, 9, 6}, {4, 8, 9, 5}};
    for (size_t t = 0; t < coarse->mesh.tetrahedron_count; t++) {
        const uint32_t *node = p2.nodes + 10 * t;
        double shortest = INFINITY;
        int best = 0;
        for (int d = 0; d < 3; d++) {
            double length = 0;
            for (size_t a = 0; a < 3; a++) {
                double e = fine->mesh.nodes[3 * (size_t)node[diagonal[d][0]] + a] -
                           fine->mesh.nodes[3 * (size_t)node[diagonal[d][1]] + a];
                length += e * e;
            }
            if (length < shortest * (1 - 1e-9)) {
                shortest = length;
                best = d;
            }
        }
        for (int k = 0; k < 8; k++) {
            uint32_t *out = fine->mesh.tetrahedra + 4 * (8 * t + (size_t)k);
            for (int c = 0; c < 4; c++)
                out[c] = k < 4   ? node[corner[k][c]]
                         : c < 2 ? node[diagonal[best][c]]
                                 : node[ring[best][(k - 4 + c - 2) % 4]];
            fine->mesh.labels[8 * t + (size_t)k] = coarse->mesh.labels[t];
            if (element_geometry(fine->mesh.nodes, out).volume_m3 < 0) {
                uint32_t swap = out[2];
                out[2] = out[3];
                out[3] = swap;
            }
        }
    }
    space_free(&p2);
}

/* Label 2 for the elements that lie wholly below `height` of the box along `axis`, and hold their nodes: a clamp that is
 * the same region on a refined mesh. */
static inline void specimen_clamp_end(struct specimen *s, int axis, double height)
{
    double low = INFINITY, high = -INFINITY;
    for (size_t n = 0; n < s->mesh.node_count; n++) {
        low = fmin(low, s->mesh.nodes[3 * n + (size_t)axis]);
        high = fmax(high, s->mesh.nodes[3 * n + (size_t)axis]);
    }
    for (size_t t = 0; t < s->mesh.tetrahedron_count; t++) {
        bool below = true;
        for (size_t k = 0; k < 4; k++)
            below = below && s->mesh.nodes[3 * (size_t)s->mesh.tetrahedra[4 * t + k] + (size_t)axis] <
                                 low + height * (high - low);
        s->mesh.labels[t] = below ? 2 : 1;
    }
    s->mesh.label = realloc(s->mesh.label, 2 * sizeof *s->mesh.label);
    assert_non_null(s->mesh.label);
    s->mesh.label_count = 2;
    s->mesh.label[0] = (struct mesh_label){.number = 1, .name = "tissue"};
    s->mesh.label[1] = (struct mesh_label){.number = 2, .name = "clamped"};
    s->scene.fixed_count = 0;
    specimen_fix(s, (struct selection){.kind = SELECT_LABEL, .label = "clamped"}, "xyz");
}

/* A wedge-shaped ovoid of 28 x 17 x 11 cm, bent, filled by trocar-mesher with edges of about `size_m` and bent then. 13 mm
 * give the size of the thesis' liver, some 1400 nodes and 6000 tetrahedra. */
static inline void specimen_ovoid(struct specimen *s, double size_m)
{
    char path[] = "/tmp/trocar-ovoid-XXXXXX.geo", mesher[300];
    int descriptor = mkstemps(path, 4);
    FILE *file = descriptor >= 0 ? fdopen(descriptor, "w") : NULL;
    assert_non_null(file);
    fputs("SetFactory(\"OpenCASCADE\"); Sphere(1) = {0, 0, 0, 1};\n"
          "Dilate {{0, 0, 0}, {0.14, 0.085, 0.055}} { Volume{1}; }\n",
          file);
    assert_int_equal(fclose(file), 0);
    snprintf(mesher, sizeof mesher, "%s/trocar-mesher", getenv("B") ? getenv("B") : "build");
    setenv("TROCAR_MESHER", mesher, 0);
    memset(s, 0, sizeof *s);
    struct failure why;
    struct mesh_report report;
    int status = mesh_read(path, size_m, &s->mesh, &why);
    unlink(path);
    must(status, &why);
    for (size_t n = 0; n < s->mesh.node_count; n++) {
        double *x = s->mesh.nodes + 3 * n, along = x[0] / 0.14;
        x[1] *= 1 - 0.25 * along;
        x[2] = x[2] * (1 - 0.45 * along) + 0.03 * along * along;
    }
    must(mesh_check(&s->mesh, false, &report, &why), &why);
    print_message("# ovoid: %zu nodes, %zu tetrahedra, %zu surface nodes, dihedral angles from %.1f degrees\n",
                  report.nodes, report.tetrahedra, report.surface_vertices, report.dihedral_min_deg);
}

#endif
