/* Reading a bank in place. bank_view_open validates everything once, with bounded work (at most two passes over the bytes);
 * afterwards every index and float that a tick reads is known to be good, and the accessors check nothing. */
#ifndef TROCAR_BANK_VIEW_H
#define TROCAR_BANK_VIEW_H

#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "status.h"

struct bank_view {
    const struct bank_header *header;
    const struct bank_section *sections;
    uint32_t vertex_count, triangle_count, row_count, tool_count;
    const float *positions; /* 3 per vertex, m */
    const float *normals;   /* 3 per vertex */
    const struct bank_triangle *triangles;
    const struct bank_grid *grid;
    const uint32_t *cell_start;
    const uint16_t *cell_triangle;
    const uint16_t *row_of; /* per vertex; BANK_NONE when fixed */
    const float *half;      /* GHLF */
    const struct bank_contact *contact;
    const struct bank_tool *tools;
    uint32_t fault_tag; /* after a refusal: the section at fault, 0 for the header or table */
};

/* Validate `length` bytes at `bytes` (16-byte aligned). Returns STATUS_OK or the first STATUS_BANK_* that applies. */
int bank_view_open(struct bank_view *view, const void *bytes, size_t length);

/* Section by tag, NULL when absent; its bytes start at (const char *)view->header + section->offset. */
const struct bank_section *bank_view_section(const struct bank_view *view, uint32_t tag);

/* Compliance block G_ij (row-major 3x3, m/N) between rows i and j, either order. */
void bank_view_compliance(const struct bank_view *view, uint32_t i, uint32_t j, float block[9]);

#endif
