#include "worst_tick.h"

#include <math.h>

#include "row_cache.h"

/* One factorisation of an m x m system, its two substitutions and the look for the next contact (firmware/contact.c): seven
 * instructions to a term of an inner loop, and what stands around the loops. */
static double solver_step(double m)
{
    return 7 * m * m * m / 6 + 22 * m * m + 40 * m;
}

double worst_tick(const struct bank_contact *contact, unsigned points, uint32_t max_blocks)
{
    double m = points, steps = contact->solver_steps ? contact->solver_steps : BANK_MAX_SOLVER_STEPS;
    double work = contact->row_work ? (double)contact->row_work * BANK_ROW_WORK_UNIT : ROW_CACHE_WORK;
    double portion = ROW_CACHE_PORTION * (ROW_CACHE_COLUMN_WORK + ROW_CACHE_BLOCK_WORK);
    double overshoot = fmax(portion, (double)max_blocks * ROW_CACHE_DOT_WORK);
    double pair = max_blocks ? WORST_TICK_PAIR : WORST_TICK_PAIR_PLAIN;
    return WORST_TICK_BASE + WORST_TICK_POINT * m + pair * m * (m + 1) / 2 + steps * solver_step(m) +
           (max_blocks ? WORST_TICK_WORK * (work + overshoot) : 0);
}

bool worst_tick_fit(struct bank_contact *contact, unsigned points, uint32_t max_blocks, double limit)
{
    contact->row_work = 0;
    double over = worst_tick(contact, points, max_blocks) - limit;
    if (limit == 0 || over <= 0)
        return true;
    if (max_blocks == 0)
        return false;
    double units = floor((ROW_CACHE_WORK - over / WORST_TICK_WORK) / BANK_ROW_WORK_UNIT);
    contact->row_work = (uint16_t)fmax(1, fmin(units, BANK_MAX_ROW_WORK));
    return units >= 1;
}

unsigned worst_tick_points(const struct scene *scene)
{
    unsigned most = 0;
    for (size_t i = 0; i < scene->instrument_count; i++)
        most = scene->instrument[i].tip_points > most ? scene->instrument[i].tip_points : most;
    return most;
}
