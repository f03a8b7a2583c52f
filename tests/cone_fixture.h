/* Contact problems with friction for tests, and their solution in double precision by a method that shares nothing with the
 * controller's: ADMM (Boyd et al. 2011) on the convex problem over the cones, inside the fixed point on the sliding speed that
 * makes it Coulomb's (Cadoux 2009):
 *
 *   f = argmin 1/2 f.A f - f.(d - mu |r_t| n)  over |f_t| <= mu f_n,   r = A f - d */
#ifndef TROCAR_CONE_FIXTURE_H
#define TROCAR_CONE_FIXTURE_H

#include <math.h>
#include <string.h>

#include "bank_fixture.h"
#include "effects/cone.h"
#include "random.h"

enum { CONE_UNKNOWNS = 3 * CONTACT_MAX };

struct cone_problem {
    unsigned m;
    double mu;
    double A[CONE_UNKNOWNS][CONE_UNKNOWNS], d[CONE_UNKNOWNS], n[CONTACT_MAX][3];
};

/* m points of a tool of the given size on a body of 4 kPa behind a coupling of 1000 N/m; some coincide. The tool has come
 * `depth_m` deep and moved across by up to the same. */
static inline void cone_problem_random(struct cone_problem *p, unsigned m, double mu, double size_m, double depth_m)
{
    struct bank_fixture_options o = bank_fixture_default;
    double x[CONTACT_MAX][3], move[3], epsilon = 0;
    *p = (struct cone_problem){.m = m, .mu = mu};
    o.radius_m = 1;
    o.shear = 0.1;
    o.grain_m = 0.004;
    for (int a = 0; a < 3; a++)
        move[a] = a < 2 ? random_range(-depth_m, depth_m) : -depth_m;
    for (unsigned c = 0; c < m; c++) {
        double length = 0;
        for (int a = 0; a < 3; a++) {
            x[c][a] = (a < 2 ? 1 : 0.3) * random_range(-size_m, size_m);
            p->n[c][a] = a < 2 ? random_range(-0.5, 0.5) : 1;
        }
        if (c && random_below(4) == 0) {
            memcpy(x[c], x[c - 1], sizeof x[c]);
            memcpy(p->n[c], p->n[c - 1], sizeof p->n[c]);
        }
        for (int a = 0; a < 3; a++)
            length += p->n[c][a] * p->n[c][a];
        for (int a = 0; a < 3; a++)
            p->n[c][a] = (double)(float)(p->n[c][a] / sqrt(length));
    }
    for (unsigned c = 0; c < m; c++)
        for (unsigned e = 0; e < m; e++) {
            double g[3][3];
            fixture_kernel(&o, x[c], x[e], g);
            if (c == 0 && e == 0)
                epsilon = 1e-3 * (g[0][0] + g[1][1] + g[2][2]) / 3;
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++)
                    p->A[3 * c + a][3 * e + b] = g[a][b] + (a == b) * (1e-3 + (c == e) * epsilon);
        }
    for (unsigned c = 0; c < m; c++)
        for (int a = 0; a < 3; a++) /* points of a rigid tool, whose surface bends away by a quarter of its size */
            p->d[3 * c + a] = -move[a] + (a == 2 ? -0.25 * (x[c][0] * x[c][0] + x[c][1] * x[c][1]) / size_m : 0);
}

/* The same as the controller has it, rounded to single precision; forces 0. The problem takes over the rounded numbers. */
static inline void cone_problem_round(struct cone_problem *p, struct cone_system *s)
{
    memset(s, 0, sizeof *s);
    s->count = p->m;
    for (unsigned c = 0; c < p->m; c++) {
        float normal[3] = {(float)p->n[c][0], (float)p->n[c][1], (float)p->n[c][2]};
        cone_frame(&s->contact[c], normal);
        s->contact[c].mu = (float)p->mu;
        for (unsigned e = 0; e <= c; e++)
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) {
                    float *entry = &s->block[c * (c + 1) / 2 + e][3 * a + b];
                    *entry = (float)p->A[3 * c + a][3 * e + b];
                    p->A[3 * c + a][3 * e + b] = p->A[3 * e + b][3 * c + a] = (double)*entry;
                }
        for (int a = 0; a < 3; a++) {
            s->contact[c].wanted_m[a] = (float)p->d[3 * c + a];
            p->d[3 * c + a] = (double)s->contact[c].wanted_m[a];
        }
    }
}

/* Onto the cone |f_t| <= mu f_n. */
static inline void cone_project(const double n[3], double mu, double f[3])
{
    double fn = 0, t[3], ft = 0;
    for (int a = 0; a < 3; a++)
        fn += n[a] * f[a];
    for (int a = 0; a < 3; a++) {
        t[a] = f[a] - fn * n[a];
        ft += t[a] * t[a];
    }
    ft = sqrt(ft);
    if (ft <= mu * fn)
        return;
    double along = mu * ft + fn > 0 ? (mu * ft + fn) / (1 + mu * mu) : 0;
    for (int a = 0; a < 3; a++)
        f[a] = along * (n[a] + (ft > 0 ? mu * t[a] / ft : 0));
}

