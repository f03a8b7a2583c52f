/* From the numbers by which a file calls its nodes to their places 0..count-1. Numbers in a row need no memory; others
 * are sorted once and searched. */
#ifndef TROCAR_MESH_NODE_IDS_H
#define TROCAR_MESH_NODE_IDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "failure.h"

struct node_ids {
    size_t count, room;
    int64_t first; /* the number of place 0 while `in_row` */
    bool in_row;
    struct node_id {
        int64_t number;
        uint32_t place;
    } * id;
};

/* Room for `room` numbers. */
int node_ids_start(struct node_ids *ids, size_t room, const char *path, struct failure *why);
/* The next place's number; false if there is no memory, which cannot be within the room. */
bool node_ids_add(struct node_ids *ids, int64_t number);
/* After the last: false, with the number in `*twice`, if one was given to two nodes. */
bool node_ids_finish(struct node_ids *ids, int64_t *twice);
/* UINT32_MAX if there is no such number. */
uint32_t node_ids_place(const struct node_ids *ids, int64_t number);
void node_ids_free(struct node_ids *ids);

#endif
