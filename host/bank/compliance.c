#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dense_inverse.h"
#include "model_state.h"
#include "schur.h"

/* Bytes that the machine can still give, or 0 when it does not say. malloc promises more than there is. */
static double memory_available(void)
{
    FILE *file = fopen("/proc/meminfo", "r");
    if (!file)
        return 0;
    char line[128];
    double kilobytes = 0;
    while (fgets(line, sizeof line, file) && sscanf(line, "MemAvailable: %lf kB", &kilobytes) != 1)
        continue;
    fclose(file);
    return 1024 * kilobytes;
}

/* The surface unknowns: place[unknown] in the tail or -1, tail[place] = 3 row + component. */
struct tail {
    int32_t *place;
    uint32_t *at;
    double *pivot_min; /* per place: what is not rounding */
    size_t count;
};

static bool number_rows(const struct model *model, struct compliance *compliance, struct tail *tail)
{
    size_t vertices = model->surface->vertex_count;
    compliance->row_of = malloc((vertices + 1) * sizeof *compliance->row_of);
    tail->place = malloc((model->unknowns + 1) * sizeof *tail->place);
    tail->at = malloc((3 * vertices + 1) * sizeof *tail->at);
    tail->pivot_min = malloc((3 * vertices + 1) * sizeof *tail->pivot_min);
    if (!compliance->row_of || !tail->place || !tail->at || !tail->pivot_min)
        return false;
    const int32_t *start = model->K->p;
    const double *K = model->K->x;
    for (size_t u = 0; u < model->unknowns; u++)
        tail->place[u] = -1;
    for (size_t v = 0; v < vertices; v++) {
        compliance->row_of[v] = UINT32_MAX;
        if (model->fixed_vertex[v])
            continue;
        for (int a = 0; a < 3; a++) {
            int32_t unknown = model_unknown(model, model->surface->node[v], a);
            if (unknown < 0)
                continue;
            tail->at[tail->count] = (uint32_t)(3 * compliance->rows) + (uint32_t)a;
            tail->pivot_min[tail->count] = MODEL_PIVOT_MIN * K[start[unknown]];
            tail->place[unknown] = (int32_t)tail->count++;
        }
        compliance->row_of[v] = (uint32_t)compliance->rows++;
    }
    return true;
}

/* Open up zero rows and columns for the fixed components of vertices that are partly fixed. Entries only move to larger
 * indices, so going down from the last none is overwritten before it has moved. */
static void spread(const struct tail *tail, double *G, size_t ld)
{
    if (tail->count == ld)
        return;
    for (size_t j = tail->count; j-- > 0;)
        for (size_t i = tail->count; i-- > j;) {
            double value = G[i + j * ld];
            G[i + j * ld] = 0;
            G[tail->at[i] + tail->at[j] * ld] = value;
        }
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static bool median_diagonal(struct compliance *compliance)
{
    size_t n = compliance->rows;
    double *mean = malloc((n + 1) * sizeof *mean);
    if (!mean)
        return false;
    for (size_t r = 0; r < n; r++) {
        mean[r] = 0;
        for (size_t a = 3 * r; a < 3 * r + 3; a++)
            mean[r] += compliance->G[a * (3 * n + 1)] / 3;
    }
    qsort(mean, n, sizeof *mean, ascending);
    compliance->median_diagonal_m_N = n % 2 ? mean[n / 2] : (mean[n / 2 - 1] + mean[n / 2]) / 2;
    free(mean);
    return true;
}

static int build(struct model *model, const struct schur *schur, const struct tail *tail, bool quiet,
                 struct compliance *compliance, struct failure *why)
{
    size_t ld = 3 * compliance->rows;
    /* zeroed pages cost nothing until they are written, and only the lower half is */
    double square = 4 * (double)ld * (double)ld, needed = square + (double)schur->bytes;
    double available = memory_available();
    if (available > 0 && needed > available)
        return failure_set(why, STATUS_MEMORY, model->place, NULL,
                           "the compliance of %zu surface vertices needs %.0f MB, %.0f MB are free", compliance->rows,
                           needed / 1e6, available / 1e6);
    compliance->G = calloc(ld * ld, sizeof *compliance->G);
    if (!compliance->G)
        return failure_set(why, STATUS_MEMORY, model->place, NULL,
                           "no memory for the compliance of %zu surface vertices (%.0f MB)", compliance->rows,
                           square / 1e6);
    struct effort effort = {.total = schur->operations + dense_inverse_operations(tail->count)};
    progress_start(&effort.bar, "compliance", quiet);
    size_t pivot = 0;
    int status = schur_eliminate(schur, model->K, compliance->G, ld, &effort, &pivot);
    if (status == STATUS_OK) {
        status = dense_inverse(tail->count, compliance->G, ld, tail->pivot_min, &effort, &pivot);
        for (size_t u = 0; status == STATUS_MODEL_FACTOR && u < model->unknowns; u++)
            if (tail->place[u] >= 0 && (size_t)tail->place[u] == pivot) {
                pivot = u;
                break;
            }
    }
    progress_end(&effort.bar);
    if (status == STATUS_INTERRUPTED)
        return failure_set(why, status, NULL, NULL, "interrupted while computing the compliance");
    if (status == STATUS_MEMORY)
        return failure_set(why, status, model->place, NULL, "no memory to eliminate the interior (%.0f MB)",
                           (double)schur->bytes / 1e6);
    if (status == STATUS_MODEL_FACTOR)
        return model_indefinite(model, pivot, why);
    spread(tail, compliance->G, ld);
    if (!median_diagonal(compliance))
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the median compliance");
    return STATUS_OK;
}

int compliance_build(struct model *model, bool quiet, struct compliance *compliance, struct failure *why)
{
    *compliance = (struct compliance){0};
    struct tail tail = {0};
    struct schur schur = {0};
    int status = STATUS_OK;
    if (!number_rows(model, compliance, &tail))
        status = failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory to number the surface");
    else if (compliance->rows == 0)
        status = failure_set(why, STATUS_SCENE_VALUE, model->place, "fix fewer nodes", "the whole surface is fixed");
    else if (schur_plan(model->K, tail.place, tail.count, &model->common, &schur))
        status =
            failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory to order %zu unknowns", model->unknowns);
    else
        status = build(model, &schur, &tail, quiet, compliance, why);
    schur_free(&schur, &model->common);
    free(tail.place);
    free(tail.at);
    free(tail.pivot_min);
    if (status)
        compliance_free(compliance);
    return status;
}

void compliance_free(struct compliance *compliance)
{
    free(compliance->G);
    free(compliance->row_of);
    *compliance = (struct compliance){0};
}
