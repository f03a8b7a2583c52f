/* Writing a bank and reading it back on the host: packing of the sections of bank_format.h, provenance, verification. */
#ifndef TROCAR_BANK_H
#define TROCAR_BANK_H

#include <stddef.h>
#include <stdint.h>

#include "bank_view.h"
#include "failure.h"
#include "mesh.h"
#include "model.h"
#include "scene.h"

struct build_result {
    size_t nodes, elements, surface_nodes, rows, bytes, unknowns;
    double seconds, peak_rss_bytes;
    double median_compliance_m_N;
    struct mesh_report mesh;
};

/* The whole of `trocar build`: read, check, scale, surface, place instruments, assemble, compliance, pack, write. On
 * return the scene has its instruments placed. Nothing is written on failure or interrupt. */
int bank_build(struct scene *scene, const char *out_path, bool quiet, struct build_result *result, struct failure *why);

/* A bank in memory: the bytes (16-byte aligned, from a file) and the validated view of them. */
struct bank_file {
    unsigned char *bytes;
    size_t length;
    struct bank_view view;
    char *scene_text; /* from PROV, malloc; NULL when absent */
    char mesh_path[1024];
};
int bank_load(const char *path, struct bank_file *bank, struct failure *why);
void bank_unload(struct bank_file *bank);

/* The body that a bank was built from, read again from the mesh file that its provenance (or `scene`) names, checked by
 * hash: for verify, and for the independent finite-element force of `trocar run`. */
struct body {
    struct scene scene;
    struct mesh mesh;
    struct surface surface;
    struct model *model;
};
int body_open(const struct bank_file *bank, const char *scene_path /* or NULL */, struct body *body, struct failure *why);
void body_close(struct body *body);

/* Displacement field of all surface vertices from contacts: u = G W p with p from (W^t G W + epsilon I) p = d in double.
 * Contact c: triangle[c], weights on its vertices 1 and 2 (that of vertex 0 is 1 - w1 - w2), displacement[3c..] in m.
 * Fills u (3 per vertex) and, unless NULL, force (3 per contact, on the tissue). Bound: count <= 64. */
int field_from_contacts(const struct bank_view *bank, size_t count, const uint32_t *triangle, const double *weights,
                        const double *displacement, double *u, double *force, struct failure *why);

#endif
