#include "across.h"

#include <math.h>

#include "effects/quasi_nonlinear.h"

/* Of the contacts' displacements as much must point one way, or there is no imposed direction. */
static const double TOGETHER = 0.9;

static double length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

void across_apply(const struct bank_view *bank, size_t contacts, const double *displacement, double *u)
{
    double sum[3] = {0}, all = 0;
    if (!bank->quasi_nonlinear || !bank->quasi_nonlinear->has_across)
        return;
    for (size_t c = 0; c < contacts; c++) {
        all += length(displacement + 3 * c);
        for (size_t a = 0; a < 3; a++)
            sum[a] += displacement[3 * c + a];
    }
    double one_way = length(sum);
    if (!(all > 0) || one_way < TOGETHER * all)
        return;
    for (size_t v = 0; v < bank->vertex_count; v++) {
        double *at = u + 3 * v, along = 0, across[3];
        for (int a = 0; a < 3; a++)
            along += at[a] * sum[a] / one_way;
        for (int a = 0; a < 3; a++)
            across[a] = at[a] - along * sum[a] / one_way;
        double x = length(across);
        float slope;
        double more = x > 0 ? (double)quasi_nonlinear_value(&bank->quasi_nonlinear->P, (float)x, &slope) / x : 1;
        for (int a = 0; a < 3; a++)
            at[a] += (more - 1) * across[a];
    }
}
