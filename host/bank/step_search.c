#include "step_search.h"

#include <math.h>

/* d log(value) / d log(step): a fifth of the error is a bank about twice as large (DESIGN.md). For the first secant only. */
static const double slope_bytes = -0.4, slope_error = 0.9;
/* Aim this far inside the limit, and be content between this and the limit. */
static const double aim_bytes = 0.004, aim_error = 0.015, content_bytes = 0.015, content_error = 0.03;
static const double narrow = 0.01; /* of a bracket, as a logarithm of the step */

/* Wanted is the least u within the limit: of bytes the finest step, of the error the coarsest. */
static double to_u(const struct step_search *s, double step)
{
    return s->for_bytes ? log(step) : -log(step);
}

static double to_step(const struct step_search *s, double u)
{
    return fmin(s->coarsest, fmax(s->finest, exp(s->for_bytes ? u : -u)));
}

void step_search_start(struct step_search *s, bool for_bytes, double limit, double finest, double coarsest,
                       double first)
{
    *s = (struct step_search){.for_bytes = for_bytes,
                              .limit = limit,
                              .finest = finest,
                              .coarsest = coarsest,
                              .least = INFINITY,
                              .next = fmin(coarsest, fmax(finest, first)),
                              .u_good = INFINITY,
                              .u_bad = -INFINITY};
}

bool step_search_next(struct step_search *s, double *step)
{
    if (s->next == 0 || s->tries >= STEP_SEARCH_TRIES)
        return false;
    *step = s->next;
    s->tries++;
    return true;
}

static double between(const struct step_search *s)
{
    double aim = -(s->for_bytes ? aim_bytes : aim_error), width = s->u_good - s->u_bad;
    double u = s->u_bad + width * (s->v_bad - aim) / (s->v_bad - s->v_good);
    return fmin(s->u_good - 0.05 * width, fmax(s->u_bad + 0.05 * width, u));
}

static double beyond(const struct step_search *s, double slope)
{
    double aim = -(s->for_bytes ? aim_bytes : aim_error);
    if (s->good)
        return s->u_good + fmin(-narrow, (aim - s->v_good) / slope);
    return s->u_bad + fmax(narrow, (aim - s->v_bad) / slope);
}

bool step_search_found(struct step_search *s, double value)
{
    double u = to_u(s, s->next), v = log(value / s->limit), content = s->for_bytes ? content_bytes : content_error;
    double first = to_u(s, s->for_bytes ? s->finest : s->coarsest),
           last = to_u(s, s->for_bytes ? s->coarsest : s->finest);
    bool within = value <= s->limit, better = within && u < s->u_good, ended;
    double slope = s->tries > 1 ? (v - s->v_last) / (u - s->u_last) : -fabs(s->for_bytes ? slope_bytes : slope_error);
    slope = fmin(-0.1, fmax(-2, slope)); /* of v along u; a jitter must not turn it round */
    s->u_last = u;
    s->v_last = v;
    if (better) {
        s->good = true;
        s->step = s->next;
        s->found = value;
        s->u_good = u;
        s->v_good = v;
    }
    if (!within && u > s->u_bad) {
        s->u_bad = u;
        s->v_bad = v;
    }
    if (!within && value < s->least) {
        s->least = value;
        s->step_least = s->next;
    }
    ended =
        (within && v >= -content) || (within && u <= first) || (!within && u >= last) || s->u_good - s->u_bad < narrow;
    s->next = ended ? 0 : to_step(s, s->u_good < INFINITY && s->u_bad > -INFINITY ? between(s) : beyond(s, slope));
    if (!ended && !s->good &&
        s->tries == STEP_SEARCH_TRIES - 1) /* "cannot be met" is said of the end of the range only */
        s->next = to_step(s, last);
    return better;
}
