/* A relaxation function common to all moduli of a body, relative to its equilibrium modulus (the E of the scene, what a press
 * held for long is answered with):
 *
 *   g(t) = 1 + sum_b share_b exp(-t / time_b) + viscosity_s delta(t)
 *
 * so that a stress is sigma(t) = int g(t - s) d(C eps(s)). Storage and loss modulus, relative to the same:
 *   G'(w) = 1 + sum_b share_b w^2 time_b^2 / (1 + w^2 time_b^2)
 *   G''(w) = sum_b share_b w time_b / (1 + w^2 time_b^2) + w viscosity_s
 * Sources: shared theory of the project, section 3 [C97 1.2.3]; Ferry, Viscoelastic Properties of Polymers, ch. 3. */
#ifndef TROCAR_PRONY_H
#define TROCAR_PRONY_H

#include <stddef.h>

enum { PRONY_MAX = 8 };

struct prony {
    size_t count;             /* of branches, to PRONY_MAX */
    double share[PRONY_MAX];  /* > 0 */
    double time_s[PRONY_MAX]; /* > 0, rising */
    double viscosity_s;       /* >= 0 */
};

double prony_storage(const struct prony *series, double omega_rad_s);
double prony_loss(const struct prony *series, double omega_rad_s);
/* g(t) at t > 0. */
double prony_relaxation(const struct prony *series, double t_s);

/* The named models as series; k in Pa, C in Pa s, all above 0.
 *   Kelvin-Voigt, sigma = k eps + C eps':                         viscosity C/k
 *   Boltzmann, G(t) = k1 + k2 exp(-k2 t/C):                       share k2/k1, time C/k2
 *   Maxwell-Kelvin-Voigt, G(t) = k1 k2/(k1+k2) + k1^2/(k1+k2) exp(-(k1+k2) t/C):  share k1/k2, time C/(k1+k2) */
struct prony prony_kelvin_voigt(double k_Pa, double C_Pa_s);
struct prony prony_boltzmann(double k1_Pa, double k2_Pa, double C_Pa_s);
struct prony prony_maxwell_kelvin_voigt(double k1_Pa, double k2_Pa, double C_Pa_s);

/* Branches in rising order of their times. */
void prony_sort(struct prony *series);

#endif
