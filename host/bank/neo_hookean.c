#include "neo_hookean.h"

#include <math.h>
#include <string.h>

enum { POINTS_MAX = 4 };

struct point {
    double weight, J, F[3][3];
    double growth, squares; /* J - 1 and F:F - 3, without the rounding of the ones */
    double gradient[NEO_HOOKEAN_NODES][3], spatial[NEO_HOOKEAN_NODES][3]; /* g_j and F^-t g_j */
};

static void gradients_at(const struct element *element, enum element_order order, size_t points, size_t q,
                         double (*gradient)[3])
{
    const double near = 0.58541019662496852, far = 0.13819660112501050; /* (5 + 3 sqrt 5)/20, (5 - sqrt 5)/20 */
    double L[4];
    for (size_t k = 0; k < 4; k++)
        L[k] = points == 1 ? 0.25 : k == q ? near : far;
    element_gradients(element, order, L, gradient);
}

/* F^-t det F: the cofactors. */
static void cofactors(double F[3][3], double c[3][3])
{
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            int p = (a + 1) % 3, q = (a + 2) % 3, r = (b + 1) % 3, s = (b + 2) % 3;
            c[a][b] = F[p][r] * F[q][s] - F[p][s] * F[q][r];
        }
}

static void displacement_gradient(double (*gradient)[3], size_t nodes, const double *u, double H[3][3])
{
    memset(H, 0, 9 * sizeof(double));
    for (int a = 0; a < 3; a++)
        for (size_t j = 0; j < nodes; j++)
            for (int b = 0; b < 3; b++)
                H[a][b] += u[3 * j + (size_t)a] * gradient[j][b];
}

