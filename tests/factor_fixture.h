/* The synthetic bank of bank_fixture.h with its plain compliance replaced by a rounded factor (section FACT). */
#ifndef TROCAR_FACTOR_FIXTURE_H
#define TROCAR_FACTOR_FIXTURE_H

#include "bank_fixture.h"
#include "bank_view.h"
#include "model.h"
#include "order.h"
#include "rounding.h"
#include "row_encode.h"

static inline void factor_fixture_must(int status, const struct failure *why)
{
    if (status) {
        fprintf(stderr, "factor fixture: %s\n", why->cause);
        abort();
    }
}

/* `relative`: the rounding step as rounding_choose takes it. Free the result. */
static inline unsigned char *factor_fixture(const struct bank_fixture_options *options, double relative, size_t *length)
{
    struct bank_view v;
    size_t plain_length;
    struct failure why;
    unsigned char *plain = bank_fixture(options, &plain_length);
    if (bank_view_open(&v, plain, plain_length))
        abort();
    size_t n = v.row_count;
    double *position = calloc(3 * n, sizeof *position), *G = calloc(9 * n * n, sizeof *G);
    uint32_t *row_of = calloc(n, sizeof *row_of);
    for (uint32_t i = 0; i < v.vertex_count; i++)
        for (int k = 0; k < 3 && v.row_of[i] != BANK_NONE; k++)
            position[3 * v.row_of[i] + k] = (double)v.positions[3 * i + k];
    for (uint32_t j = 0; j < n; j++)
        for (uint32_t i = j; i < n; i++) {
            float block[9];
            bank_view_compliance(&v, i, j, block);
            for (int e = 0; e < 9; e++)
                G[(3 * j + e % 3) * 3 * n + 3 * i + e / 3] = (double)block[e];
        }
    struct compliance compliance = {.rows = n, .G = G, .row_of = row_of};
    struct order order;
    struct cholesky cholesky;
    struct rounding rounding;
    struct factor factor;
    unsigned char *fact;
    size_t fact_length;
    factor_fixture_must(order_maximin(n, position, &order, &why), &why);
    factor_fixture_must(cholesky_build(&compliance, &order, &cholesky, &why), &why);
    rounding_choose(&order, &cholesky, relative, &rounding);
    factor_fixture_must(rounding_run(&compliance, &order, &cholesky, &rounding, &factor, &why), &why);
    factor_fixture_must(row_encode(&factor, &order, &fact, &fact_length, &why), &why);

    uint16_t *renumbered = calloc(n, sizeof *renumbered), *rows = calloc(v.vertex_count, sizeof *rows);
    for (size_t k = 0; k < n; k++)
        renumbered[order.at[k]] = (uint16_t)k;
    for (uint32_t i = 0; i < v.vertex_count; i++)
        rows[i] = v.row_of[i] == BANK_NONE ? BANK_NONE : renumbered[v.row_of[i]];
    struct fixture_part part[BANK_MAX_SECTIONS];
    unsigned parts = v.header->section_count;
    for (unsigned k = 0; k < parts; k++) {
        const struct bank_section *s = &v.sections[k];
        part[k] = (struct fixture_part){s->tag, s->flags, s->version, s->count, s->length, plain + s->offset};
        if (s->tag == BANK_ROWS)
            part[k].data = rows;
        if (s->tag == BANK_GHLF)
            part[k] = (struct fixture_part){BANK_FACT, BANK_REQUIRED, 1, (uint32_t)n, (uint32_t)fact_length, fact};
    }
    unsigned char *bytes = bank_fixture_join(part, parts, length);
    factor_free(&factor);
    cholesky_free(&cholesky);
    order_free(&order);
    free(fact), free(rows), free(renumbered), free(row_of), free(G), free(position), free(plain);
    return bytes;
}

#endif
