/* The Pareto front: what no other choice beats in both respects. */
#ifndef TROCAR_PARETO_H
#define TROCAR_PARETO_H

#include <stdbool.h>
#include <stddef.h>

/* front[i]: no j has cost and error both at most those of i and one of them less; of equal pairs only the first is on the
 * front. Pairs with a number that is not finite (not measured) are not. */
void pareto_front(size_t count, const double *cost, const double *error, bool *front);

/* The choice of least error with cost <= limit, the cheaper of equals; `count` when there is none. */
size_t pareto_within(size_t count, const double *cost, const double *error, double limit);

#endif
