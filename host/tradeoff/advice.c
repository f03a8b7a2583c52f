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
    *a = (struct tradeoff_advice){.of = bytes ? BUDGET_BYTES : BUDGET_INSTRUCTIONS,
                                  .limit = limit,
                                  .pick = pareto_within(r->points, cost, error, limit)};
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

/* "1048576 bytes, 240000 instructions in the worst tick, a force error of 0.5 %": what is limited. */
static void name_budget(const struct tradeoff *r, char *text, size_t room)
{
    size_t used = 0;
    *text = 0;
    if (r->budget_bytes > 0)
        used += (size_t)snprintf(text + used, room - used, "%.0f bytes", r->budget_bytes);
    if (r->budget_instructions > 0)
        used += (size_t)snprintf(text + used, room - used, "%s%.0f instructions in the worst tick", used ? ", " : "",
                                 r->budget_instructions);
    if (r->budget_force_error > 0)
        snprintf(text + used, room - used, "%sa force error of %.4g %%", used ? ", " : "", 100 * r->budget_force_error);
}

/* How far a setting is beyond the scene's budget: the largest ratio to a limit; at most 1 when it keeps all. */
static double beyond(const struct tradeoff *r, const struct tradeoff_point *p)
{
    double most = 0;
    if (r->budget_bytes > 0)
        most = fmax(most, p->bytes / r->budget_bytes);
    if (r->budget_instructions > 0)
        most = fmax(most, p->worst_bound / r->budget_instructions);
    if (r->budget_force_error > 0)
        most = fmax(most, bank_error(p) / r->budget_force_error);
    return isfinite(p->bytes) && isfinite(bank_error(p)) && isfinite(p->worst_bound) ? most : INFINITY;
}

/* Of the settings that keep the scene's budget the one that trocar build would make (budget.h): the least force error, or
 * the least bytes when only the error is limited; of equal banks the one with the least tick error. */
static void advise_scene(struct tradeoff *r, const bool *same_body)
{
    if (!(r->budget_bytes > 0) && !(r->budget_instructions > 0) && !(r->budget_force_error > 0))
        return;
    struct tradeoff_advice *a = &r->advice[r->advices++];
    bool smallest = r->budget_force_error > 0 && !(r->budget_bytes > 0);
    size_t nearest = 0;
    char budget[160];
    *a = (struct tradeoff_advice){.of = BUDGET_SCENE, .pick = r->points};
    for (size_t i = 0; i < r->points; i++) {
        const struct tradeoff_point *p = &r->point[i], *best = a->pick < r->points ? &r->point[a->pick] : NULL;
        if (!same_body[i])
            continue;
        if (beyond(r, p) < beyond(r, &r->point[nearest]))
            nearest = i;
        double value = smallest ? p->bytes : bank_error(p),
               other = best ? smallest ? best->bytes : bank_error(best) : 0;
        if (beyond(r, p) <= 1 && (!best || value < other || (value == other && p->tick_p95 < best->tick_p95)))
            a->pick = i;
    }
    name_budget(r, budget, sizeof budget);
    const struct tradeoff_point *p = &r->point[a->pick < r->points ? a->pick : nearest];
    snprintf(a->text, sizeof a->text,
             "For the scene's budget (%s) %s: %s. The bank has %.0f bytes, force error on patches "
             "%.3g %% (p95), at most %.0f instructions in a Cortex-M7's worst tick.",
             budget, a->pick < r->points ? "pick" : "nothing that was measured fits; the nearest is", p->name, p->bytes,
             100 * bank_error(p), p->worst_bound);
}

int tradeoff_judge(struct tradeoff *r, struct failure *why)
{
    static const double byte_limits[] = {256 * 1024, 512 * 1024, 1024 * 1024, 2048 * 1024, 4096 * 1024};
    static const double instruction_limits[] = {10e3, 20e3, 50e3, 100e3, 240e3, 480e3};
    size_t n = r->points;
    double *work = calloc(4 * n + 1, sizeof *work), *bytes = work, *load = work ? work + n : NULL;
    double *stored = work ? work + 2 * n : NULL, *ticks = work ? work + 3 * n : NULL;
    bool *front = malloc(n + 1), *same = malloc(n + 1);
    if (!work || !front || !same) {
        free(work);
        free(front);
        free(same);
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to compare the settings");
    }
    for (size_t i = 0; i < n; i++) {
        const struct tradeoff_point *p = &r->point[i];
        /* Another discretisation has another exact solve: its errors do not compare. */
        bool same_body = same[i] = i == 0 || knob_differ(&p->setting, &r->point[0].setting) > STAGE_BODY;
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
    if (n)
        advise_scene(r, same);
    for (size_t k = 0; k < sizeof byte_limits / sizeof byte_limits[0] && n; k++)
        advise(r, true, byte_limits[k], bytes, stored);
    for (size_t k = 0; k < sizeof instruction_limits / sizeof instruction_limits[0] && n && r->instructions_known; k++)
        advise(r, false, instruction_limits[k], load, ticks);
    free(work);
    free(front);
    free(same);
    return STATUS_OK;
}