/* L L^t of A + rho I, in place. */
static inline void cone_factor(unsigned n, double L[CONE_UNKNOWNS][CONE_UNKNOWNS])
{
    for (unsigned j = 0; j < n; j++)
        for (unsigned i = j; i < n; i++) {
            double sum = L[i][j];
            for (unsigned k = 0; k < j; k++)
                sum -= L[i][k] * L[j][k];
            L[i][j] = i == j ? sqrt(sum) : sum / L[j][j];
        }
}

static inline void cone_residual(const struct cone_problem *p, const double *f, double *r)
{
    for (unsigned i = 0; i < 3 * p->m; i++) {
        r[i] = -p->d[i];
        for (unsigned j = 0; j < 3 * p->m; j++)
            r[i] += p->A[i][j] * f[j];
    }
}

/* By how much f fails Coulomb's law, m: |f - P(f - rho (r + mu |r_t| n))| / rho, largest over the contacts. */
static inline double cone_failure(const struct cone_problem *p, const double *f)
{
    double r[CONE_UNKNOWNS], worst = 0, rho = 1 / p->A[0][0];
    cone_residual(p, f, r);
    for (unsigned c = 0; c < p->m; c++) {
        double rn = 0, rt = 0, g[3], gap = 0;
        for (int a = 0; a < 3; a++)
            rn += p->n[c][a] * r[3 * c + a];
        for (int a = 0; a < 3; a++)
            rt += pow(r[3 * c + a] - rn * p->n[c][a], 2);
        for (int a = 0; a < 3; a++)
            g[a] = f[3 * c + a] - rho * (r[3 * c + a] + p->mu * sqrt(rt) * p->n[c][a]);
        cone_project(p->n[c], p->mu, g);
        for (int a = 0; a < 3; a++)
            gap += pow((f[3 * c + a] - g[a]) / rho, 2);
        worst = fmax(worst, sqrt(gap));
    }
    return worst;
}

/* The forces; returns cone_failure of them. */
static inline double cone_reference(const struct cone_problem *p, double *f)
{
    unsigned n = 3 * p->m;
    double L[CONE_UNKNOWNS][CONE_UNKNOWNS], z[CONE_UNKNOWNS] = {0}, y[CONE_UNKNOWNS] = {0}, d[CONE_UNKNOWNS];
    double trace = 0;
    for (unsigned i = 0; i < n; i++)
        trace += p->A[i][i] / n;
    double rho = 0.05 * trace, speed[CONTACT_MAX] = {0};
    memcpy(L, p->A, sizeof L);
    for (unsigned i = 0; i < n; i++)
        L[i][i] += rho;
    cone_factor(n, L);
    for (int outer = 0; outer < 200; outer++) {
        double r[CONE_UNKNOWNS], change = 0;
        for (unsigned i = 0; i < n; i++)
            d[i] = p->d[i] - p->mu * speed[i / 3] * p->n[i / 3][i % 3];
        for (int inner = 0; inner < 3000; inner++) {
            double x[CONE_UNKNOWNS], moved = 0, size = 0;
            for (unsigned i = 0; i < n; i++) {
                x[i] = d[i] + rho * (z[i] - y[i]);
                for (unsigned k = 0; k < i; k++)
                    x[i] -= L[i][k] * x[k];
                x[i] /= L[i][i];
            }
            for (unsigned i = n; i-- > 0;) {
                for (unsigned k = i + 1; k < n; k++)
                    x[i] -= L[k][i] * x[k];
                x[i] /= L[i][i];
            }
            for (unsigned c = 0; c < p->m; c++) {
                double g[3];
                for (int a = 0; a < 3; a++)
                    g[a] = x[3 * c + a] + y[3 * c + a];
                cone_project(p->n[c], p->mu, g);
                for (int a = 0; a < 3; a++) {
                    moved = fmax(moved, fmax(fabs(g[a] - z[3 * c + a]), fabs(g[a] - x[3 * c + a])));
                    z[3 * c + a] = g[a];
                    y[3 * c + a] += x[3 * c + a] - g[a];
                    size = fmax(size, fabs(g[a]));
                }
            }
            if (moved <= 1e-12 * size)
                break;
        }
        cone_residual(p, z, r);
        for (unsigned c = 0; c < p->m; c++) {
            double rn = 0, rt = 0;
            for (int a = 0; a < 3; a++)
                rn += p->n[c][a] * r[3 * c + a];
            for (int a = 0; a < 3; a++)
                rt += pow(r[3 * c + a] - rn * p->n[c][a], 2);
            change = fmax(change, fabs(sqrt(rt) - speed[c]));
            speed[c] = sqrt(rt);
        }
        if (change < 1e-13)
            break;
    }
    memcpy(f, z, n * sizeof *f);
    return cone_failure(p, f);
}

#endif
