#include "schur.h"

#include <cblas.h>
#include <lapacke.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { PANEL = 256 };           /* columns of an update at once: bounds the workspace to the longest column x 256 */
static const double STEP = 5e9; /* operations between two looks at the interrupt, about: a tenth of a second */
/* Operations of a supernode from which a second thread pays: below, waiting for each other costs more, by far on a busy
 * machine. */
static const double SHARED_MIN = 1e8;

/* ---- plan ---- */

/* Dense columns of one supernode: row[0 .. columns-1] are the columns themselves, then the rows below, `rows` in all. */
struct supernode {
    size_t first, columns, rows;
    const uint32_t *row;
    double *value;
};

static struct supernode supernode_at(const struct schur *schur, size_t s, double *value)
{
    const int32_t *first = schur->pattern->super;
    return (struct supernode){.first = (size_t)first[s],
                              .columns = (size_t)(first[s + 1] - first[s]),
                              .rows = schur->row_start[s + 1] - schur->row_start[s],
                              .row = schur->row + schur->row_start[s],
                              .value = value};
}

static double operations(const struct supernode *node)
{
    double c = (double)node->columns, b = (double)(node->rows - node->columns);
    return c * c * c / 3 + c * c * b + c * b * b;
}

static int rising(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Lists of the supernodes' rows as they grow, and the children of each supernode in the elimination tree. */
struct lists {
    size_t room, *child, *next; /* SIZE_MAX ends a list */
    uint32_t *seen;             /* per column of R: the last supernode that listed it, plus 1 */
};

/* The columns of R that reach supernode s: those on its own unknowns and those that reach its children. */
static bool gather(struct schur *schur, size_t s, struct lists *lists)
{
    const cholmod_factor *L = schur->pattern;
    const int32_t *first = L->super, *start = L->pi, *row = L->s, *order = L->Perm;
    const struct schur_load *R = schur->R;
    size_t used = schur->row_start[s], inner = (size_t)(start[s + 1] - start[s]);
    if (used + inner + R->columns > lists->room) {
        size_t room = 2 * lists->room + inner + R->columns;
        uint32_t *larger = realloc(schur->row, room * sizeof *larger);
        if (!larger)
            return false;
        schur->row = larger;
        lists->room = room;
    }
    for (size_t i = 0; i < inner; i++)
        schur->row[used++] = (uint32_t)row[(size_t)start[s] + i];
    size_t tail = used;
    for (int32_t p = first[s]; p < first[s + 1]; p++)
        for (size_t k = R->start[order[p]]; k < R->start[order[p] + 1]; k++)
            if (lists->seen[R->column[k]] != s + 1) {
                lists->seen[R->column[k]] = (uint32_t)s + 1;
                schur->row[used++] = (uint32_t)L->n + R->column[k];
            }
    for (size_t c = lists->child[s]; c != SIZE_MAX; c = lists->next[c])
        for (size_t i = schur->row_start[c + 1]; i > schur->row_start[c] && schur->row[i - 1] >= L->n; i--)
            if (lists->seen[schur->row[i - 1] - L->n] != s + 1) {
                lists->seen[schur->row[i - 1] - L->n] = (uint32_t)s + 1;
                schur->row[used++] = schur->row[i - 1];
            }
    qsort(schur->row + tail, used - tail, sizeof *schur->row, rising);
    schur->row_start[s + 1] = used;
    size_t columns = (size_t)(first[s + 1] - first[s]);
    if (inner > columns) {
        size_t parent = (size_t)schur->owner[row[(size_t)start[s] + columns]];
        lists->next[s] = lists->child[parent];
        lists->child[parent] = s;
    }
    return true;
}

/* Operations, and the most memory that is in use at once. */
static bool measure(struct schur *schur, const cholmod_sparse *K)
{
    size_t count = schur->pattern->nsuper, live = 0, peak = 0;
    bool *held = calloc(count + 1, sizeof *held);
    if (!held)
        return false;
    for (size_t s = 0; s < count; s++) {
        struct supernode node = supernode_at(schur, s, NULL);
        live += held[s] ? 0 : node.rows * node.columns;
        for (size_t r = node.columns; r < node.rows && node.row[r] < schur->pattern->n; r++) {
            size_t target = (size_t)schur->owner[node.row[r]];
            if (!held[target]) {
                struct supernode reached = supernode_at(schur, target, NULL);
                live += reached.rows * reached.columns;
                held[target] = true;
            }
        }
        peak = live > peak ? live : peak;
        live -= node.rows * node.columns;
        schur->rows_max = node.rows > schur->rows_max ? node.rows : schur->rows_max;
        schur->operations += operations(&node);
    }
    free(held);
    size_t entries = (size_t)((const int32_t *)K->p)[K->ncol];
    schur->bytes = (peak + schur->rows_max * (PANEL + 1)) * sizeof(double) +
                   2 * entries * (sizeof(double) + sizeof(int32_t)) + schur->row_start[count] * sizeof *schur->row;
    return true;
}

int schur_plan(const cholmod_factor *pattern, const struct schur_load *R, const cholmod_sparse *K, struct schur *schur)
{
    size_t n = pattern->n, count = pattern->nsuper;
    const int32_t *order = pattern->Perm, *first = pattern->super;
    *schur = (struct schur){.pattern = pattern, .R = R};
    schur->rank = malloc((n + 1) * sizeof *schur->rank);
    schur->owner = malloc((n + 1) * sizeof *schur->owner);
    schur->row_start = calloc(count + 1, sizeof *schur->row_start);
    struct lists lists = {.child = malloc((count + 1) * sizeof *lists.child),
                          .next = malloc((count + 1) * sizeof *lists.next),
                          .seen = calloc(R->columns + 1, sizeof *lists.seen)};
    bool good = schur->rank && schur->owner && schur->row_start && lists.child && lists.next && lists.seen;
    if (good) {
        for (size_t p = 0; p < n; p++)
            schur->rank[order[p]] = (int32_t)p;
        for (size_t s = 0; s < count; s++) {
            lists.child[s] = SIZE_MAX;
            for (int32_t p = first[s]; p < first[s + 1]; p++)
                schur->owner[p] = (int32_t)s;
        }
        for (size_t s = 0; s < count && good; s++)
            good = gather(schur, s, &lists);
    }
    good = good && measure(schur, K);
    free(lists.child);
    free(lists.next);
    free(lists.seen);
    if (good)
        return STATUS_OK;
    schur_free(schur);
    return STATUS_MEMORY;
}

void schur_free(struct schur *schur)
{
    free(schur->rank);
    free(schur->owner);
    free(schur->row_start);
    free(schur->row);
    *schur = (struct schur){0};
}

/* ---- numbers ---- */

struct elimination {
    const struct schur *schur;
    cholmod_sparse *K; /* lower half in the order of elimination */
    double **value;    /* per supernode: its dense columns while it is alive */
    double *update;    /* rows_max x PANEL */
    uint32_t *position;
    double *G;
    size_t ld;
    struct effort *effort;
};

static size_t find(const struct supernode *node, uint32_t row)
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

/* The supernode with its memory, which holds its entries of K and R from the start. */
static bool wake(struct elimination *e, size_t s, struct supernode *node)
{
    *node = supernode_at(e->schur, s, e->value[s]);
    if (node->value)
        return true;
    node->value = e->value[s] = calloc(node->rows * node->columns, sizeof *node->value);
    if (!node->value)
        return false;
    const int32_t *start = e->K->p, *row = e->K->i, *order = e->schur->pattern->Perm;
    const double *x = e->K->x;
    const struct schur_load *R = e->schur->R;
    for (size_t c = 0; c < node->columns; c++) {
        size_t p = node->first + c, unknown = (size_t)order[p];
        double *column = node->value + c * node->rows;
        for (int32_t i = start[p]; i < start[p + 1]; i++)
            column[find(node, (uint32_t)row[i])] = x[i];
        for (size_t k = R->start[unknown]; k < R->start[unknown + 1]; k++)
            column[find(node, (uint32_t)e->schur->pattern->n + R->column[k])] = R->weight[k];
    }
    return true;
}

/* update = rows [r, rows) of the supernode times its rows [r, r + width) transposed. */
static void outer_product(const struct supernode *node, size_t r, size_t width, double *update)
{
    cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, (int)(node->rows - r), (int)width, (int)node->columns, 1,
                node->value + r, (int)node->rows, node->value + r, (int)node->rows, 0, update, (int)(node->rows - r));
}

