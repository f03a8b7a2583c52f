/* The elimination order of K, its sparse Cholesky factor, products and solves. */
#include <stdlib.h>
#include <string.h>

#include "model_state.h"

enum { SOLVE_BLOCK = 64 }; /* right-hand sides per solve: wide enough for matrix products, small beside the factor */

void model_multiply(const struct model *model, const double *x, double *y)
{
    const int32_t *start = model->K->p, *row = model->K->i;
    const double *value = model->K->x;
    memset(y, 0, model->unknowns * sizeof *y);
    for (size_t j = 0; j < model->unknowns; j++) {
        double sum = value[start[j]] * x[j]; /* the diagonal leads its column */
        for (int32_t i = start[j] + 1; i < start[j + 1]; i++) {
            y[row[i]] += value[i] * x[j];
            sum += value[i] * x[row[i]];
        }
        y[j] += sum;
    }
}

/* The graph of the nodes with free components, as a lower pattern: the components of a node have the same neighbours. */
static cholmod_sparse *node_graph(struct model *model, int32_t *number)
{
    const int32_t *start = model->K->p, *row = model->K->i;
    size_t count = 0, entries = 0, n = model->unknowns;
    for (size_t u = 0; u < n; u++)
        number[u] = (int32_t)(u > 0 && model->node[u] == model->node[u - 1] ? count - 1 : count++);
    for (int visit = 0; visit < 2; visit++) {
        cholmod_sparse *graph = NULL;
        int32_t *graph_start = NULL, *graph_row = NULL;
        if (visit == 1) {
            graph = cholmod_allocate_sparse(count, count, entries, 1, 1, -1, CHOLMOD_PATTERN, &model->common);
            if (!graph)
                return NULL;
            graph_start = graph->p;
            graph_row = graph->i;
        }
        size_t at = 0;
        for (size_t u = 0; u < n; u++) {
            if (u > 0 && number[u] == number[u - 1])
                continue;
            if (visit == 1)
                graph_start[number[u]] = (int32_t)at;
            for (int32_t i = start[u]; i < start[u + 1]; i++)
                if (i == start[u] || number[row[i]] != number[row[i - 1]]) {
                    if (visit == 1)
                        graph_row[at] = number[row[i]];
                    at++;
                }
        }
        entries = at;
        if (visit == 1) {
            graph_start[count] = (int32_t)at;
            return graph;
        }
    }
    return NULL;
}

/* Position -> unknown, from an order of the nodes: the components of a node stay together. */
static bool order_unknowns(struct model *model, int32_t *number, int32_t *order)
{
    cholmod_common *common = &model->common;
    cholmod_sparse *graph = node_graph(model, number);
    int32_t *first = malloc((model->unknowns + 1) * sizeof *first); /* per node of the graph: its first unknown */
    int methods = common->nmethods, ordering = common->method[0].ordering;
    common->nmethods = 1;
    common->method[0].ordering = CHOLMOD_METIS;
    cholmod_factor *nodes = graph && first ? cholmod_analyze(graph, common) : NULL;
    common->nmethods = methods;
    common->method[0].ordering = ordering;
    if (nodes) {
        size_t at = 0;
        for (size_t u = model->unknowns; u-- > 0;)
            first[number[u]] = (int32_t)u;
        for (size_t p = 0; p < graph->ncol; p++) {
            int32_t node = ((const int32_t *)nodes->Perm)[p];
            for (size_t u = (size_t)first[node]; u < model->unknowns && number[u] == node; u++)
                order[at++] = (int32_t)u;
        }
    }
    bool good = nodes != NULL;
    cholmod_free_factor(&nodes, common);
    cholmod_free_sparse(&graph, common);
    free(first);
    return good;
}

