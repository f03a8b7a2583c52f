/* The order of the factor's rows, coarse to fine: each next point is the one farthest from all before it (maximin; Gonzalez
 * 1985; for Green's functions Schaefer, Sullivan, Owhadi 2021). In this order the Cholesky factor of a Green's function
 * decays with the distance in units of the column's spacing, so most of it rounds to zero. */
#ifndef TROCAR_ORDER_H
#define TROCAR_ORDER_H

#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "failure.h"

enum { ORDER_PLACE_MAX = 32767 };

struct order {
    size_t rows;
    uint32_t *at;    /* at[k]: the row of the compliance that becomes row k */
    uint16_t *place; /* 3 per row k: integer coordinates, 0 .. ORDER_PLACE_MAX */
    double
        *spacing2; /* per row k: squared distance to the nearest row before it, in units of place; row 0: of the box */
    uint32_t levels;
    uint16_t level_first[BANK_FACTOR_LEVELS], level_log[BANK_FACTOR_LEVELS];
};

/* ilog() of the squared distance of two rows: see section FACT. */
uint32_t order_log(const struct order *order, size_t i, size_t j);

/* `position`: 3 per row, m. Starts at the point nearest to the centroid. Time O(rows^2). STATUS_MEMORY. */
int order_maximin(size_t rows, const double *position, struct order *order, struct failure *why);
void order_free(struct order *order);

#endif
