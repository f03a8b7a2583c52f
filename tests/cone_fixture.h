/* Contact problems with friction for tests, and their solution in double precision by the host's own method (fem_cone.h). */
#ifndef TROCAR_CONE_FIXTURE_H
#define TROCAR_CONE_FIXTURE_H

#include <math.h>
#include <string.h>

#include "bank_fixture.h"
#include "effects/cone.h"
#include "fem_cone.h"
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

/* The same as the controller has it, rounded to single precision; forces 0. Coupling and epsilon are in the blocks. The problem
 * takes over the rounded numbers. */
static inline void cone_problem_round(struct cone_problem *p, struct cone_system *s, float (*block)[9])
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
                    float *entry = &block[contact_pair(c, e)][3 * a + b];
                    *entry = (float)p->A[3 * c + a][3 * e + b];
                    p->A[3 * c + a][3 * e + b] = p->A[3 * e + b][3 * c + a] = (double)*entry;
                }
        for (int a = 0; a < 3; a++) {
            s->contact[c].wanted_m[a] = (float)p->d[3 * c + a];
            p->d[3 * c + a] = (double)s->contact[c].wanted_m[a];
        }
    }
}

/* The forces in double precision by another method; how far they fail Coulomb's law, m. */
static inline double cone_reference(const struct cone_problem *p, double *f)
{
    static double A[CONE_UNKNOWNS * CONE_UNKNOWNS];
    struct failure why;
    unsigned size = 3 * p->m;
    for (unsigned i = 0; i < size; i++)
        for (unsigned j = 0; j < size; j++)
            A[size * i + j] = p->A[i][j];
    double mu[CONTACT_MAX];
    for (unsigned c = 0; c < p->m; c++)
        mu[c] = p->mu;
    if (fem_cone(p->m, A, p->d, p->n[0], mu, f, &why) != STATUS_OK) {
        printf("# %s\n", why.cause);
        abort();
    }
    return fem_cone_failure(p->m, A, p->d, p->n[0], mu, f);
}

#endif
