#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bank.h"
#include "rows_in_memory.h"

/* The contacts touch at most 3 vertices each; each that has a row appears once. */
enum { MAX_CONTACTS = 64, MAX_TOUCHED = 3 * MAX_CONTACTS };

struct touched {
    size_t count;
    uint32_t row[MAX_TOUCHED];
    double (*weight)[MAX_CONTACTS]; /* per touched row, per contact */
    double force[MAX_TOUCHED][3];   /* on the row's vertex */
};

static void touch(struct touched *s, uint32_t row, size_t contact, double weight)
{
    size_t k = 0;
    while (k < s->count && s->row[k] != row)
        k++;
    if (k == s->count) {
        s->row[s->count++] = row;
        memset(s->weight[k], 0, sizeof s->weight[k]);
    }
    s->weight[k][contact] += weight;
}

static int gather(const struct bank_view *bank, size_t count, const uint32_t *triangle, const double *weights,
                  const double *displacement, struct touched *s, struct failure *why)
{
    for (size_t c = 0; c < count; c++) {
        double w1 = weights[2 * c], w2 = weights[2 * c + 1], size = fabs(w1) + fabs(w2);
        for (int k = 0; k < 3; k++)
            size += fabs(displacement[3 * c + k]);
        if (triangle[c] >= bank->triangle_count)
            return failure_set(why, STATUS_BUS_FRAME, NULL, "use the bank that the controller runs",
                               "a contact lies on triangle %u, but the bank has %u", triangle[c], bank->triangle_count);
        if (!isfinite(size))
            return failure_set(why, STATUS_BUS_FRAME, NULL, NULL, "a contact's weights or displacement are not finite");
        double w[3] = {1 - w1 - w2, w1, w2};
        for (int k = 0; k < 3; k++) {
            uint16_t row = bank->row_of[bank->triangles[triangle[c]].vertex[k]];
            if (row != BANK_NONE)
                touch(s, row, c, w[k]);
        }
    }
    return STATUS_OK;
}

/* W^t G W + epsilon I, 3 count square, symmetric. */
static void assemble(const struct bank_view *bank, const struct touched *s, size_t count, double *A)
{
    size_t n = 3 * count;
    memset(A, 0, n * n * sizeof *A);
    for (size_t k = 0; k < s->count; k++)
        for (size_t l = 0; l < s->count; l++) {
            float block[9];
            bank_view_compliance(bank, s->row[k], s->row[l], block);
            for (size_t c = 0; c < count; c++)
                for (size_t d = 0; d < count; d++) {
                    double w = s->weight[k][c] * s->weight[l][d];
                    if (w != 0)
                        for (int e = 0; e < 9; e++)
                            A[n * (3 * c + e / 3) + 3 * d + e % 3] += w * (double)block[e];
                }
        }
    for (size_t i = 0; i < n; i++)
        A[n * i + i] += (double)bank->contact->regularisation_m_N;
}

/* u_row += sum over touched rows of G(row, t) f_t. Each row of the half matrix is one run of memory: the blocks left of
 * the diagonal are read from the row itself, those right of it from the rows of the touched vertices. */
static void spread(const struct bank_view *bank, const struct touched *s, size_t row, double u[3])
{
    const float *here = bank->half + 9 * (row * (row + 1) / 2);
    u[0] = u[1] = u[2] = 0;
    for (size_t k = 0; k < s->count; k++) {
        size_t t = s->row[k];
        const double *f = s->force[k];
        if (t <= row) {
            const float *g = here + 9 * t;
            for (int a = 0; a < 3; a++)
                u[a] += (double)g[3 * a] * f[0] + (double)g[3 * a + 1] * f[1] + (double)g[3 * a + 2] * f[2];
        } else {
            const float *g = bank->half + 9 * (t * (t + 1) / 2 + row);
            for (int a = 0; a < 3; a++)
                u[a] += (double)g[a] * f[0] + (double)g[3 + a] * f[1] + (double)g[6 + a] * f[2];
        }
    }
}

