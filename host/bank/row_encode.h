/* Section FACT from the rounded factor: frequencies fitted to this bank, then every row as an rANS stream of its own
 * (Duda, arXiv 1311.2540; the layout is in bank_format.h). firmware/row.c reads it back. */
#ifndef TROCAR_ROW_ENCODE_H
#define TROCAR_ROW_ENCODE_H

#include <stddef.h>

#include "failure.h"
#include "rounding.h"

/* `bytes` (malloc) takes the section, `length` its bytes. STATUS_MEMORY; STATUS_MESH_TOO_LARGE beyond the format. */
int row_encode(const struct factor *factor, const struct order *order, unsigned char **bytes, size_t *length,
               struct failure *why);

#endif