/* False when the element is inverted there. */
static bool deform(struct point *point, size_t nodes, const double *u)
{
    double c[3][3], A[3][3];
    displacement_gradient(point->gradient, nodes, u, A);
    double trace = A[0][0] + A[1][1] + A[2][2];
    cofactors(A, c);
    point->growth = trace + c[0][0] + c[1][1] + c[2][2] + A[0][0] * c[0][0] + A[0][1] * c[0][1] + A[0][2] * c[0][2];
    point->J = 1 + point->growth;
    point->squares = 2 * trace;
    for (int k = 0; k < 9; k++)
        point->squares += A[k / 3][k % 3] * A[k / 3][k % 3];
    for (int k = 0; k < 9; k++)
        point->F[k / 3][k % 3] = A[k / 3][k % 3] + (k % 4 == 0);
    cofactors(point->F, c);
    if (!(point->J > 0))
        return false;
    for (size_t j = 0; j < nodes; j++)
        for (int a = 0; a < 3; a++)
            point->spatial[j][a] =
                (c[a][0] * point->gradient[j][0] + c[a][1] * point->gradient[j][1] + c[a][2] * point->gradient[j][2]) /
                point->J;
    return true;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void add_force(const struct point *point, size_t nodes, double mu, double volume, double *force)
{
    for (size_t j = 0; j < nodes; j++)
        for (int a = 0; a < 3; a++)
            force[3 * j + (size_t)a] += mu * (dot(point->F[a], point->gradient[j]) - point->spatial[j][a]) +
                                        volume * point->J * point->spatial[j][a];
}

static void add_tangent(const struct point *point, size_t nodes, double mu, double volume, double *tangent)
{
    for (size_t j = 0; j < nodes; j++)
        for (size_t k = 0; k < nodes; k++) {
            double *block = tangent + 9 * (nodes * j + k), straight = mu * dot(point->gradient[j], point->gradient[k]);
            const double *h = point->spatial[j], *g = point->spatial[k];
            for (int a = 0; a < 3; a++) {
                for (int b = 0; b < 3; b++)
                    block[3 * a + b] += mu * g[a] * h[b] + volume * point->J * (h[a] * g[b] - g[a] * h[b]);
                block[4 * a] += straight;
            }
        }
}

double neo_hookean_element(const struct element *element, struct lame material, enum element_order order,
                           const double *u, double *force, double *tangent, double *least_volume)
{
    size_t nodes = element_nodes(order), points = order == ELEMENT_QUADRATIC ? 4 : 1;
    double V = element->volume_m3, growth = 0, energy = 0, mean_gradient[NEO_HOOKEAN_NODES][3] = {{0}};
    struct point point[POINTS_MAX];
    for (size_t q = 0; q < points; q++) {
        gradients_at(element, order, points, q, point[q].gradient);
        point[q].weight = V / (double)points;
        if (!deform(&point[q], nodes, u))
            return INFINITY;
        growth += point[q].growth / (double)points;
        for (size_t j = 0; j < nodes; j++)
            for (int a = 0; a < 3; a++)
                mean_gradient[j][a] += point[q].J * point[q].spatial[j][a] / (double)points;
        if (least_volume)
            *least_volume = q == 0 ? point[q].J : fmin(*least_volume, point[q].J);
    }
    double mean = 1 + growth, log_mean = log1p(growth), pressure = material.lambda_Pa * log_mean / mean; /* of d/dJm */
    double stiff = V * material.lambda_Pa * (1 - log_mean) / (mean * mean);
    if (force)
        memset(force, 0, 3 * nodes * sizeof *force);
    if (tangent)
        memset(tangent, 0, 9 * nodes * nodes * sizeof *tangent);
    for (size_t q = 0; q < points; q++) {
        energy += point[q].weight * material.mu_Pa * (point[q].squares / 2 - log1p(point[q].growth));
        if (force)
            add_force(&point[q], nodes, point[q].weight * material.mu_Pa, point[q].weight * pressure, force);
        if (tangent)
            add_tangent(&point[q], nodes, point[q].weight * material.mu_Pa, point[q].weight * pressure, tangent);
    }
    for (size_t j = 0; tangent && j < nodes; j++)
        for (size_t k = 0; k < nodes; k++)
            for (int c = 0; c < 9; c++)
                tangent[9 * (nodes * j + k) + (size_t)c] += stiff * mean_gradient[j][c / 3] * mean_gradient[k][c % 3];
    return energy + V * material.lambda_Pa / 2 * log_mean * log_mean;
}

/* tr A B */
static double trace(double A[3][3], double B[3][3])
{
    double sum = 0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            sum += A[a][b] * B[b][a];
    return sum;
}

static void product(double A[3][3], double B[3][3], double AB[3][3])
{
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            AB[a][b] = A[a][0] * B[0][b] + A[a][1] * B[1][b] + A[a][2] * B[2][b];
}

/* += share tr (x X + y Y + z Z)^3, in the ten monomials. */
static void add_cubes(double H[3][3][3], double share, double cubes[NEO_HOOKEAN_CUBIC])
{
    double XX[3][3], YY[3][3], ZZ[3][3], XY[3][3], YX[3][3];
    product(H[0], H[0], XX);
    product(H[1], H[1], YY);
    product(H[2], H[2], ZZ);
    product(H[0], H[1], XY);
    product(H[1], H[0], YX);
    const double sum[NEO_HOOKEAN_CUBIC] = {trace(XX, H[0]),     trace(YY, H[1]),
                                           trace(ZZ, H[2]),     3 * trace(XX, H[1]),
                                           3 * trace(XX, H[2]), 3 * trace(YY, H[0]),
                                           3 * trace(YY, H[2]), 3 * trace(ZZ, H[0]),
                                           3 * trace(ZZ, H[1]), 3 * (trace(XY, H[2]) + trace(YX, H[2]))};
    for (int k = 0; k < NEO_HOOKEAN_CUBIC; k++)
        cubes[k] += share * sum[k];
}

/* (x gx + y gy + z gz) (q_xx x^2 + 2 q_xy x y + ...), in the ten monomials. */
static void multiply(const double g[3], double q[3][3], double out[NEO_HOOKEAN_CUBIC])
{
    const double product[NEO_HOOKEAN_CUBIC] = {g[0] * q[0][0],
                                               g[1] * q[1][1],
                                               g[2] * q[2][2],
                                               g[1] * q[0][0] + 2 * g[0] * q[0][1],
                                               g[2] * q[0][0] + 2 * g[0] * q[0][2],
                                               g[0] * q[1][1] + 2 * g[1] * q[0][1],
                                               g[2] * q[1][1] + 2 * g[1] * q[1][2],
                                               g[0] * q[2][2] + 2 * g[2] * q[0][2],
                                               g[1] * q[2][2] + 2 * g[2] * q[1][2],
                                               2 * (g[0] * q[1][2] + g[1] * q[0][2] + g[2] * q[0][1])};
    memcpy(out, product, sizeof product);
}

void neo_hookean_cubic(const struct element *element, struct lame material, enum element_order order, const double *u,
                       double cubic[NEO_HOOKEAN_CUBIC])
{
    size_t nodes = element_nodes(order), points = order == ELEMENT_QUADRATIC ? 4 : 1;
    double cubes[NEO_HOOKEAN_CUBIC] = {0}, volume[NEO_HOOKEAN_CUBIC], g[3] = {0}, q[3][3] = {{0}};
    for (size_t p = 0; p < points; p++) {
        double gradient[NEO_HOOKEAN_NODES][3], H[3][3][3], g_here[3];
        gradients_at(element, order, points, p, gradient);
        for (int k = 0; k < 3; k++) {
            displacement_gradient(gradient, nodes, u + 3 * nodes * (size_t)k, H[k]);
            g_here[k] = H[k][0][0] + H[k][1][1] + H[k][2][2];
            g[k] += g_here[k] / (double)points;
        }
        for (int k = 0; k < 3; k++)
            for (int l = 0; l <= k; l++)
                q[k][l] += (g_here[k] * g_here[l] - trace(H[k], H[l])) / 2 / (double)points;
        add_cubes(H, 1 / (double)points, cubes);
    }
    for (int k = 0; k < 3; k++) /* h - g^2 / 2 */
        for (int l = 0; l <= k; l++)
            q[l][k] = q[k][l] -= g[k] * g[l] / 2;
    multiply(g, q, volume);
    for (int k = 0; k < NEO_HOOKEAN_CUBIC; k++)
        cubic[k] += element->volume_m3 * (-material.mu_Pa / 3 * cubes[k] + material.lambda_Pa * volume[k]);
}
