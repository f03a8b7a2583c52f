#include "fem_cone.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contact.h"

enum { UNKNOWNS = 3 * CONTACT_MAX, MAX_OUTER = 400, MAX_INNER = 5000 };

/* The nearest point of the cone. */
static void project(const double n[3], double mu, double f[3])
{
    if (mu < 0)
        return;
    double fn = n[0] * f[0] + n[1] * f[1] + n[2] * f[2], t[3], ft = 0;
    for (int a = 0; a < 3; a++) {
        t[a] = f[a] - fn * n[a];
        ft += t[a] * t[a];
    }
    ft = sqrt(ft);
    if (ft <= mu * fn)
        return;
    double along = fmax(0, (mu * ft + fn) / (1 + mu * mu));
    for (int a = 0; a < 3; a++)
        f[a] = along * (n[a] + (ft > 0 ? mu * t[a] / ft : 0));
}

/* What is left of each displacement, and how far each contact slides. */
static void residual(uint32_t m, const double *A, const double *d, const double *n, const double *f, double *r,
                     double *slides)
{
    for (uint32_t i = 0; i < 3 * m; i++) {
        r[i] = -d[i];
        for (uint32_t j = 0; j < 3 * m; j++)
            r[i] += A[3 * m * i + j] * f[j];
    }
    for (uint32_t c = 0; c < m; c++) {
        const double *rc = r + 3 * c, *nc = n + 3 * c;
        double rn = nc[0] * rc[0] + nc[1] * rc[1] + nc[2] * rc[2], sum = 0;
        for (int a = 0; a < 3; a++)
            sum += (rc[a] - rn * nc[a]) * (rc[a] - rn * nc[a]);
        slides[c] = sqrt(sum);
    }
}

double fem_cone_failure(uint32_t m, const double *A, const double *d, const double *n, const double *mu,
                        const double *f)
{
    double r[UNKNOWNS], slides[CONTACT_MAX], worst = 0, rho = 1 / A[0];
    residual(m, A, d, n, f, r, slides);
    for (uint32_t c = 0; c < m; c++) {
        double g[3], sum = 0;
        for (int a = 0; a < 3; a++)
            g[a] = f[3 * c + a] - rho * (r[3 * c + a] + fmax(0, mu[c]) * slides[c] * n[3 * c + a]);
        project(n + 3 * c, mu[c], g);
        for (int a = 0; a < 3; a++)
            sum += (f[3 * c + a] - g[a]) * (f[3 * c + a] - g[a]);
        worst = fmax(worst, sqrt(sum) / rho);
    }
    return worst;
}

/* The convex problem: z over the cones, y the scaled multipliers, both kept from one call to the next. */
static void admm(uint32_t m, const double *factor, double rho, const double *d, const double *n, const double *mu,
                 double *z, double *y)
{
    lapack_int size = (lapack_int)(3 * m);
    double x[UNKNOWNS], moved = 1, largest = 0;
    for (int k = 0; k < MAX_INNER && moved > 1e-12 * largest; k++) {
        moved = largest = 0;
        for (uint32_t i = 0; i < 3 * m; i++)
            x[i] = d[i] + rho * (z[i] - y[i]);
        LAPACKE_dpotrs(LAPACK_ROW_MAJOR, 'L', size, 1, factor, size, x, 1);
        for (uint32_t c = 0; c < m; c++) {
            double g[3];
            for (int a = 0; a < 3; a++)
                g[a] = x[3 * c + a] + y[3 * c + a];
            project(n + 3 * c, mu[c], g);
            for (int a = 0; a < 3; a++) {
                uint32_t i = 3 * c + (uint32_t)a;
                moved = fmax(moved, fmax(fabs(g[a] - z[i]), fabs(g[a] - x[i])));
                largest = fmax(largest, fabs(g[a]));
                y[i] += x[i] - g[a];
                z[i] = g[a];
            }
        }
    }
}

int fem_cone(uint32_t m, const double *A, const double *d, const double *n, const double *mu, double *f,
             struct failure *why)
{
    double factor[UNKNOWNS * UNKNOWNS], y[UNKNOWNS] = {0}, lower[UNKNOWNS], slides[CONTACT_MAX] = {0}, trace = 0;
    uint32_t size = 3 * m;
    memset(f, 0, size * sizeof *f);
    for (uint32_t i = 0; i < size; i++)
        trace += A[size * i + i] / size;
    double rho = 0.05 * trace, change = INFINITY, depth = 0;
    memcpy(factor, A, (size_t)size * size * sizeof *factor);
    for (uint32_t i = 0; i < size; i++) {
        factor[size * i + i] += rho;
        depth = fmax(depth, fabs(d[i]));
    }
    if (m && LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', (lapack_int)size, factor, (lapack_int)size) != 0)
        return failure_set(why, STATUS_MODEL_FACTOR, NULL, NULL, "the compliance between %u contacts is not definite",
                           m);
    for (int k = 0; m && k < MAX_OUTER && change > 1e-12 * depth; k++) {
        double r[UNKNOWNS], next[CONTACT_MAX];
        for (uint32_t i = 0; i < size; i++)
            lower[i] = d[i] - fmax(0, mu[i / 3]) * slides[i / 3] * n[i];
        admm(m, factor, rho, lower, n, mu, f, y);
        residual(m, A, d, n, f, r, next);
        change = 0;
        for (uint32_t c = 0; c < m; c++) {
            change = fmax(change, fabs(next[c] - slides[c]));
            slides[c] = next[c];
        }
    }
    double failed = m ? fem_cone_failure(m, A, d, n, mu, f) : 0;
    if (failed > 1e-6 * depth)
        return failure_set(why, STATUS_CHECK_FAILED, NULL, NULL,
                           "the reference forces of %u contacts with friction fail Coulomb's law by %.1e m", m, failed);
    return STATUS_OK;
}
