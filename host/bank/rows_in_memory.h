/* All rows of a bank's factor at once, for the host, which has the memory: 20 bytes per block. */
#ifndef TROCAR_ROWS_IN_MEMORY_H
#define TROCAR_ROWS_IN_MEMORY_H

#include "bank_view.h"
#include "failure.h"
#include "row.h"

struct rows_in_memory {
    uint32_t *start; /* rows + 1 */
    struct row_block *block;
};

/* Decode every row and let the view point there, so that bank_view_compliance need not decode. A bank that holds GHLF is
 * left as it is. STATUS_MEMORY. */
int rows_in_memory(struct bank_view *view, struct rows_in_memory *rows, struct failure *why);
void rows_in_memory_free(struct rows_in_memory *rows);

#endif
