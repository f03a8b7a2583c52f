#include "budget.h"

#include <math.h>

#include "worst_tick.h"

/* What would keep the limit if the scene said so: fewer steps of the solver, else fewer points. */
static void advise(const struct scene *scene, const struct bank_contact *contact, uint32_t max_blocks, double limit,
                   double least, char *text, size_t room)
{
    unsigned points = worst_tick_points(scene);
    struct bank_contact other = *contact;
    int used = snprintf(text, room, "allow %.0f instructions", least);
    for (unsigned steps = 24; steps >= 3; steps /= 2) {
        other.solver_steps = (uint16_t)steps;
        if (steps < (contact->solver_steps ? contact->solver_steps : BANK_MAX_SOLVER_STEPS) &&
            worst_tick_fit(&other, worst_tick_effects(scene), points, max_blocks, limit)) {
            snprintf(text + used, room - (size_t)used, ", or write contact: {steps: %u} in the scene", steps);
            return;
        }
    }
    other = *contact;
    for (unsigned fewer = points - 1; fewer >= 1; fewer--)
        if (worst_tick_fit(&other, worst_tick_effects(scene), fewer, max_blocks, limit)) {
            snprintf(text + used, room - (size_t)used, ", or give the tip %u points", fewer);
            return;
        }
}

static int refuse_instructions(const struct scene *scene, const struct bank_contact *contact, uint32_t max_blocks,
                               struct failure *why)
{
    double limit = scene->budget_instructions,
           least = ceil(worst_tick(contact, worst_tick_effects(scene), worst_tick_points(scene), max_blocks));
    char remedy[200];
    advise(scene, contact, max_blocks, limit, least, remedy, sizeof remedy);
    return failure_set(why, STATUS_BANK_LIMIT, scene->path, remedy,
                       "%.0f instructions a tick cannot be met; the worst takes %.0f, %.0f more, with %u points and at "
                       "most %u steps of the solver",
                       limit, least, least - limit, worst_tick_points(scene),
                       contact->solver_steps ? contact->solver_steps : (unsigned)BANK_MAX_SOLVER_STEPS);
}

int budget_begin(const struct scene *scene, const struct pack *pack, double provenance_bytes,
                 struct compression *wanted, struct failure *why)
{
    struct bank_contact contact = {.solver_steps = (uint16_t)scene->solver_steps};
    double plain_bytes = (double)pack->bytes + provenance_bytes, limit = scene->budget_instructions;
    unsigned points = worst_tick_points(scene);
    if (!(wanted->force_error > 0))
        wanted->force_error = scene->budget_force_error;
    wanted->bytes = scene->budget_bank_bytes;
    wanted->rest_bytes = (double)pack_rest(pack) + provenance_bytes;
    bool plain_fits = wanted->bytes > 0 && plain_bytes <= wanted->bytes &&
                      worst_tick_fit(&contact, worst_tick_effects(scene), points, 0, limit);
    if (plain_fits && !(wanted->step > 0))
        wanted->plain = true;
    if (wanted->plain && wanted->bytes > 0 && plain_bytes > wanted->bytes) {
        char remedy[100];
        snprintf(remedy, sizeof remedy, "allow %.0f bytes, or leave --plain out", plain_bytes);
        return failure_set(why, STATUS_BANK_LIMIT, scene->path, remedy,
                           "a plain bank has %.0f bytes, %.0f more than the limit of %.0f", plain_bytes,
                           plain_bytes - wanted->bytes, wanted->bytes);
    }
    uint32_t blocks = wanted->plain ? 0 : 1; /* at least */
    return worst_tick_fit(&contact, worst_tick_effects(scene), points, blocks, limit)
               ? STATUS_OK
               : refuse_instructions(scene, &contact, blocks, why);
}

int budget_instructions_fit(const struct scene *scene, const struct compressed *compressed,
                            struct bank_contact *contact, double *worst, struct failure *why)
{
    uint32_t blocks = compressed ? ((const struct bank_factor *)(const void *)compressed->bytes)->max_blocks : 0;
    bool kept = worst_tick_fit(contact, worst_tick_effects(scene), worst_tick_points(scene), blocks,
                               scene->budget_instructions);
    *worst = worst_tick(contact, worst_tick_effects(scene), worst_tick_points(scene), blocks);
    return kept ? STATUS_OK : refuse_instructions(scene, contact, blocks, why);
}
