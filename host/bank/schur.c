#include "schur.h"

#include <cblas.h>
#include <lapacke.h>
#include <stdlib.h>
#include <string.h>

enum { PANEL = 256 }; /* columns of an update at once: bounds the workspace to longest column x 256 */

/* ---- plan ---- */

/* Elimination order of the interior alone: position -> unknown in order[0 .. interior-1]. */
static bool order_interior(const cholmod_sparse *K, const int32_t *place, size_t interior, int32_t *order,
                           cholmod_common *common)
{
    if (interior == 0)
        return true;
    const int32_t *start = K->p, *row = K->i;
    int32_t *number = malloc((K->ncol + 1) * sizeof *number), *unknown = malloc((interior + 1) * sizeof *unknown);
    size_t entries = 0;
    int32_t next = 0;
    cholmod_sparse *inner = NULL;
    cholmod_factor *analysed = NULL;
    if (number && unknown) {
        for (size_t j = 0; j < K->ncol; j++) {
            number[j] = place[j] < 0 ? next : -1;
            if (place[j] < 0) {
                unknown[next++] = (int32_t)j;
                for (int32_t i = start[j]; i < start[j + 1]; i++)
                    entries += place[row[i]] < 0;
            }
        }
        inner = cholmod_allocate_sparse(interior, interior, entries, 1, 1, -1, CHOLMOD_PATTERN, common);
    }
    if (inner) {
        int32_t *inner_start = inner->p, *inner_row = inner->i;
        int32_t at = 0;
        for (size_t j = 0; j < K->ncol; j++) {
            if (number[j] < 0)
                continue;
            inner_start[number[j]] = at;
            for (int32_t i = start[j]; i < start[j + 1]; i++)
                if (number[row[i]] >= 0)
                    inner_row[at++] = number[row[i]];
        }
        inner_start[interior] = at;
        analysed = cholmod_analyze(inner, common);
    }
    if (analysed)
        for (size_t p = 0; p < interior; p++)
            order[p] = unknown[((const int32_t *)analysed->Perm)[p]];
    bool good = analysed != NULL;
    cholmod_free_factor(&analysed, common);
    cholmod_free_sparse(&inner, common);
    free(number);
    free(unknown);
    return good;
}

/* Analyse with the order kept as it is: a postorder of the whole would pull the tail apart. */
static cholmod_factor *analyse_given(cholmod_sparse *K, int32_t *order, cholmod_common *common)
{
    int methods = common->nmethods, ordering = common->method[0].ordering, postorder = common->postorder;
    int supernodal = common->supernodal;
    common->nmethods = 1;
    common->method[0].ordering = CHOLMOD_GIVEN;
    common->postorder = 0;
    common->supernodal = CHOLMOD_SUPERNODAL;
    cholmod_factor *pattern = cholmod_analyze_p(K, order, NULL, 0, common);
    common->nmethods = methods;
    common->method[0].ordering = ordering;
    common->postorder = postorder;
    common->supernodal = supernodal;
    return pattern;
}

struct supernode {
    size_t first, columns, rows; /* columns: those of the interior only */
    const int32_t *row;          /* positions, rising; the first `columns` are its own */
    double *value;               /* rows x columns, column-major */
};

static struct supernode supernode_at(const struct schur *schur, size_t s, double *values)
{
    const int32_t *first = schur->pattern->super, *list = schur->pattern->pi;
    size_t end = (size_t)first[s + 1] < schur->interior ? (size_t)first[s + 1] : schur->interior;
    return (struct supernode){.first = (size_t)first[s],
                              .columns = end - (size_t)first[s],
                              .rows = (size_t)(list[s + 1] - list[s]),
                              .row = (const int32_t *)schur->pattern->s + list[s],
                              .value = values ? values + schur->value_start[s] : NULL};
}

