#include "prony.h"

#include <math.h>

double prony_storage(const struct prony *series, double omega_rad_s)
{
    double sum = 1;
    for (size_t b = 0; b < series->count; b++) {
        double x = omega_rad_s * series->time_s[b];
        sum += series->share[b] * x * x / (1 + x * x);
    }
    return sum;
}

double prony_loss(const struct prony *series, double omega_rad_s)
{
    double sum = omega_rad_s * series->viscosity_s;
    for (size_t b = 0; b < series->count; b++) {
        double x = omega_rad_s * series->time_s[b];
        sum += series->share[b] * x / (1 + x * x);
    }
    return sum;
}

double prony_relaxation(const struct prony *series, double t_s)
{
    double sum = 1;
    for (size_t b = 0; b < series->count; b++)
        sum += series->share[b] * exp(-t_s / series->time_s[b]);
    return sum;
}

struct prony prony_kelvin_voigt(double k_Pa, double C_Pa_s)
{
    return (struct prony){.viscosity_s = C_Pa_s / k_Pa};
}

struct prony prony_boltzmann(double k1_Pa, double k2_Pa, double C_Pa_s)
{
    return (struct prony){.count = 1, .share = {k2_Pa / k1_Pa}, .time_s = {C_Pa_s / k2_Pa}};
}

struct prony prony_maxwell_kelvin_voigt(double k1_Pa, double k2_Pa, double C_Pa_s)
{
    return (struct prony){.count = 1, .share = {k1_Pa / k2_Pa}, .time_s = {C_Pa_s / (k1_Pa + k2_Pa)}};
}

void prony_sort(struct prony *series)
{
    for (size_t i = 1; i < series->count; i++)
        for (size_t k = i; k > 0 && series->time_s[k] < series->time_s[k - 1]; k--) {
            double share = series->share[k], time_s = series->time_s[k];
            series->share[k] = series->share[k - 1];
            series->time_s[k] = series->time_s[k - 1];
            series->share[k - 1] = share;
            series->time_s[k - 1] = time_s;
        }
}
