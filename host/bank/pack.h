/* Packing: from surface, compliance, instruments and contact to the bytes of bank_format.h.
 *
 *   pack_prepare     everything but the compliance, and the size that the bank will have: before the long computation
 *   pack_effects     the sections of the effects that the scene names
 *   pack_write       all sections, in the order VERT NORM TRIA GRID ROWS CONT TOOL, GHLF or FACT, those of effects, PROV
 *                    (still empty)
 *   pack_provenance  replace PROV, once the errors that it states have been measured on what was written
 *   pack_free
 *
 * The compliance is rounded to float32 (to nearest) and streamed in bands of rows, so that there is no second copy of
 * it: workspace is PACK_BAND rows. */
#ifndef TROCAR_PACK_H
#define TROCAR_PACK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "compression.h"
#include "failure.h"
#include "grid.h"
#include "mesh.h"
#include "model.h"
#include "progress.h"
#include "scene.h"

enum { PACK_SECTIONS = 9, PACK_EFFECTS = 32, PACK_BAND = 64 };

struct pack {
    size_t vertices, triangles, rows;
    float *positions, *normals;
    struct bank_triangle *triangle;
    struct grid grid;
    uint16_t *row_of;
    struct bank_contact contact; /* set by the caller between pack_prepare and pack_write */
    struct bank_tool tool[BANK_MAX_INSTRUMENTS];
    size_t tools;
    uint32_t scene_hash, mesh_hash;
    uint64_t bytes;   /* of the bank without the text of PROV; as prepared: with GHLF and without effects */
    uint32_t effects; /* bits */
    size_t effect_sections;
    struct effect_section effect[PACK_EFFECTS];
    uint32_t effect_tag[PACK_EFFECTS];
    struct bank_section section[PACK_SECTIONS + PACK_EFFECTS];
};

/* `fixed` has one flag per surface vertex; the others own the rows 0, 1, ... in vertex order, as compliance_build
 * numbers them. MESH_TOO_LARGE when the format's limits do not hold the body. */
int pack_prepare(struct pack *pack, const struct mesh *mesh, const struct surface *surface, const bool *fixed,
                 size_t tools, struct failure *why);
/* Bytes of the bank beside the compliance, without the text of PROV. Before pack_compressed. */
uint64_t pack_rest(const struct pack *pack);
/* Make `bytes` that of a bank with this in place of GHLF. */
void pack_compressed(struct pack *pack, const struct compressed *compressed);
/* Between pack_prepare and pack_write. */
int pack_effects(struct pack *pack, const struct scene *scene, struct body *body, struct failure *why);
/* `compressed` NULL: GHLF; else FACT, and the rows take its order. */
int pack_write(struct pack *pack, const struct compliance *compliance, const struct compressed *compressed,
               struct file_writer *writer, bool quiet, struct failure *why);
int pack_provenance(struct pack *pack, const char *text, size_t length, struct file_writer *writer,
                    struct failure *why);
void pack_free(struct pack *pack);

#endif
