#include <math.h>
#include <stdlib.h>
#include <string.h>

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

/* Number the rows of G, and lay R out by unknowns. A fixed component has no column: its row and column stay zero. */
static bool number_rows(const struct model *model, struct compliance *compliance, struct schur_load *load)
{
    size_t vertices = model->surface->vertex_count;
    const struct projection *R = &model->projection;
    compliance->row_of = malloc((vertices + 1) * sizeof *compliance->row_of);
    load->start = calloc(model->unknowns + 2, sizeof *load->start);
    if (!compliance->row_of || !load->start)
        return false;
    for (int visit = 0; visit < 2; visit++) {
        if (visit == 1) { /* counted two places ahead: after the fill, start[u] is where it belongs */
            for (size_t u = 2; u <= model->unknowns + 1; u++)
                load->start[u] += load->start[u - 1];
            load->column = malloc((load->start[model->unknowns + 1] + 1) * sizeof *load->column);
            load->weight = malloc((load->start[model->unknowns + 1] + 1) * sizeof *load->weight);
            if (!load->column || !load->weight)
                return false;
            compliance->rows = 0;
        }
        for (size_t v = 0; v < vertices; v++) {
            compliance->row_of[v] = UINT32_MAX;
            if (model->fixed_vertex[v])
                continue;
            compliance->row_of[v] = (uint32_t)compliance->rows++;
            for (size_t k = R->start[v]; k < R->start[v + 1]; k++)
                for (int a = 0; a < 3; a++) {
                    int32_t unknown = model_unknown(model, R->node[k], a);
                    if (unknown < 0 || model_unknown(model, model->surface->node[v], a) < 0)
                        continue;
                    if (visit == 0) {
                        load->start[unknown + 2]++;
                        continue;
                    }
                    size_t at = load->start[unknown + 1]++;
                    load->column[at] = 3 * compliance->row_of[v] + (uint32_t)a;
                    load->weight[at] = R->weight[k];
                }
        }
    }
    load->columns = 3 * compliance->rows;
    return true;
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

static int build(struct model *model, const struct schur *schur, bool quiet, struct compliance *compliance,
                 struct failure *why)
{
    size_t ld = 3 * compliance->rows, pivot = 0;
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
    struct effort effort = {.total = schur->operations};
    progress_start(&effort.bar, "compliance", quiet);
    int status = schur_eliminate(schur, model->K, MODEL_PIVOT_MIN, compliance->G, ld, &model->common, &effort, &pivot);
    progress_end(&effort.bar);
    if (status == STATUS_INTERRUPTED)
        return failure_set(why, status, NULL, NULL, "interrupted while computing the compliance");
    if (status == STATUS_MEMORY)
        return failure_set(why, status, model->place, NULL, "no memory to eliminate the body (%.0f MB)",
                           (double)schur->bytes / 1e6);
    if (status == STATUS_MODEL_FACTOR)
        return model_indefinite(model, pivot, why);
    if (!median_diagonal(compliance))
        return failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory for the median compliance");
    return STATUS_OK;
}

int compliance_build(struct model *model, bool quiet, struct compliance *compliance, struct failure *why)
{
    *compliance = (struct compliance){0};
    struct schur_load R = {0};
    struct schur schur = {0};
    int status = STATUS_OK;
    if (!number_rows(model, compliance, &R))
        status = failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory to number the surface");
    else if (compliance->rows == 0)
        status = failure_set(why, STATUS_SCENE_VALUE, model->place, "fix fewer nodes", "the whole surface is fixed");
    else
        status = model_order(model, why);
    if (status == STATUS_OK && schur_plan(model->pattern, &R, model->K, &schur))
        status =
            failure_set(why, STATUS_MEMORY, model->place, NULL, "no memory to plan for %zu unknowns", model->unknowns);
    if (status == STATUS_OK)
        status = build(model, &schur, quiet, compliance, why);
    schur_free(&schur);
    free(R.start);
    free(R.column);
    free(R.weight);
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
