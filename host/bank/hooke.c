#include "hooke.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

const unsigned char hooke_place[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};

struct hooke hooke_isotropic(double E_Pa, double nu)
{
    struct lame lame = lame_from_young(E_Pa, nu);
    return (struct hooke){.isotropic = true, .lame = lame, .volume_Pa = lame.lambda_Pa};
}

bool hooke_axes(const double along[3], const double *across, double axis[3][3])
{
    double length = sqrt(along[0] * along[0] + along[1] * along[1] + along[2] * along[2]);
    if (!(length > 0 && isfinite(length)))
        return false;
    int smallest = 0;
    for (int a = 0; a < 3; a++) {
        axis[0][a] = along[a] / length;
        if (fabs(axis[0][a]) < fabs(axis[0][smallest]))
            smallest = a;
    }
    double second[3] = {smallest == 0, smallest == 1, smallest == 2};
    if (across)
        memcpy(second, across, sizeof second);
    double size = sqrt(second[0] * second[0] + second[1] * second[1] + second[2] * second[2]);
    double along_part = axis[0][0] * second[0] + axis[0][1] * second[1] + axis[0][2] * second[2];
    for (int a = 0; a < 3; a++)
        second[a] -= along_part * axis[0][a];
    length = sqrt(second[0] * second[0] + second[1] * second[1] + second[2] * second[2]);
    if (!(length > 1e-6 * size)) /* nearer to parallel, its direction is rounding error */
        return false;
    for (int a = 0; a < 3; a++)
        axis[1][a] = second[a] / length;
    for (int a = 0; a < 3; a++)
        axis[2][a] = axis[0][(a + 1) % 3] * axis[1][(a + 2) % 3] - axis[0][(a + 2) % 3] * axis[1][(a + 1) % 3];
    return true;
}

/* Ends of the pairs 12, 13, 23. */
static const int first[3] = {0, 0, 1}, second[3] = {1, 2, 2};

/* How a constant is called in the scene. */
static const char *const transverse_E[3] = {"E_L", "E_T", "E_T"};
static const char *const transverse_pair[3] = {"LT", "LT", "TT"};
static const char *const orthotropic_E[3] = {"E_1", "E_2", "E_3"};
static const char *const orthotropic_pair[3] = {"12", "13", "23"};

/* D of hooke.h; below this part of 1 the inverse of the compliance has no digit of shear left in double precision. */
static const double DETERMINANT_MIN = 1e-12;

static double determinant(const struct scene_orthotropic *o)
{
    const double *E = o->E_Pa, *nu = o->nu;
    return 1 - nu[0] * nu[0] * E[1] / E[0] - nu[1] * nu[1] * E[2] / E[0] - nu[2] * nu[2] * E[2] / E[1] -
           2 * nu[0] * nu[1] * nu[2] * E[2] / E[0];
}

static int check_isotropic(const struct scene *scene, const struct scene_material *m, struct failure *why)
{
    if (!(m->E_Pa > 0 && isfinite(m->E_Pa)))
        return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, m->line, "give E > 0", "material '%s' has E = %g Pa",
                          m->label, m->E_Pa);
    if (!(m->nu >= 0 && m->nu < 0.5))
        return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, m->line,
                          "give 0 <= nu < 0.5 (soft tissue: 0.45 to 0.49)", "material '%s' has nu = %g", m->label,
                          m->nu);
    return STATUS_OK;
}

static int check_anisotropic(const struct scene *scene, const struct scene_material *m, struct failure *why)
{
    const struct scene_orthotropic *o = &m->orthotropic;
    bool transverse = m->symmetry == SYMMETRY_TRANSVERSE;
    const char *const *E = transverse ? transverse_E : orthotropic_E;
    const char *const *pair = transverse ? transverse_pair : orthotropic_pair;
    for (int k = 0; k < 3; k++) {
        if (!(o->E_Pa[k] > 0 && isfinite(o->E_Pa[k])))
            return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, m->line, "give moduli above 0",
                              "material '%s' has %s = %g Pa", m->label, E[k], o->E_Pa[k]);
        if (!(o->G_Pa[k] > 0 && isfinite(o->G_Pa[k])))
            return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, m->line,
                              transverse ? "give G_LT above 0 and nu_TT above -1" : "give moduli above 0",
                              "material '%s' has G_%s = %g Pa", m->label, pair[k], o->G_Pa[k]);
    }
    for (int k = 0; k < 3; k++) {
        double limit = sqrt(o->E_Pa[first[k]] / o->E_Pa[second[k]]);
        if (!(fabs(o->nu[k]) < limit))
            return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, m->line, "lower it",
                              "material '%s' is not positive definite: nu_%s = %g must stay within sqrt(%s/%s) = %.6g",
                              m->label, pair[k], o->nu[k], E[first[k]], E[second[k]], limit);
    }
    double D = determinant(o);
    if (!(D > DETERMINANT_MIN))
        return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, m->line, "lower Poisson's ratios",
                          "material '%s' is not positive definite: %s = %.6g must be above 0", m->label,
                          transverse ? "1 - nu_TT - 2 nu_LT^2 E_T/E_L"
                                     : "1 - nu_12 nu_21 - nu_23 nu_32 - nu_31 nu_13 - 2 nu_21 nu_32 nu_13",
                          transverse ? D / (1 + o->nu[2]) : D);
    return STATUS_OK;
}

