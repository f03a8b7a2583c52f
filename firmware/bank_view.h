/* Reading a bank in place. bank_view_open validates everything once, with bounded work (one pass for the CRCs, one over
 * the values; the rows' numbers, 2 bytes per vertex, are read up to 8 times more); afterwards every index and float
 * that a tick reads is known to be good, and the accessors check nothing. The rules are those of shared/SPEC.md,
 * "Validation". */
#ifndef TROCAR_BANK_VIEW_H
#define TROCAR_BANK_VIEW_H

#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "effects/image.h"
#include "status.h"

/* Section FACT taken apart: see bank_format.h. Rows are read by row.h. */
struct bank_factor_view {
    const struct bank_factor *header;
    uint32_t rows;
    const uint16_t *level_first, *level_log, *level_unit, *distance_unit, *place, *base, *offset, *code;
    const struct bank_context *diagonal, *context;
    const struct bank_table *table;
    uint32_t words; /* of code */
};

struct row_block; /* row.h */

struct bank_view {
    const struct bank_header *header;
    const struct bank_section *sections;
    uint32_t vertex_count, triangle_count, row_count, tool_count;
    const float *positions; /* 3 per vertex, m */
    const float *normals;   /* 3 per vertex */
    const struct bank_triangle *triangles;
    const struct bank_grid *grid;
    const uint32_t *cell_base; /* per 32 cells */
    const uint16_t *cell_start, *cell_triangle;
    const uint16_t *row_of; /* per vertex; BANK_NONE when fixed */
    const float *half;      /* GHLF; NULL when the bank holds FACT */
    struct bank_factor_view factor;
    /* All rows decoded, by whoever has the memory for it; NULL as bank_view_open leaves it. Row i is
     * decoded[decoded_start[i]] .. decoded[decoded_start[i + 1] - 1]. */
    const struct row_block *decoded;
    const uint32_t *decoded_start;
    const struct bank_contact *contact;
    const struct bank_tool *tools;
/* per effect of this image; NULL when the bank does not name it */
#define EFFECT(bit, NAME, name, tag, parts, what) IF_##NAME(const struct bank_##name *name;)
#include "effects.def"
#undef EFFECT
    uint32_t fault_tag;    /* after a refusal: the section at fault, 0 for the header or table */
    uint32_t fault_record; /* and the record in it (vertex, triangle, cell, row, instrument; entry of the table); with
                              STATUS_BANK_EFFECT the bits of the effects that are not part of this image */
};

/* Validate `length` bytes at `bytes` (16-byte aligned). Returns STATUS_OK or the first STATUS_BANK_* that applies, with
 * the place in fault_tag and fault_record; every pointer of the view is then NULL. In the order of the checks:
 *   BANK_ALIGNMENT  `bytes` is not a multiple of 16         BANK_ABI       a newer image is wanted
 *   BANK_MAGIC      not a bank                              BANK_EFFECT    an effect is not part of this image
 *   BANK_VERSION    another format, or section layout       BANK_REQUIRED  an unknown section must not be skipped
 *   BANK_LENGTH     cut, too long, or lengths disagree      BANK_MISSING   a section is absent
 *   BANK_CRC        header, table or a section changed      BANK_INDEX     an index points outside its table, or lies
 *   BANK_SECTION    the table is not as specified           BANK_NONFINITE a number is not finite or not plausible */
int bank_view_open(struct bank_view *view, const void *bytes, size_t length);

/* First entry of cell_triangle that belongs to cell c; c = cells: behind the last. */
static inline uint32_t bank_view_cell_start(const struct bank_view *view, uint32_t c)
{
    return view->cell_base[c / 32] + view->cell_start[c];
}

/* Section by tag, NULL when absent; its bytes start at (const char *)view->header + section->offset. */
const struct bank_section *bank_view_section(const struct bank_view *view, uint32_t tag);

/* Compliance block G_ij (row-major 3x3, m/N) between rows i and j, either order. From FACT this decodes both rows: for the
 * host and for tests. */
void bank_view_compliance(const struct bank_view *view, uint32_t i, uint32_t j, float block[9]);

#endif
