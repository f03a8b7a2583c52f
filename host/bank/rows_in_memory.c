#include "rows_in_memory.h"

#include <stdlib.h>

int rows_in_memory(struct bank_view *view, struct rows_in_memory *r, struct failure *why)
{
    *r = (struct rows_in_memory){0};
    if (view->half)
        return STATUS_OK;
    size_t room = 0, most = row_max_blocks(view);
    r->start = malloc((view->row_count + 1) * sizeof *r->start);
    if (!r->start)
        goto no_memory;
    r->start[0] = 0;
    for (uint32_t i = 0; i < view->row_count; i++) {
        if (room - r->start[i] < most) {
            room = 2 * room + most + 1024;
            struct row_block *larger = realloc(r->block, room * sizeof *larger);
            if (!larger)
                goto no_memory;
            r->block = larger;
        }
        r->start[i + 1] = r->start[i] + row_decode(view, i, r->block + r->start[i]);
    }
    view->decoded = r->block;
    view->decoded_start = r->start;
    return STATUS_OK;
no_memory:
    rows_in_memory_free(r);
    return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the rows of the bank");
}

void rows_in_memory_free(struct rows_in_memory *r)
{
    free(r->start);
    free(r->block);
    *r = (struct rows_in_memory){0};
}
