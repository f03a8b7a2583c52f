/* The fixture's bank (bank_fixture.h) with its compliance compressed into section FACT, and what it was made from. */
#ifndef TROCAR_FACTOR_FIXTURE_H
#define TROCAR_FACTOR_FIXTURE_H

#include "bank_fixture.h"
#include "bank_view.h"
#include "compression.h"
#include "rounding.h"
#include "row_encode.h"

struct factor_fixture {
    unsigned char *plain, *bytes; /* with GHLF, with FACT */
    size_t plain_length, length;
    struct bank_view plain_view, view;
    struct compliance G; /* rows as in the plain bank */
    double *position;    /* 3 per row of G */
    struct order order;
    struct cholesky cholesky;
    struct factor factor;
};

static inline void factor_fixture_compliance(struct factor_fixture *f)
{
    size_t n = f->plain_view.row_count, ld = 3 * n;
    f->G = (struct compliance){.rows = n, .G = calloc(ld * ld, sizeof(double))};
    f->position = calloc(3 * n, sizeof(double));
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t j = 0; j <= i; j++) {
            float block[9];
            bank_view_compliance(&f->plain_view, i, j, block);
            for (int k = 0; k < 9; k++)
                f->G.G[ld * (3 * j + k % 3) + 3 * i + k / 3] = (double)block[k];
        }
    for (uint32_t v = 0; v < f->plain_view.vertex_count; v++)
        for (int k = 0; k < 3 && f->plain_view.row_of[v] != BANK_NONE; k++)
            f->position[3 * f->plain_view.row_of[v] + k] = (double)f->plain_view.positions[3 * v + k];
}

/* The plain bank with FACT in place of GHLF, and its rows renumbered. */
static inline void factor_fixture_join(struct factor_fixture *f, const unsigned char *code, size_t code_length)
{
    const struct bank_header *h = (const struct bank_header *)f->plain;
    const struct bank_section *table = (const struct bank_section *)(h + 1);
    struct fixture_part part[16];
    uint16_t *row_of = malloc(2 * f->plain_view.vertex_count), *rank = malloc(2 * f->G.rows);
    for (size_t k = 0; k < f->G.rows; k++)
        rank[f->order.at[k]] = (uint16_t)k;
    for (uint32_t v = 0; v < f->plain_view.vertex_count; v++)
        row_of[v] = f->plain_view.row_of[v] == BANK_NONE ? BANK_NONE : rank[f->plain_view.row_of[v]];
    for (uint32_t k = 0; k < h->section_count; k++) {
        part[k] = (struct fixture_part){table[k].tag,   table[k].flags,  table[k].version,
                                        table[k].count, table[k].length, f->plain + table[k].offset};
        if (table[k].tag == BANK_ROWS)
            part[k].data = row_of;
        if (table[k].tag == BANK_GHLF)
            part[k] = (struct fixture_part){BANK_FACT,           BANK_REQUIRED,         bank_section_version(BANK_FACT),
                                            (uint32_t)f->G.rows, (uint32_t)code_length, (void *)(uintptr_t)code};
    }
    f->bytes = bank_fixture_join(part, h->section_count, &f->length);
    free(row_of);
    free(rank);
}

/* 0, or the status of the step that failed. */
static inline int factor_fixture(const struct bank_fixture_options *options, double step, struct factor_fixture *f)
{
    struct failure why;
    *f = (struct factor_fixture){0};
    f->plain = bank_fixture(options, &f->plain_length);
    int status = bank_view_open(&f->plain_view, f->plain, f->plain_length);
    if (status)
        return status;
    factor_fixture_compliance(f);
    struct rounding rounding;
    unsigned char *code = NULL;
    size_t code_length;
    status = order_maximin(f->G.rows, f->position, &f->order, &why);
    if (!status)
        status = cholesky_build(&f->G, &f->order, &f->cholesky, &why);
    if (!status) {
        rounding_choose(&f->order, &f->cholesky, step, &rounding);
        status = rounding_run(&f->G, &f->order, &f->cholesky, &rounding, &f->factor, &why);
    }
    if (!status)
        status = row_encode(&f->factor, &f->order, &code, &code_length, &why);
    if (!status) {
        factor_fixture_join(f, code, code_length);
        status = bank_view_open(&f->view, f->bytes, f->length);
    }
    free(code);
    return status;
}

static inline void factor_fixture_free(struct factor_fixture *f)
{
    factor_free(&f->factor);
    cholesky_free(&f->cholesky);
    order_free(&f->order);
    free(f->G.G);
    free(f->position);
    free(f->plain);
    free(f->bytes);
}

#endif
