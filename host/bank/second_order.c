#include "second_order.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model_state.h"
#include "neo_hookean.h"

static const unsigned char power[SECOND_ORDER_TERMS][3] = {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}, {2, 1, 0}, {2, 0, 1},
                                                           {1, 2, 0}, {0, 2, 1}, {1, 0, 2}, {0, 1, 2}, {1, 1, 1}};

/* Coefficients from the values at these directions. */
enum { X, Y, Z, XpY, XmY, XpZ, XmZ, YpZ, YmZ, XYZ };
static const double probe[SECOND_ORDER_TERMS][3] = {{1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, -1, 0},
                                                    {1, 0, 1}, {1, 0, -1}, {0, 1, 1}, {0, 1, -1}, {1, 1, 1}};

static void coefficients(const double T[SECOND_ORDER_TERMS], double c[SECOND_ORDER_TERMS])
{
    c[0] = T[X];
    c[1] = T[Y];
    c[2] = T[Z];
    /* T(x + y) = xxx + yyy + xxy + xyy, T(x - y) = xxx - yyy - xxy + xyy */
    c[3] = (T[XpY] - T[XmY]) / 2 - T[Y];
    c[5] = (T[XpY] + T[XmY]) / 2 - T[X];
    c[4] = (T[XpZ] - T[XmZ]) / 2 - T[Z];
    c[7] = (T[XpZ] + T[XmZ]) / 2 - T[X];
    c[6] = (T[YpZ] - T[YmZ]) / 2 - T[Z];
    c[8] = (T[YpZ] + T[YmZ]) / 2 - T[Y];
    c[9] = T[XYZ];
    for (int k = 0; k < 9; k++)
        c[9] -= c[k];
}

int second_order_find(struct nonlinear *n, const struct nonlinear_rows *rows, double epsilon_m_N,
                      struct second_order *site, struct failure *why)
{
    size_t unknowns = nonlinear_unknowns(n);
    double *field = malloc((3 * unknowns + 1) * sizeof *field), *u = malloc((unknowns + 1) * sizeof *u);
    double T[SECOND_ORDER_TERMS];
    int status = STATUS_OK;
    if (!field || !u)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for a tool's fields");
    if (!status)
        status = nonlinear_linear(n, rows, epsilon_m_N, &site->A[0][0], field, why);
    for (int k = 0; k < SECOND_ORDER_TERMS && !status; k++) {
        for (size_t i = 0; i < unknowns; i++)
            u[i] = probe[k][0] * field[i] + probe[k][1] * field[unknowns + i] + probe[k][2] * field[2 * unknowns + i];
        T[k] = nonlinear_cubic(n, u);
    }
    if (!status)
        coefficients(T, site->cubic);
    free(field);
    free(u);
    return status;
}

void second_order_force(const struct second_order *site, const double d[3], double force[3])
{
    for (int a = 0; a < 3; a++) {
        force[a] = 0;
        for (int k = 0; k < SECOND_ORDER_TERMS; k++) {
            double term = site->cubic[k] * power[k][a];
            for (int b = 0; b < 3; b++)
                for (int times = power[k][b] - (a == b); times > 0; times--)
                    term *= d[b];
            force[a] += term;
        }
    }
}

double second_order_range(const struct second_order *site, const double direction[3])
{
    double g[3], linear = 0, second = 0; /* force along it at depth s: linear s + second s^2 */
    second_order_force(site, direction, g);
    for (int a = 0; a < 3; a++) {
        second += g[a] * direction[a];
        for (int b = 0; b < 3; b++)
            linear += direction[a] * site->A[a][b] * direction[b];
    }
    return second < 0 ? -linear / (2 * second) : INFINITY;
}
