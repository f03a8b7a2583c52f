#include "order.h"

#include <math.h>
#include <stdlib.h>

#include "row_code.h"

/* Coordinates on the lattice that spans the box; one unit for all axes. */
static void lattice(size_t rows, const double *position, uint16_t *place)
{
    double low[3], longest = 0;
    for (int k = 0; k < 3; k++) {
        double high = low[k] = position[k];
        for (size_t i = 1; i < rows; i++) {
            low[k] = fmin(low[k], position[3 * i + k]);
            high = fmax(high, position[3 * i + k]);
        }
        longest = fmax(longest, high - low[k]);
    }
    for (size_t i = 0; i < rows; i++)
        for (int k = 0; k < 3; k++)
            place[3 * i + k] =
                longest > 0 ? (uint16_t)lround((position[3 * i + k] - low[k]) / longest * ORDER_PLACE_MAX) : 0;
}

static double squared(const uint16_t *a, const uint16_t *b)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += ((double)a[k] - b[k]) * ((double)a[k] - b[k]);
    return sum;
}

static size_t nearest_to_centroid(size_t rows, const uint16_t *place)
{
    double centre[3] = {0}, best = INFINITY;
    size_t found = 0;
    for (size_t i = 0; i < rows; i++)
        for (int k = 0; k < 3; k++)
            centre[k] += place[3 * i + k] / (double)rows;
    for (size_t i = 0; i < rows; i++) {
        double d = 0;
        for (int k = 0; k < 3; k++)
            d += (place[3 * i + k] - centre[k]) * (place[3 * i + k] - centre[k]);
        if (d < best) {
            best = d;
            found = i;
        }
    }
    return found;
}

/* Points farthest first: at[] and spacing2[]. `distance` has room for one number per row. */
static void farthest_first(struct order *o, const uint16_t *place, double *distance)
{
    size_t next = nearest_to_centroid(o->rows, place);
    for (size_t i = 0; i < o->rows; i++)
        distance[i] = 3.0 * ORDER_PLACE_MAX * ORDER_PLACE_MAX;
    for (size_t k = 0; k < o->rows; k++) {
        size_t here = next, farthest = 0;
        o->at[k] = (uint32_t)here;
        o->spacing2[k] = distance[here];
        for (size_t i = 0; i < o->rows; i++) {
            distance[i] = fmin(distance[i], squared(place + 3 * i, place + 3 * here));
            if (i == here)
                distance[i] = -1; /* taken */
            if (distance[i] > distance[farthest])
                farthest = i;
        }
        next = farthest;
    }
}

/* Columns of one spacing to half an octave of its square; the last level takes all that is finer than the table holds. */
static void levels(struct order *o)
{
    for (size_t k = 0; k < o->rows; k++) {
        uint16_t log = (uint16_t)row_ilog((uint32_t)fmax(o->spacing2[k], 0));
        if (o->levels > 0 && (log == o->level_log[o->levels - 1] || o->levels == BANK_FACTOR_LEVELS))
            continue;
        o->level_first[o->levels] = (uint16_t)k;
        o->level_log[o->levels++] = log;
    }
}

uint32_t order_log(const struct order *o, size_t i, size_t j)
{
    uint32_t d2 = 0;
    for (int k = 0; k < 3; k++) {
        int32_t d = o->place[3 * i + k] - o->place[3 * j + k];
        d2 += (uint32_t)(d * d);
    }
    return row_ilog(d2);
}

int order_maximin(size_t rows, const double *position, struct order *o, struct failure *why)
{
    *o = (struct order){.rows = rows};
    uint16_t *place = malloc(3 * rows * sizeof *place);
    double *distance = malloc(rows * sizeof *distance);
    o->at = malloc(rows * sizeof *o->at);
    o->place = malloc(3 * rows * sizeof *o->place);
    o->spacing2 = malloc(rows * sizeof *o->spacing2);
    int status = STATUS_OK;
    if (!place || !distance || !o->at || !o->place || !o->spacing2) {
        order_free(o);
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to order %zu rows", rows);
    } else {
        lattice(rows, position, place);
        farthest_first(o, place, distance);
        for (size_t k = 0; k < rows; k++)
            for (int c = 0; c < 3; c++)
                o->place[3 * k + c] = place[3 * o->at[k] + c];
        levels(o);
    }
    free(place);
    free(distance);
    return status;
}

void order_free(struct order *o)
{
    free(o->at);
    free(o->place);
    free(o->spacing2);
    *o = (struct order){0};
}
