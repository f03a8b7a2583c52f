/* The search for a rounding step within limits: which to try next, from what the tried ones were found to be.
 *
 * With a limit of bytes: the finest step (the least error) whose bank fits. With a limit of the error alone: the coarsest
 * step (the least bytes) that keeps it. Bytes fall and the error rises with the step, both about as a power of it, so each
 * try is a secant in logarithms, kept inside the bracket; the error jitters by a few per cent (it is drawn), hence what is
 * tried again is never assumed. Ends within 1.5 % of the limit of bytes, 3 % of that of the error, 1 % of the step, or after
 * STEP_SEARCH_TRIES (a bank's bytes jump by some per cent where a multiple of the rounding changes).
 *
 *   step_search_start; while (step_search_next(&s, &step)) { measure; if (step_search_found(&s, ...)) keep it; }
 *   s.good: something was kept; else s.least says how near the tries came. */
#ifndef TROCAR_STEP_SEARCH_H
#define TROCAR_STEP_SEARCH_H

#include <stdbool.h>

enum { STEP_SEARCH_TRIES = 10 };

struct step_search {
    bool for_bytes;          /* else for the error */
    double limit;            /* of bytes or of the error */
    double finest, coarsest; /* range of the step */
    int tries;
    bool good;          /* a step within the limit was found: `step` */
    double step, found; /* best so far, and its value */
    double least;       /* value nearest to the limit among those beyond it */
    double step_least;  /* where */
    double next;        /* to try; 0: the search has ended */
    /* Ends of the bracket as logarithms: u rises towards what is wanted no more, v = log(value / limit). */
    double u_good, v_good, u_bad, v_bad, u_last, v_last;
};

/* `first`: where to begin. */
void step_search_start(struct step_search *s, bool for_bytes, double limit, double finest, double coarsest,
                       double first);
/* False when the search has ended. */
bool step_search_next(struct step_search *s, double *step);
/* The value (bytes or error) at the step that was given last. True: it is the best so far. */
bool step_search_found(struct step_search *s, double value);

#endif
