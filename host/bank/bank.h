/* Writing a bank and reading it back on the host: packing of the sections of bank_format.h, provenance, verification.
 */
#ifndef TROCAR_BANK_H
#define TROCAR_BANK_H

#include <stddef.h>
#include <stdint.h>

#include "bank_view.h"
#include "compression.h"
#include "failure.h"
#include "mesh.h"
#include "model.h"
#include "provenance.h"
#include "rows_in_memory.h"
#include "scene.h"

struct build_result {
    size_t nodes, elements, surface_nodes, rows, bytes, unknowns;
    double seconds, peak_rss_bytes;
    double median_compliance_m_N;
    double force_error_p95, force_error_max; /* of a patch: compression_error.h, on the bank as written */
    struct compression_error error;          /* the other kinds too */
    double step;                             /* of the compression, relative; 0: not compressed */
    double instructions;                     /* of the worst tick: worst_tick.h */
    unsigned row_work;                       /* thousands of units a tick; 0: the image's own (bank_format.h, CONT) */
    double default_bytes, default_error;     /* with a limit of bytes: of the bank that would be made without; else 0 */
    const char *discretisation;              /* of model.h: decides the mesh's error, which is not the bank's */
    struct mesh_report mesh;
};

struct body;

/* The whole of `trocar build`: read, check, scale, surface, place instruments, assemble, compliance, pack, write, open
 * what was written and measure its force error, then give it its name. `compression` NULL: the default. The
 * scene's budget limits the bank (budget.h). On return the scene has its instruments placed.
 * Nothing appears at `out_path` on failure or interrupt; a path that cannot be written is refused before the long part. A
 * compliance that took keep_after_s or longer is kept in BANK.part until the build ends by itself, and one that is found
 * there is taken (resume.h). */
#define BANK_KEEP_AFTER_S 20.0
int bank_build(struct scene *scene, const char *out_path, const struct compression *compression, double keep_after_s,
               bool quiet, struct build_result *result, struct failure *why);

struct pack;
/* Two steps of bank_build, for those who try several banks of one body. The compression of a prepared pack, its contact
 * record set; and the errors of what lies in a bank (compression_error.h), `compressed` NULL when that is plain: decodes
 * the rows of `view` while it runs, and leaves the view without them. */
int bank_compress(const struct body *body, const struct compliance *G, const struct pack *pack,
                  const struct compression *wanted, bool quiet, struct compressed *compressed, struct failure *why);
int bank_measure(struct bank_view *view, const struct compliance *G, const struct compressed *compressed, size_t trials,
                 uint64_t seed, struct compression_error *error, struct failure *why);

/* A bank in memory: the bytes (16-byte aligned, from a file) and the validated view of them. */
struct bank_file {
    unsigned char *bytes;
    size_t length;
    struct bank_view view; /* rows decoded */
    struct rows_in_memory rows;
    char path[1024];              /* as given to bank_load */
    struct provenance provenance; /* empty when the bank has no section PROV */
    const char *scene_text;       /* provenance.scene; NULL when absent */
    char mesh_path[1024];         /* provenance.mesh_path */
};
int bank_load(const char *path, struct bank_file *bank, struct failure *why);
void bank_unload(struct bank_file *bank);
/* The scene that the bank was built from (free); NULL when the bank does not tell, or without memory. */
struct scene *bank_scene(const struct bank_file *bank);
/* Fill `why` from a refusal by bank_view_open: names section and record, and which side to upgrade. Returns `status`.
 */
int bank_refusal(int status, const struct bank_view *view, const void *bytes, size_t length, const char *path,
                 struct failure *why);

/* A body ready for finite-element solves. Not to be moved in memory: the model points into it. */
struct body {
    struct scene scene;
    struct mesh mesh;
    struct surface surface;
    struct model *model;
};
/* From a scene: read the mesh, check, scale, surface, assemble, place the instruments. `report` may be NULL. */
int body_from_scene(const struct scene *scene, struct body *body, struct mesh_report *report, struct failure *why);
/* The body that a bank was built from, for verify and for the independent finite-element force of `trocar run`: from
 * the scene file, or from the scene in the bank's provenance. Then the mesh is looked for as its path is stored, and
 * relative to the bank's folder; the first file whose CRC-32 is the bank's is taken. FILE_OPEN when there is none,
 * CHECK_FAILED when one is there but has changed, when its surface is no longer the bank's, or when the scene file says
 * anything else than the bank's scene. */
int body_open(const struct bank_file *bank, const char *scene_path /* or NULL */, struct body *body,
              struct failure *why);
void body_close(struct body *body);

/* Displacement field of all surface vertices from contacts: u = G W p with p from (W^t G W + epsilon I) p = d in
 * double. Contact c: triangle[c], weights on its vertices 1 and 2 (that of vertex 0 is 1 - w1 - w2), displacement[3c..]
 * in m. Fills u (3 per vertex) and, unless NULL, force (3 per contact, on the tissue). Bound: count <= 64. */
int field_from_contacts(const struct bank_view *bank, size_t count, const uint32_t *triangle, const double *weights,
                        const double *displacement, double *u, double *force, struct failure *why);

#endif