int model_order(struct model *model, struct failure *why)
{
    if (model->pattern)
        return STATUS_OK;
    cholmod_common *common = &model->common;
    int32_t *number = malloc((model->unknowns + 1) * sizeof *number),
            *order = malloc((model->unknowns + 1) * sizeof *order);
    if (number && order && order_unknowns(model, number, order)) {
        int methods = common->nmethods, ordering = common->method[0].ordering;
        common->nmethods = 1;
        common->method[0].ordering = CHOLMOD_GIVEN;
        model->pattern = cholmod_analyze_p(model->K, order, NULL, 0, common);
        common->nmethods = methods;
        common->method[0].ordering = ordering;
    } else if (common->status == CHOLMOD_OK)
        common->status = CHOLMOD_OUT_OF_MEMORY;
    free(number);
    free(order);
    return model->pattern ? STATUS_OK : model_cholmod_failure(model, "order", why);
}

/* The first unknown whose pivot is only rounding, or `unknowns`. */
static size_t weak_pivot(const struct model *model, const cholmod_factor *L)
{
    const int32_t *first = L->super, *rows = L->pi, *values = L->px, *order = L->Perm, *start = model->K->p;
    const double *x = L->x, *K = model->K->x;
    for (size_t s = 0; s < L->nsuper; s++)
        for (int32_t k = 0; k < first[s + 1] - first[s]; k++) {
            double pivot = x[(size_t)values[s] + (size_t)k * ((size_t)(rows[s + 1] - rows[s]) + 1)];
            int32_t unknown = order[first[s] + k];
            if (!(pivot * pivot > MODEL_PIVOT_MIN * K[start[unknown]])) /* the diagonal leads its column */
                return (size_t)unknown;
        }
    return model->unknowns;
}

static int factor(struct model *model, struct failure *why)
{
    if (model->factor)
        return STATUS_OK;
    cholmod_common *common = &model->common;
    int status = model_order(model, why);
    if (status)
        return status;
    cholmod_factor *L = cholmod_copy_factor(model->pattern, common);
    if (!L)
        return model_cholmod_failure(model, "factor", why);
    cholmod_factorize(model->K, L, common);
    if (common->status == CHOLMOD_NOT_POSDEF || (common->status == CHOLMOD_OK && L->minor < model->unknowns))
        status = model_indefinite(model, (size_t)((const int32_t *)L->Perm)[L->minor], why);
    else if (common->status < CHOLMOD_OK)
        status = model_cholmod_failure(model, "factor", why);
    else if (weak_pivot(model, L) < model->unknowns)
        status = model_indefinite(model, weak_pivot(model, L), why);
    if (status)
        cholmod_free_factor(&L, common);
    model->factor = L;
    return status;
}

/* A caller's array as CHOLMOD sees it. */
static cholmod_dense dense(size_t rows, size_t columns, double *values)
{
    return (cholmod_dense){.nrow = rows,
                           .ncol = columns,
                           .nzmax = rows * columns,
                           .d = rows,
                           .x = values,
                           .xtype = CHOLMOD_REAL,
                           .dtype = CHOLMOD_DOUBLE};
}

int model_solve_with(struct model *model, cholmod_factor *L, size_t columns, const double *f, double *u,
                     struct failure *why)
{
    int status = STATUS_OK;
    cholmod_dense *X = NULL, *Y = NULL, *E = NULL; /* kept between blocks */
    for (size_t c = 0; c < columns && status == STATUS_OK; c += SOLVE_BLOCK) {
        size_t width = columns - c < SOLVE_BLOCK ? columns - c : SOLVE_BLOCK;
        cholmod_dense B = dense(model->unknowns, width, (double *)(f + c * model->unknowns)); /* read only */
        if (interrupted())
            status =
                failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted after %zu of %zu solves", c, columns);
        else if (!cholmod_solve2(CHOLMOD_A, L, &B, NULL, &X, NULL, &Y, &E, &model->common))
            status = model_cholmod_failure(model, "solve", why);
        else
            memcpy(u + c * model->unknowns, X->x, width * model->unknowns * sizeof *u);
    }
    cholmod_free_dense(&X, &model->common);
    cholmod_free_dense(&Y, &model->common);
    cholmod_free_dense(&E, &model->common);
    return status;
}

int model_solve(struct model *model, size_t columns, const double *f, double *u, struct failure *why)
{
    int status = factor(model, why);
    return status ? status : model_solve_with(model, model->factor, columns, f, u, why);
}
