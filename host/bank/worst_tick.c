#include "worst_tick.h"

#include <math.h>

#include "effects/cone.h"
#include "effects/convex.h"
#include "row_cache.h"

/* One factorisation of an m x m system, its two substitutions and the look for the next contact (firmware/contact.c): seven
 * instructions to a term of an inner loop, and what stands around the loops. */
static double solver_step(double m)
{
    return 7 * m * m * m / 6 + 22 * m * m + 40 * m;
}

/* One sweep: nine products and sums for each other contact, and the local problem, which may take all its steps when the
 * contact can slide against friction. */
static double sweep(double m, bool slides)
{
    return 36 * m * (m - 1) + (230 + (slides ? 70 * CONE_SLIDE_STEPS : 0)) * m;
}

/* Beside the sweeps: anchors that slide or are measured (points that do are not swept far), the local problems' matrices, what is
 * remembered. */
#define CONE_POINT 1800.0

/* Of the modes: their shapes at each contact, twice; what they take from every pair; the test whether what is left is definite,
 * which may be made twice (firmware/effects/swing.c). */
static double swing(double modes, double m)
{
    double test = m * m / 2 * (14 * modes + 70) + 8 * m * m * m / 6;
    return modes == 0 ? 0 : 2 * test + modes * (90 * m * m + 450 * m + 300) + 200 * m;
}

/* Of the branches: each contact's memory read, advanced and handed on (firmware/effects/viscoelastic.c). */
static double viscoelastic(double branches, double m)
{
    return branches == 0 ? 0 : m * (700 + 300 * branches) + 500 * branches;
}

/* Of the second push, which shares the first's steps but for one: the system assembled again, forms, energies
 * (firmware/effects/neo_hookean.c). */
static double corrected(bool is, double m)
{
    return is ? solver_step(m) + 90 * m * m + 700 * m + 1000 : 0;
}

/* Each tool's energy and the balance of its curve (firmware/effects/quasi_nonlinear.c). */
static double curved(bool is, double m)
{
    return is ? 25 * m * m + 200 * m + 4000 : 0;
}

/* Of what does not give way: each pair of pieces is asked for its closest points twice (firmware/effects/convex.c). */
static double rigid(const struct worst_effects *e)
{
    double steps = 2 * CONVEX_STEPS;
    return e->rigid_pairs * (steps * WORST_TICK_CLOSEST + 500) + e->rigid_points * steps * WORST_TICK_SUPPORT +
           (300 + 80 * e->sweeps) * e->rigid_contacts;
}

struct worst_effects worst_tick_effects(const struct scene *scene)
{
    const struct scene_effects *e = &scene->effects;
    struct worst_effects w = {0};
    w.slides = e->named & EFFECT_FRICTION;
    if (w.slides)
        w.sweeps = e->friction.sweeps;
    else if (e->named & EFFECT_GRASP)
        w.sweeps = e->grasp.sweeps;
    if (e->named & EFFECT_SWING)
        w.modes = e->swing.modes;
    if (e->named & EFFECT_VISCOELASTIC)
        w.branches = (unsigned)e->viscoelastic.series.count + (e->viscoelastic.series.viscosity_s > 0);
    w.spheres = e->named & EFFECT_SHAPE;
    w.second = scene->instrument_count > 1;
    w.curved = e->named & EFFECT_QUASI_NONLINEAR;
    w.corrected = e->named & EFFECT_NEO_HOOKEAN;
    if (e->named & EFFECT_RIGID) {
        w.rigid_pairs = scene_rigid_pairs(scene, &w.rigid_points);
        w.rigid_contacts = scene_rigid_contacts(scene);
    }
    return w;
}

double worst_tick(const struct bank_contact *contact, struct worst_effects effects, unsigned points,
                  uint32_t max_blocks)
{
    double m = points, steps = contact->solver_steps ? contact->solver_steps : BANK_MAX_SOLVER_STEPS;
    double work = contact->row_work ? (double)contact->row_work * BANK_ROW_WORK_UNIT : ROW_CACHE_WORK;
    double block = ROW_CACHE_COLUMN_WORK + ROW_CACHE_BLOCK_WORK + ROW_CACHE_BLOCK_WORDS * ROW_CACHE_WORD_WORK;
    double product = max_blocks * (double)(2 * ROW_CACHE_STEP_WORK + ROW_CACHE_DOT_WORK);
    double overshoot = fmax(ROW_CACHE_PORTION * block, product);
    double pair = max_blocks ? WORST_TICK_PAIR : WORST_TICK_PAIR_PLAIN;
    double point = WORST_TICK_POINT + (max_blocks ? WORST_TICK_ROWS : 0) + (effects.spheres ? WORST_TICK_SPHERE : 0);
    double solver = effects.sweeps ? CONE_POINT * m + effects.sweeps * sweep(m, effects.slides)
                                   : steps * solver_step(m + effects.rigid_contacts);
    solver += swing(effects.modes, m) + viscoelastic(effects.branches, m) + corrected(effects.corrected, m) +
              curved(effects.curved, m) + rigid(&effects);
    return WORST_TICK_BASE + (effects.second ? WORST_TICK_SECOND : 0) + point * m + pair * m * (m + 1) / 2 + solver +
           (max_blocks ? WORST_TICK_WORK * (work + overshoot) : 0);
}

bool worst_tick_fit(struct bank_contact *contact, struct worst_effects effects, unsigned points, uint32_t max_blocks,
                    double limit)
{
    contact->row_work = 0;
    double over = worst_tick(contact, effects, points, max_blocks) - limit;
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
    unsigned sum = 0;
    for (size_t i = 0; i < scene->instrument_count; i++)
        sum += scene->instrument[i].tip_points;
    return sum;
}