/* The same from the factor, for all rows: u = step^2 Q (Q^t f). `y` has 3 numbers per row. */
static void spread_factor(const struct bank_view *bank, const struct touched *s, double *y, double *u)
{
    double step2 = (double)bank->factor.header->step * (double)bank->factor.header->step;
    memset(y, 0, 3 * sizeof *y * bank->row_count);
    for (size_t k = 0; k < s->count; k++)
        for (uint32_t p = bank->decoded_start[s->row[k]]; p < bank->decoded_start[s->row[k] + 1]; p++) {
            const struct row_block *b = &bank->decoded[p];
            for (int e = 0; e < 9; e++)
                y[3 * b->column + e % 3] += step2 * b->value[e] * s->force[k][e / 3];
        }
    for (size_t v = 0; v < bank->vertex_count; v++) {
        uint16_t row = bank->row_of[v];
        if (row == BANK_NONE)
            continue;
        for (uint32_t p = bank->decoded_start[row]; p < bank->decoded_start[row + 1]; p++) {
            const struct row_block *b = &bank->decoded[p];
            for (int e = 0; e < 9; e++)
                u[3 * v + e / 3] += b->value[e] * y[3 * b->column + e % 3];
        }
    }
}

/* Displacement of all vertices under the forces of the touched rows. */
static int displace(const struct bank_view *bank, const struct touched *s, double *u, struct failure *why)
{
    if (bank->half) {
        for (size_t v = 0; v < bank->vertex_count; v++)
            if (bank->row_of[v] != BANK_NONE)
                spread(bank, s, bank->row_of[v], u + 3 * v);
        return STATUS_OK;
    }
    struct bank_view view = *bank;
    struct rows_in_memory rows = {0};
    double *y = malloc(3 * sizeof *y * bank->row_count);
    int status = y ? STATUS_OK : failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the displacement");
    if (!status && !view.decoded)
        status = rows_in_memory(&view, &rows, why);
    if (!status)
        spread_factor(&view, s, y, u);
    rows_in_memory_free(&rows);
    free(y);
    return status;
}

int field_from_contacts(const struct bank_view *bank, size_t count, const uint32_t *triangle, const double *weights,
                        const double *displacement, double *u, double *force, struct failure *why)
{
    memset(u, 0, 3 * sizeof *u * bank->vertex_count);
    if (count == 0)
        return STATUS_OK;
    if (count > MAX_CONTACTS)
        return failure_set(why, STATUS_BUS_FRAME, NULL, NULL, "%zu contacts at once; the bound is %d", count,
                           MAX_CONTACTS);
    struct touched *s = calloc(1, sizeof *s);
    double *A = malloc(9 * count * count * sizeof *A), *p = malloc(3 * count * sizeof *p);
    if (s)
        s->weight = malloc(3 * count * sizeof *s->weight);
    int status = STATUS_OK;
    if (!s || !A || !p || !s->weight)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the contacts");
    if (!status)
        status = gather(bank, count, triangle, weights, displacement, s, why);
    if (!status) {
        assemble(bank, s, count, A);
        memcpy(p, displacement, 3 * count * sizeof *p);
        /* not positive definite is excluded by epsilon as long as the compliance is, to within float32 rounding */
        int n = (int)(3 * count);
        if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', n, 1, A, n, p, n) != 0)
            status = failure_set(why, STATUS_BANK_NONFINITE, NULL, "verify the bank",
                                 "the contacts' compliance is not positive definite");
    }
    if (!status) {
        for (size_t k = 0; k < s->count; k++)
            for (size_t c = 0; c < count; c++)
                for (int a = 0; a < 3; a++)
                    s->force[k][a] += s->weight[k][c] * p[3 * c + a];
        status = displace(bank, s, u, why);
        if (force)
            memcpy(force, p, 3 * count * sizeof *p);
    }
    if (s)
        free(s->weight);
    free(s);
    free(A);
    free(p);
    return status;
}
