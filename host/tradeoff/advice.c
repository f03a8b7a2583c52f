/* Fronts and plain-language advice from measured points. */
#include <math.h>
#include <stdlib.h>

#include "pareto.h"
#include "tradeoff.h"

/* Error by which a bank is chosen: patches, which are the hardest of what a tool does (numerics: 1.4 to 4 times a single
 * contact). */
static double bank_error(const struct tradeoff_point *p)
{
    return p->bank[COMPRESSION_ERROR_PATCH].p95;
}

static void name_cost(double limit, bool bytes, char *text, size_t room)
{
    if (bytes)
        snprintf(text, room, "%.0f KiB", limit / 1024);
    else
        snprintf(text, room, "%.0f thousand instructions per millisecond", limit / 1000);
}

static void advise(struct tradeoff *r, bool bytes, double limit, const double *cost, const double *error)
{
    struct tradeoff_advice *a = &r->advice[r->advices++];
    char budget[80];
    *a = (struct tradeoff_advice){.bytes = bytes, .limit = limit, .pick = pareto_within(r->points, cost, error, limit)};
    name_cost(limit, bytes, budget, sizeof budget);
    if (a->pick == r->points) {
        size_t least = 0;
        for (size_t i = 1; i < r->points; i++)
            if (isfinite(cost[i]) && !(cost[i] >= cost[least]))
                least = i;
        char need[80];
        snprintf(need, sizeof need, bytes ? "%.0f bytes" : "%.0f instructions", cost[least]);
        snprintf(a->text, sizeof a->text, "For %s: nothing that was measured fits; the least is %s (%s).", budget, need,
                 r->point[least].name);
        return;
    }
    const struct tradeoff_point *p = &r->point[a->pick];
    if (bytes)
        snprintf(a->text, sizeof a->text,
                 "For %s pick: %s. The bank has %.0f bytes; force error on patches %.3g %% (p95), %.3g %% (max).",
                 budget, p->name, p->bytes, 100 * bank_error(p), 100 * p->bank[COMPRESSION_ERROR_PATCH].max);
    else
        snprintf(
            a->text, sizeof a->text,
            "For %s pick: %s. The worst millisecond takes %.0f; force error along the recording %.3g %% (p95), %.3g "
            "%% (max).",
            budget, p->name, p->load_max, 100 * p->tick_p95, 100 * p->tick_max);
}

int tradeoff_judge(struct tradeoff *r, struct failure *why)
{
    static const double byte_limits[] = {256 * 1024, 512 * 1024, 1024 * 1024, 2048 * 1024, 4096 * 1024};
    static const double instruction_limits[] = {10e3, 20e3, 50e3, 100e3, 240e3, 480e3};
    size_t n = r->points;
    double *work = calloc(4 * n + 1, sizeof *work), *bytes = work, *load = work ? work + n : NULL;
    double *stored = work ? work + 2 * n : NULL, *ticks = work ? work + 3 * n : NULL;
    bool *front = malloc(n + 1);
    if (!work || !front) {
        free(work);
        free(front);
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to compare the settings");
    }
    for (size_t i = 0; i < n; i++) {
        const struct tradeoff_point *p = &r->point[i];
        /* Another discretisation has another exact solve: its errors do not compare. */
        bool same_body = i == 0 || knob_differ(&p->setting, &r->point[0].setting) > STAGE_BODY;
        bytes[i] = same_body ? p->bytes : NAN;
        stored[i] = bank_error(p);
        load[i] = !same_body ? NAN : r->instructions_known ? p->load_max : p->ns_max;
        ticks[i] = p->tick_p95;
    }
    pareto_front(n, bytes, stored, front);
    for (size_t i = 0; i < n; i++)
        r->point[i].front_bytes = front[i];
    pareto_front(n, load, ticks, front);
    for (size_t i = 0; i < n; i++)
        r->point[i].front_time = front[i];
    r->advices = 0;
    for (size_t k = 0; k < sizeof byte_limits / sizeof byte_limits[0] && n; k++)
        advise(r, true, byte_limits[k], bytes, stored);
    for (size_t k = 0; k < sizeof instruction_limits / sizeof instruction_limits[0] && n && r->instructions_known; k++)
        advise(r, false, instruction_limits[k], load, ticks);
    free(work);
    free(front);
    return STATUS_OK;
}