int schur_plan(cholmod_sparse *K, const int32_t *place, size_t tail, cholmod_common *common, struct schur *schur)
{
    *schur = (struct schur){.interior = K->ncol - tail, .tail = tail};
    size_t interior = schur->interior;
    int32_t *order = malloc((K->ncol + 1) * sizeof *order);
    schur->rank = malloc((K->ncol + 1) * sizeof *schur->rank);
    schur->owner = malloc((interior + 1) * sizeof *schur->owner);
    bool good = order && schur->rank && schur->owner && order_interior(K, place, interior, order, common);
    if (good) {
        for (size_t u = 0; u < K->ncol; u++)
            if (place[u] >= 0)
                order[interior + (size_t)place[u]] = (int32_t)u;
        for (size_t p = 0; p < K->ncol; p++)
            schur->rank[order[p]] = (int32_t)p;
        schur->pattern = analyse_given(K, order, common);
        good = schur->pattern != NULL;
    }
    free(order);
    if (good) {
        schur->value_start = malloc((schur->pattern->nsuper + 1) * sizeof *schur->value_start);
        good = schur->value_start != NULL;
    }
    if (!good) {
        schur_free(schur, common);
        return STATUS_MEMORY;
    }
    size_t values = 0;
    const int32_t *first = schur->pattern->super;
    for (size_t s = 0; s < schur->pattern->nsuper && (size_t)first[s] < interior; s++) {
        schur->supernodes = s + 1;
        schur->value_start[s] = values;
        struct supernode node = supernode_at(schur, s, NULL);
        values += node.rows * node.columns;
        if (node.rows > schur->rows_max)
            schur->rows_max = node.rows;
        for (size_t k = 0; k < node.columns; k++)
            schur->owner[node.first + k] = (int32_t)s;
        double c = (double)node.columns, b = (double)(node.rows - node.columns);
        schur->operations += c * c * c / 3 + c * c * b + c * b * b;
    }
    schur->value_start[schur->supernodes] = values;
    schur->bytes = (values + schur->rows_max * (PANEL + 1)) * sizeof(double);
    return STATUS_OK;
}

void schur_free(struct schur *schur, cholmod_common *common)
{
    cholmod_free_factor(&schur->pattern, common);
    free(schur->rank);
    free(schur->owner);
    free(schur->value_start);
    *schur = (struct schur){0};
}

/* ---- numbers ---- */

static size_t find(const struct supernode *node, int32_t row)
{
    size_t low = 0, high = node->rows - 1;
    while (low < high) { /* halves each time */
        size_t middle = (low + high) / 2;
        if (node->row[middle] < row)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Put the entries of K where they will be eliminated, or into S. */
static void scatter_matrix(const struct schur *schur, const cholmod_sparse *K, double *values, double *S, size_t ld)
{
    const int32_t *start = K->p, *row = K->i;
    const double *x = K->x;
    for (size_t j = 0; j < K->ncol; j++)
        for (int32_t i = start[j]; i < start[j + 1]; i++) {
            int32_t a = schur->rank[j], b = schur->rank[row[i]];
            int32_t column = a < b ? a : b, below = a < b ? b : a;
            if ((size_t)column >= schur->interior) {
                S[((size_t)below - schur->interior) + ((size_t)column - schur->interior) * ld] = x[i];
                continue;
            }
            struct supernode node = supernode_at(schur, (size_t)schur->owner[column], values);
            node.value[find(&node, below) + ((size_t)column - node.first) * node.rows] = x[i];
        }
}

/* update = rows [r, rows) of the supernode times its rows [r, r + width) transposed. */
static void outer_product(const struct supernode *node, size_t r, size_t width, double *update)
{
    cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, (int)(node->rows - r), (int)width, (int)node->columns, 1,
                node->value + r, (int)node->rows, node->value + r, (int)node->rows, 0, update, (int)(node->rows - r));
}

/* Subtract from every interior supernode that rows of this one reach; returns the first row in the tail. */
static size_t update_interior(const struct schur *schur, const struct supernode *node, double *values, double *update,
                              uint32_t *position)
{
    size_t r = node->columns;
    while (r < node->rows && (size_t)node->row[r] < schur->interior) {
        struct supernode target = supernode_at(schur, (size_t)schur->owner[node->row[r]], values);
        size_t width = 1; /* the rows from r that are columns of the target, a panel at most */
        while (r + width < node->rows && width < PANEL && (size_t)node->row[r + width] < target.first + target.columns)
            width++;
        outer_product(node, r, width, update);
        size_t at = find(&target, node->row[r]);
        for (size_t i = r; i < node->rows; i++, at++) { /* the target holds every row that reaches it */
            while (target.row[at] != node->row[i])
                at++;
            position[i - r] = (uint32_t)at;
        }
        for (size_t c = 0; c < width; c++) {
            double *column = target.value + ((size_t)node->row[r + c] - target.first) * target.rows;
            const double *from = update + c * (node->rows - r);
            for (size_t i = c; i < node->rows - r; i++)
                column[position[i]] -= from[i];
        }
        r += width;
    }
    return r;
}

/* Subtract the outer product of the rows in the tail, from row r on, from S; stops when the user wants to. */
static bool update_tail(const struct schur *schur, const struct supernode *node, size_t r, double *S, size_t ld,
                        double *update, struct effort *effort)
{
    size_t count = node->rows - r;
    bool consecutive = count > 0 && (size_t)(node->row[node->rows - 1] - node->row[r]) == count - 1;
    for (; r < node->rows; r += PANEL) {
        size_t width = node->rows - r < PANEL ? node->rows - r : PANEL, below = node->rows - r - width;
        const double *value = node->value + r;
        size_t t = (size_t)node->row[r] - schur->interior;
        int lead = (int)node->rows, k = (int)node->columns;
        if (consecutive) {
            cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, (int)width, k, -1, value, lead, 1, S + t * (ld + 1),
                        (int)ld);
            if (below > 0)
                cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, (int)below, (int)width, k, -1, value + width, lead,
                            value, lead, 1, S + t * (ld + 1) + width, (int)ld);
        } else {
            outer_product(node, r, width, update);
            for (size_t c = 0; c < width; c++) {
                double *column = S + ((size_t)node->row[r + c] - schur->interior) * ld;
                const double *from = update + c * (width + below);
                for (size_t i = c; i < width + below; i++)
                    column[(size_t)node->row[r + i] - schur->interior] -= from[i];
            }
        }
        if (effort_spent(effort, (double)k * (double)width * (double)(width + 2 * below)))
            return false;
    }
    return true;
}

