/* Progress of a computation whose steps are weighed by their floating-point operations. */
#ifndef TROCAR_EFFORT_H
#define TROCAR_EFFORT_H

#include "progress.h"

struct effort {
    struct progress bar;
    double done, total; /* floating-point operations */
};

/* Count a finished step; true when the user wants to stop. */
static inline bool effort_spent(struct effort *effort, double operations)
{
    effort->done += operations;
    progress_show(&effort->bar, effort->done < effort->total ? effort->done / effort->total : 1);
    return interrupted();
}

#endif
