#include "viscoelastic_report.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "effects/image.h"
#include "fit_drawing.h"
#include "prony_fit.h"

enum { CURVE = 120 }; /* marks of a fitted curve */

static void print(FILE *out, const char *path, const struct prony_fit *fit)
{
    fprintf(out, "%s: %zu rows fitted by %zu branches%s, equilibrium %s = %.4g %s\n", path, fit->points,
            fit->series.count, fit->series.viscosity_s > 0 ? " and a dashpot" : "", fit->what, fit->equilibrium,
            fit->unit);
    for (size_t b = 0; b < fit->series.count; b++)
        fprintf(out, "  share %.4g of the equilibrium, time %.4g s\n", fit->series.share[b], fit->series.time_s[b]);
    if (fit->series.viscosity_s > 0)
        fprintf(out, "  viscosity %.4g s of the equilibrium\n", fit->series.viscosity_s);
    fprintf(out, "  residuals: %.2g %% root mean square, %.2g %% at most\n", 100 * fit->residual_rms,
            100 * fit->residual_max);
}

static int draw(const struct prony_fit *fit, const char *path, struct failure *why)
{
    size_t parts = fit->oscillating ? 2 : 1, count = 0;
    struct plot_mark *marks = malloc(parts * (fit->points + CURVE) * sizeof *marks);
    if (!marks)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the drawing");
    double first = fit->x[0], last = fit->x[fit->points - 1];
    for (int part = 0; part < (int)parts; part++) {
        for (size_t i = 0; i < fit->points; i++)
            marks[count++] = fit_mark(fit->x[i], fit->measured[part][i], 1 + 2 * part, "measured");
        for (int k = 0; k < CURVE; k++) {
            double x = first * pow(last / first, k / (CURVE - 1.0));
            marks[count++] = fit_mark(x, prony_fit_value(fit, part, x), 2 + 2 * part, "fitted");
        }
    }
    char what[2 * CSV_NAME + 20];
    snprintf(what, sizeof what, "%s in %s", fit->oscillating ? "moduli" : fit->what, fit->unit);
    struct plot plot = {.title = "measured and fitted relaxation",
                        .x = {.label = fit->oscillating ? "frequency in rad/s" : "time in s"},
                        .y = {.label = what},
                        .count = count,
                        .mark = marks,
                        .series = {[1] = fit->oscillating ? "storage, measured" : "measured",
                                   [2] = fit->oscillating ? "storage, fitted" : "fitted",
                                   [3] = fit->oscillating ? "loss, measured" : NULL,
                                   [4] = fit->oscillating ? "loss, fitted" : NULL},
                        .curve = {[2] = true, [4] = true}};
    int status = fit_draw(&plot, path, why);
    free(marks);
    return status;
}

int viscoelastic_report(const struct scene *scene, const char *bank_path, FILE *out, struct failure *why)
{
    const char *path = scene->effects.viscoelastic.fit_path;
    char drawing[1100];
    struct prony_fit fit;
    if (!(scene->effects.named & EFFECT_VISCOELASTIC) || !*path)
        return STATUS_OK;
    snprintf(drawing, sizeof drawing, "%.1060s.viscoelastic.svg", bank_path);
    int status = prony_fit_file(path, &fit, why);
    if (status == STATUS_OK)
        status = draw(&fit, drawing, why);
    if (status == STATUS_OK && out) {
        print(out, path, &fit);
        fprintf(out, "  drawn in %s\n", drawing);
    }
    prony_fit_free(&fit);
    return status;
}