static int eliminate(const struct schur *schur, double *values, double *S, size_t ld, double *update,
                     uint32_t *position, struct effort *effort, size_t *pivot)
{
    for (size_t s = 0; s < schur->supernodes; s++) {
        struct supernode node = supernode_at(schur, s, values);
        int columns = (int)node.columns, lead = (int)node.rows;
        lapack_int info = LAPACKE_dpotrf_work(LAPACK_COL_MAJOR, 'L', columns, node.value, lead);
        if (info != 0) { /* only a K11 that is indefinite: a motion that nothing holds reaches the tail's pivots */
            *pivot = (size_t)((const int32_t *)schur->pattern->Perm)[node.first + (info > 0 ? (size_t)info - 1 : 0)];
            return STATUS_MODEL_FACTOR;
        }
        if (lead > columns)
            cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, lead - columns, columns, 1,
                        node.value, lead, node.value + columns, lead);
        size_t r = update_interior(schur, &node, values, update, position);
        double c = columns, inner = (double)(r - node.columns), outer = (double)(node.rows - r);
        double spent = c * c * c / 3 + c * c * (inner + outer) + c * inner * (inner + 2 * outer);
        if (effort_spent(effort, spent) || !update_tail(schur, &node, r, S, ld, update, effort))
            return STATUS_INTERRUPTED;
    }
    return STATUS_OK;
}

int schur_eliminate(const struct schur *schur, const cholmod_sparse *K, double *S, size_t ld, struct effort *effort,
                    size_t *pivot)
{
    double *values = calloc(schur->value_start[schur->supernodes] + 1, sizeof *values);
    double *update = malloc((schur->rows_max * PANEL + 1) * sizeof *update);
    uint32_t *position = malloc((schur->rows_max + 1) * sizeof *position);
    int status = STATUS_MEMORY;
    if (values && update && position) {
        scatter_matrix(schur, K, values, S, ld);
        status = eliminate(schur, values, S, ld, update, position, effort, pivot);
    }
    free(values);
    free(update);
    free(position);
    return status;
}