/* C' = (R x R) C (R x R)^t with R_ai = component a of axis i, as 9 x 9 matrices over pairs of indices. */
static void rotate(double (*C)[6], const double (*axis)[3])
{
    double T[9][9], half[9][9];
    for (int p = 0; p < 9; p++)
        for (int q = 0; q < 9; q++)
            T[p][q] = axis[q / 3][p / 3] * axis[q % 3][p % 3];
    for (int p = 0; p < 9; p++)
        for (int q = 0; q < 9; q++) {
            half[p][q] = 0;
            for (int r = 0; r < 9; r++)
                half[p][q] += T[p][r] * C[hooke_place[r / 3][r % 3]][hooke_place[q / 3][q % 3]];
        }
    for (int p = 0; p < 9; p++)
        for (int q = 0; q < 9; q++) {
            int v = hooke_place[p / 3][p % 3], w = hooke_place[q / 3][q % 3];
            if (p / 3 > p % 3 || q / 3 > q % 3 || v > w)
                continue;
            double sum = 0;
            for (int r = 0; r < 9; r++)
                sum += half[p][r] * T[q][r];
            C[v][w] = C[w][v] = sum;
        }
}

int hooke_of_material(const struct scene *scene, const struct scene_material *m, const double axis[3][3],
                      struct hooke *hooke, struct failure *why)
{
    int status = m->symmetry == SYMMETRY_ISOTROPIC ? check_isotropic(scene, m, why) : check_anisotropic(scene, m, why);
    if (status)
        return status;
    if (m->symmetry == SYMMETRY_ISOTROPIC) {
        *hooke = hooke_isotropic(m->E_Pa, m->nu);
        return STATUS_OK;
    }
    double own[3][3];
    if (!axis && !hooke_axes(m->along, m->symmetry == SYMMETRY_ORTHOTROPIC ? m->across : NULL, own))
        return failure_at(why, STATUS_MODEL_MATERIAL, scene->path, m->line, "give two directions that are square",
                          "the axes of material '%s' span no plane", m->label);
    const double *E = m->orthotropic.E_Pa, *nu = m->orthotropic.nu, *G = m->orthotropic.G_Pa;
    double n21 = nu[0] * E[1] / E[0], n31 = nu[1] * E[2] / E[0], n32 = nu[2] * E[2] / E[1];
    double D = determinant(&m->orthotropic);
    *hooke = (struct hooke){.isotropic = false};
    hooke->C[0][0] = E[0] * (1 - nu[2] * n32) / D;
    hooke->C[1][1] = E[1] * (1 - nu[1] * n31) / D;
    hooke->C[2][2] = E[2] * (1 - nu[0] * n21) / D;
    hooke->C[0][1] = hooke->C[1][0] = E[0] * (n21 + n31 * nu[2]) / D;
    hooke->C[0][2] = hooke->C[2][0] = E[0] * (n31 + n21 * n32) / D;
    hooke->C[1][2] = hooke->C[2][1] = E[1] * (n32 + nu[0] * n31) / D;
    hooke->C[3][3] = G[2];
    hooke->C[4][4] = G[1];
    hooke->C[5][5] = G[0];
    double squeeze = (1 - 2 * nu[0] - 2 * nu[1]) / E[0] + (1 - 2 * nu[2]) / E[1] + 1 / E[2]; /* 1/K */
    hooke->volume_Pa = fmax(0, 1 / squeeze - 2.0 / 3 * fmin(G[0], fmin(G[1], G[2])));
    rotate(hooke->C, axis ? axis : (const double(*)[3])own);
    return STATUS_OK;
}