/* Subtract from every later supernode that rows of this one reach. */
static int update_later(struct elimination *e, const struct supernode *node, size_t *tail)
{
    size_t r = node->columns;
    while (r < node->rows && node->row[r] < e->schur->pattern->n) {
        struct supernode target;
        if (!wake(e, (size_t)e->schur->owner[node->row[r]], &target))
            return STATUS_MEMORY;
        size_t width = 1; /* the rows from r that are columns of the target, a panel at most */
        while (r + width < node->rows && width < PANEL && node->row[r + width] < target.first + target.columns)
            width++;
        outer_product(node, r, width, e->update);
        size_t at = find(&target, node->row[r]);
        for (size_t i = r; i < node->rows; i++, at++) { /* the target holds every row that reaches it */
            while (target.row[at] != node->row[i])
                at++;
            e->position[i - r] = (uint32_t)at;
        }
        for (size_t c = 0; c < width; c++) {
            double *column = target.value + (node->row[r + c] - target.first) * target.rows;
            const double *from = e->update + c * (node->rows - r);
            for (size_t i = c; i < node->rows - r; i++)
                column[e->position[i]] -= from[i];
        }
        double spent = (double)node->columns * (double)width * (2 * (double)(node->rows - r) - (double)width);
        if (effort_spent(e->effort, spent))
            return STATUS_INTERRUPTED;
        r += width;
    }
    *tail = r;
    return STATUS_OK;
}

