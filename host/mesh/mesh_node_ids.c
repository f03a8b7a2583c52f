#include "mesh_node_ids.h"

#include <stdlib.h>

int node_ids_start(struct node_ids *ids, size_t room, const char *path, struct failure *why)
{
    *ids = (struct node_ids){.room = room, .in_row = true};
    ids->id = malloc((room ? room : 1) * sizeof *ids->id);
    if (!ids->id)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the numbers of %zu nodes", room);
    return STATUS_OK;
}

bool node_ids_add(struct node_ids *ids, int64_t number)
{
    if (ids->count == ids->room) {
        struct node_id *larger = realloc(ids->id, 2 * (ids->room + 1) * sizeof *larger);
        if (!larger)
            return false;
        ids->id = larger;
        ids->room = 2 * (ids->room + 1);
    }
    if (ids->count == 0)
        ids->first = number;
    else if (number - 1 != ids->id[ids->count - 1].number)
        ids->in_row = false;
    ids->id[ids->count] = (struct node_id){number, (uint32_t)ids->count};
    ids->count++;
    return true;
}

static int by_number(const void *a, const void *b)
{
    const struct node_id *x = a, *y = b;
    return x->number < y->number ? -1 : x->number > y->number;
}

bool node_ids_finish(struct node_ids *ids, int64_t *twice)
{
    if (ids->in_row)
        return true;
    qsort(ids->id, ids->count, sizeof *ids->id, by_number);
    for (size_t i = 1; i < ids->count; i++)
        if (ids->id[i].number == ids->id[i - 1].number) {
            *twice = ids->id[i].number;
            return false;
        }
    return true;
}

uint32_t node_ids_place(const struct node_ids *ids, int64_t number)
{
    if (ids->in_row) {
        uint64_t place = (uint64_t)number - (uint64_t)ids->first;
        return number >= ids->first && place < ids->count ? (uint32_t)place : UINT32_MAX;
    }
    size_t low = 0, high = ids->count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (ids->id[middle].number < number)
            low = middle + 1;
        else
            high = middle;
    }
    return low < ids->count && ids->id[low].number == number ? ids->id[low].place : UINT32_MAX;
}

void node_ids_free(struct node_ids *ids)
{
    free(ids->id);
    *ids = (struct node_ids){0};
}
