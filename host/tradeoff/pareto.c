#include "pareto.h"

#include <math.h>

static bool beats(double cost, double error, double other_cost, double other_error)
{
    return cost <= other_cost && error <= other_error && (cost < other_cost || error < other_error);
}

void pareto_front(size_t count, const double *cost, const double *error, bool *front)
{
    for (size_t i = 0; i < count; i++) {
        front[i] = isfinite(cost[i]) && isfinite(error[i]);
        for (size_t j = 0; j < count && front[i]; j++)
            if (isfinite(cost[j]) && isfinite(error[j]))
                front[i] = !beats(cost[j], error[j], cost[i], error[i]) &&
                           !(j < i && cost[j] == cost[i] && error[j] == error[i]);
    }
}

size_t pareto_within(size_t count, const double *cost, const double *error, double limit)
{
    size_t best = count;
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(cost[i]) || !isfinite(error[i]) || cost[i] > limit)
            continue;
        if (best == count || error[i] < error[best] || (error[i] == error[best] && cost[i] < cost[best]))
            best = i;
    }
    return best;
}