/* Add the outer product of the rows from r on, which are columns of R, to G. */
static int update_G(struct elimination *e, const struct supernode *node, size_t r)
{
    size_t n = e->schur->pattern->n, count = node->rows - r;
    bool consecutive = count > 0 && node->row[node->rows - 1] - node->row[r] == count - 1;
    for (; r < node->rows; r += PANEL) {
        size_t width = node->rows - r < PANEL ? node->rows - r : PANEL, below = node->rows - r - width;
        const double *value = node->value + r;
        size_t t = node->row[r] - n;
        int lead = (int)node->rows, k = (int)node->columns;
        if (consecutive) {
            cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, (int)width, k, 1, value, lead, 1,
                        e->G + t * (e->ld + 1), (int)e->ld);
            if (below > 0)
                cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, (int)below, (int)width, k, 1, value + width, lead,
                            value, lead, 1, e->G + t * (e->ld + 1) + width, (int)e->ld);
        } else {
            outer_product(node, r, width, e->update);
            for (size_t c = 0; c < width; c++) {
                double *column = e->G + (node->row[r + c] - n) * e->ld;
                const double *from = e->update + c * (width + below);
                for (size_t i = c; i < width + below; i++)
                    column[node->row[r + i] - n] += from[i];
            }
        }
        if (effort_spent(e->effort, (double)k * (double)width * (double)(width + 2 * below)))
            return STATUS_INTERRUPTED;
    }
    return STATUS_OK;
}

/* Factor the columns of a supernode: its triangle, then the rows below, not too many at once. */
static int factor(struct elimination *e, const struct supernode *node, double pivot_min, size_t *pivot)
{
    int columns = (int)node->columns, lead = (int)node->rows;
    const int32_t *start = e->K->p, *order = e->schur->pattern->Perm;
    const double *K = e->K->x;
    double c = columns;
    lapack_int info = LAPACKE_dpotrf_work(LAPACK_COL_MAJOR, 'L', columns, node->value, lead);
    size_t good = info > 0 ? (size_t)info - 1 : node->columns;
    for (size_t k = 0; k < good; k++) {
        double diagonal = node->value[k * (node->rows + 1)];
        if (!(diagonal * diagonal > pivot_min * K[start[node->first + k]])) /* the diagonal leads its column */
            good = k;
    }
    if (info != 0 || good < node->columns) {
        *pivot = (size_t)order[node->first + (good < node->columns ? good : 0)];
        return STATUS_MODEL_FACTOR;
    }
    if (effort_spent(e->effort, c * c * c / 3))
        return STATUS_INTERRUPTED;
    size_t step = (size_t)(STEP / (c * c)) + 1;
    for (size_t r = node->columns; r < node->rows; r += step) {
        size_t rows = node->rows - r < step ? node->rows - r : step;
        cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, (int)rows, columns, 1, node->value,
                    lead, node->value + r, lead);
        if (effort_spent(e->effort, c * c * (double)rows))
            return STATUS_INTERRUPTED;
    }
    return STATUS_OK;
}

static int eliminate(struct elimination *e, double pivot_min, size_t *pivot)
{
    int status = STATUS_OK, threads = openblas_get_num_threads();
    for (size_t s = 0; s < e->schur->pattern->nsuper && status == STATUS_OK; s++) {
        struct supernode node;
        size_t tail = 0;
        if (!wake(e, s, &node)) {
            status = STATUS_MEMORY;
            break;
        }
        openblas_set_num_threads(operations(&node) < SHARED_MIN ? 1 : threads);
        status = factor(e, &node, pivot_min, pivot);
        if (status == STATUS_OK)
            status = update_later(e, &node, &tail);
        if (status == STATUS_OK)
            status = update_G(e, &node, tail);
        free(e->value[s]);
        e->value[s] = NULL;
    }
    openblas_set_num_threads(threads);
    return status;
}

/* K in the order of elimination, its lower half. */
static cholmod_sparse *permute(cholmod_sparse *K, const cholmod_factor *pattern, cholmod_common *common)
{
    cholmod_sparse *upper = cholmod_ptranspose(K, 1, pattern->Perm, NULL, 0, common);
    cholmod_sparse *lower = upper ? cholmod_transpose(upper, 1, common) : NULL;
    cholmod_free_sparse(&upper, common);
    return lower;
}

int schur_eliminate(const struct schur *schur, cholmod_sparse *K, double pivot_min, double *G, size_t ld,
                    cholmod_common *common, struct effort *effort, size_t *pivot)
{
    size_t count = schur->pattern->nsuper;
    struct elimination e = {.schur = schur,
                            .K = permute(K, schur->pattern, common),
                            .value = calloc(count + 1, sizeof *e.value),
                            .update = malloc((schur->rows_max * PANEL + 1) * sizeof *e.update),
                            .position = malloc((schur->rows_max + 1) * sizeof *e.position),
                            .G = G,
                            .ld = ld,
                            .effort = effort};
    int status = STATUS_MEMORY;
    if (e.K && e.value && e.update && e.position)
        status = eliminate(&e, pivot_min, pivot);
    for (size_t s = 0; e.value && s < count; s++)
        free(e.value[s]);
    cholmod_free_sparse(&e.K, common);
    free(e.value);
    free(e.update);
    free(e.position);
    return status;
}
