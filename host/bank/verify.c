#include "verify.h"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "grid.h"
#include "progress.h"
#include "row_code.h"
#include "worst_tick.h"

static void differs(struct verify_result *result, const char *format, ...) __attribute__((format(printf, 2, 3)));

static void differs(struct verify_result *result, const char *format, ...)
{
    if (*result->differs)
        return;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(result->differs, sizeof result->differs, format, arguments);
    va_end(arguments);
}

/* body_open has compared positions and triangles already. */
static void check_surface(const struct bank_view *bank, const struct body *body, struct verify_result *result)
{
    const struct surface *s = &body->surface;
    const bool *fixed = model_fixed_vertices(body->model);
    for (size_t t = 0; t < s->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            if (s->neighbours[3 * t + k] != bank->triangles[t].neighbour[k])
                differs(result, "triangle %zu has another neighbour than in the mesh", t);
    for (size_t v = 0; v < s->vertex_count; v++) {
        for (int k = 0; k < 3; k++)
            if (fabs(s->normals[3 * v + k] - (double)bank->normals[3 * v + k]) > 1e-6)
                differs(result, "the normal of vertex %zu is not the surface's", v);
        if (fixed[v] != (bank->row_of[v] == BANK_NONE))
            differs(result, "vertex %zu is %s in the scene, but not in the bank", v, fixed[v] ? "fixed" : "free");
    }
    uint32_t missing = grid_missing(bank);
    if (missing != UINT32_MAX)
        differs(result, "the grid does not list triangle %u in a cell that it meets", missing);
}

static int rising(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static bool near(const float *a, const float *b, int n)
{
    for (int k = 0; k < n; k++)
        if (!(fabsf(a[k] - b[k]) <= 2 * FLT_EPSILON * fmaxf(1, fabsf(b[k]))))
            return false;
    return true;
}

/* Place and directions to two float32 roundings: they come from the scene file here, from its printed form in the bank, and the
 * axis is made a unit vector in between. All else exactly. */
static bool same_tool(const struct bank_tool *scene, const struct bank_tool *bank)
{
    struct bank_tool t = *scene;
    if (!near(t.trocar_m, bank->trocar_m, 3) || !near(t.rotation, bank->rotation, 9) ||
        !near(t.gravity_direction, bank->gravity_direction, 3))
        return false;
    memcpy(t.trocar_m, bank->trocar_m, sizeof t.trocar_m);
    memcpy(t.gravity_direction, bank->gravity_direction, sizeof t.gravity_direction);
    memcpy(t.rotation, bank->rotation, sizeof t.rotation);
    return memcmp(&t, bank, sizeof t) == 0;
}

/* Coarsest rounding of an entry of the factor, (m/N)^(1/2). */
static double coarsest(const struct bank_factor_view *f)
{
    uint32_t most = 1;
    for (uint32_t l = 0; l < f->header->levels; l++)
        for (uint32_t log = f->level_log[l]; log < 64 && log < f->level_log[l] + (uint32_t)f->header->classes; log++) {
            uint32_t multiple = row_multiple(f->level_unit[l], f->distance_unit[log]);
            most = multiple > most ? multiple : most;
        }
    return most * (double)f->header->step;
}

/* Six standard deviations of an entry of G by the rounding of the factor: trace of G_ii is the square of a row. */
static double compressed_tolerance(const struct bank_view *bank, uint32_t i, uint32_t j)
{
    float a[9], b[9];
    if (bank->half)
        return 0;
    bank_view_compliance(bank, i, i, a);
    bank_view_compliance(bank, j, j, b);
    double most = fmax(fmax((double)a[0], (double)a[4]), (double)a[8]);
    most += fmax(fmax((double)b[0], (double)b[4]), (double)b[8]);
    return 6 * coarsest(&bank->factor) * sqrt(most / 12);
}

static int check_records(const struct bank_view *bank, const struct body *body, struct verify_result *result,
                         struct failure *why)
{
    double *trace = malloc(bank->row_count * sizeof *trace);
    if (!trace)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to check the bank");
    for (uint32_t i = 0; i < bank->row_count; i++) {
        float block[9];
        bank_view_compliance(bank, i, i, block);
        trace[i] = ((double)block[0] + (double)block[4] + (double)block[8]) / 3;
    }
    qsort(trace, bank->row_count, sizeof *trace, rising);
    uint32_t n = bank->row_count;
    double median = 0.5 * (trace[(n - 1) / 2] + trace[n / 2]), typical = (double)bank->contact->typical_compliance_m_N;
    /* any median lies between the two middle values; each is a sum of three that were rounded to float32, or compressed */
    double slack = 1e-6 * typical + compressed_tolerance(bank, 0, 0);
    if (typical < trace[(n - 1) / 2] - slack || typical > trace[n / 2] + slack)
        differs(result, "the typical compliance is %g m/N, the median of the diagonal %g", typical, median);
    free(trace);
    struct bank_contact contact;
    scene_contact(&body->scene, typical, &contact);
    /* the regularisation is a fraction of the median in double, `typical` is its float32: one unit in the last place */
    float epsilon = bank->contact->regularisation_m_N;
    if (fabsf(contact.regularisation_m_N - epsilon) > 2e-7f * epsilon)
        differs(result, "the regularisation is %g m/N, the scene's %g", (double)epsilon,
                (double)contact.regularisation_m_N);
    contact.regularisation_m_N = epsilon;
    contact.row_work = bank->contact->row_work; /* follows from the budget, which a command line may have set */
    double worst = worst_tick(bank->contact, worst_tick_effects(&body->scene), worst_tick_points(&body->scene),
                              row_max_blocks(bank));
    if (body->scene.budget_instructions > 0 && worst > body->scene.budget_instructions)
        differs(result, "the worst tick takes %.0f instructions, the scene allows %.0f", worst,
                body->scene.budget_instructions);
    if (memcmp(&contact, bank->contact, sizeof contact) != 0)
        differs(result, "the contact record is not the scene's");
    if (bank->tool_count != body->scene.instrument_count)
        differs(result, "the bank has %u instruments, the scene %zu", bank->tool_count, body->scene.instrument_count);
    for (uint32_t i = 0; i < bank->tool_count && i < body->scene.instrument_count; i++) {
        struct bank_tool tool;
        int status = scene_tool(&body->scene.instrument[i], &tool, why);
        if (status)
            return status;
        if (!same_tool(&tool, &bank->tools[i]))
            differs(result, "the record of instrument %u is not the scene's", i);
    }
    return STATUS_OK;
}

struct column {
    double *f, *u, *error; /* unknowns each */
    size_t unknowns;
};

/* Unit force on component b of a vertex; the displacement, and an estimate of its error. */
static int solve_column(struct body *body, uint32_t vertex, int b, struct column *c, double *error, struct failure *why)
{
    *error = 0;
    memset(c->f, 0, c->unknowns * sizeof *c->f);
    model_load(body->model, vertex, b, 1, c->f);
    int status = model_solve(body->model, 1, c->f, c->u, why);
    if (status)
        return status;
    model_multiply(body->model, c->u, c->error);
    for (size_t k = 0; k < c->unknowns; k++)
        c->f[k] -= c->error[k];
    status = model_solve(body->model, 1, c->f, c->error, why);
    if (status)
        return status;
    for (size_t k = 0; k < c->unknowns; k++)
        *error = fmax(*error, fabs(c->error[k]));
    return STATUS_OK;
}

static int check_column(const struct bank_view *bank, struct body *body, uint32_t vertex, struct column *c,
                        struct verify_result *result, struct failure *why)
{
    for (int b = 0; b < 3; b++) {
        double error, largest = 0, difference = 0;
        int status = solve_column(body, vertex, b, c, &error, why);
        if (status)
            return status;
        for (uint32_t v = 0; v < bank->vertex_count; v++) {
            if (bank->row_of[v] == BANK_NONE)
                continue;
            float block[9];
            bank_view_compliance(bank, bank->row_of[v], bank->row_of[vertex], block);
            double rounding = compressed_tolerance(bank, bank->row_of[v], bank->row_of[vertex]);
            for (int a = 0; a < 3; a++) {
                double direct = model_displacement(body->model, v, a, c->u), stored = (double)block[3 * a + b];
                double off = fabs(stored - direct);
                double tolerance = 0x1p-24 * fabs(direct) + VERIFY_SOLVE_MARGIN * error + 0x1p-149 + rounding;
                largest = fmax(largest, fabs(direct));
                difference = fmax(difference, off);
                result->entries++;
                result->worst = fmax(result->worst, off / tolerance);
                if (off <= tolerance)
                    continue;
                result->wrong++;
                differs(result,
                        "a force on vertex %u along %c moves vertex %u along %c by %.9g m/N in the bank, by %.9g in a "
                        "direct solve (tolerance %.2g)",
                        vertex, "xyz"[b], v, "xyz"[a], stored, direct, tolerance);
            }
        }
        if (largest > 0)
            result->worst_relative = fmax(result->worst_relative, difference / largest);
    }
    result->columns++;
    return STATUS_OK;
}

/* The vertices that own a row, shuffled as far as `columns`. */
static size_t draw(const struct bank_view *bank, size_t columns, uint64_t seed, uint32_t *vertex)
{
    size_t n = 0;
    for (uint32_t v = 0; v < bank->vertex_count; v++)
        if (bank->row_of[v] != BANK_NONE)
            vertex[n++] = v;
    if (columns > n)
        columns = n;
    for (size_t k = 0; k < columns; k++) {
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        size_t other = k + (size_t)((seed >> 33) % (n - k));
        uint32_t keep = vertex[k];
        vertex[k] = vertex[other];
        vertex[other] = keep;
    }
    return columns;
}

int bank_verify(const struct bank_view *bank, struct body *body, size_t columns, uint64_t seed, bool quiet,
                struct verify_result *result, struct failure *why)
{
    *result = (struct verify_result){0};
    check_surface(bank, body, result);
    int status = check_records(bank, body, result, why);
    if (status)
        return status;
    struct column c = {.unknowns = model_unknowns(body->model)};
    uint32_t *vertex = malloc(bank->vertex_count * sizeof *vertex);
    c.f = malloc(c.unknowns * sizeof *c.f);
    c.u = malloc(c.unknowns * sizeof *c.u);
    c.error = malloc(c.unknowns * sizeof *c.error);
    if (!vertex || !c.f || !c.u || !c.error)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to check the bank");
    else
        columns = draw(bank, columns, seed, vertex);
    struct progress bar;
    progress_start(&bar, "verifying", quiet);
    for (size_t k = 0; k < columns && !status; k++) {
        if (interrupted())
            status = failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while verifying");
        else
            status = check_column(bank, body, vertex[k], &c, result, why);
        progress_show(&bar, (double)(k + 1) / (double)columns);
    }
    progress_end(&bar);
    free(vertex);
    free(c.f);
    free(c.u);
    free(c.error);
    return status;
}
