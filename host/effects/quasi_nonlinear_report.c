#include "quasi_nonlinear_report.h"

#include <math.h>
#include <stdlib.h>

#include "csv.h"
#include "effects/image.h"
#include "fit_drawing.h"

enum { CURVE = 120 }; /* marks of a fitted curve */

static void print_curve(FILE *out, const char *name, const char *unit, const struct monotone *c)
{
    fprintf(out, "  %s: degree %d, monotone up to %.4g %s; residuals %.2g %% root mean square, %.2g %% at most\n", name,
            c->degree, c->range, unit, 100 * c->residual_rms, 100 * c->residual_max);
}

/* Force in N, bulge in mm, so that both are seen on one axis. */
static size_t add_marks(const struct scene_quasi_nonlinear *q, const struct cylinder_table *t, struct plot_mark *mark)
{
    size_t count = 0;
    for (size_t i = 0; i < t->rows; i++) {
        mark[count++] = fit_mark(1e3 * t->depth_m[i], t->force_N[i], 1, "force measured");
        if (t->across_m)
            mark[count++] = fit_mark(1e3 * t->depth_m[i], 1e3 * t->across_m[i], 4, "bulge measured");
    }
    for (int part = 0; part < 2; part++)
        for (int k = 1; k <= CURVE && (part == 0 || t->across_m); k++) {
            double depth = q->fit.depth_max_m * k / CURVE, linear = cylinder_linear(&q->sample, depth, part);
            double scale = part ? 1e3 : 1;
            mark[count++] = fit_mark(1e3 * depth, scale * monotone_value(part ? &q->fit.P : &q->fit.Q, linear),
                                     part ? 5 : 2, "fitted");
            mark[count++] = fit_mark(1e3 * depth, scale * linear, part ? 6 : 3, "linear");
        }
    return count;
}

static int draw(const struct scene_quasi_nonlinear *q, const char *path, struct failure *why)
{
    struct cylinder_table table;
    int status = cylinder_table_read(q->fit_path, &table, why);
    struct plot_mark *mark = NULL;
    if (!status && !(mark = malloc((2 * table.rows + 4 * CURVE) * sizeof *mark)))
        status = failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the drawing");
    if (!status) {
        bool across = table.across_m;
        struct plot plot = {.title = "compression of a cylinder, measured and fitted",
                            .x = {.label = "depth in mm"},
                            .y = {.label = across ? "force in N, bulge of the radius in mm" : "force in N"},
                            .mark = mark,
                            .series = {[1] = "force, measured",
                                       [2] = "force, Q fitted",
                                       [3] = "force, linear",
                                       [4] = across ? "bulge, measured" : NULL,
                                       [5] = across ? "bulge, P fitted" : NULL,
                                       [6] = across ? "bulge, linear" : NULL},
                            .curve = {[2] = true, [3] = true, [5] = true, [6] = true}};
        /* a curve's marks follow one another */
        plot.count = add_marks(q, &table, mark);
        status = fit_draw(&plot, path, why);
    }
    free(mark);
    cylinder_table_free(&table);
    return status;
}

int quasi_nonlinear_report(const struct scene *scene, const char *bank_path, FILE *out, struct failure *why)
{
    const struct scene_quasi_nonlinear *q = &scene->effects.quasi_nonlinear;
    char drawing[1100];
    if (!(scene->effects.named & EFFECT_QUASI_NONLINEAR) || !*q->fit_path)
        return STATUS_OK;
    snprintf(drawing, sizeof drawing, "%.1060s.quasi_nonlinear.svg", bank_path);
    int status = draw(q, drawing, why);
    if (status == STATUS_OK && out) {
        fprintf(
            out,
            "%s: a cylinder of %.4g mm and radius %.4g mm, compressed by %.4g mm; linear with E = %.4g Pa, nu = %.4g\n",
            q->fit_path, 1e3 * q->sample.height_m, 1e3 * q->sample.radius_m, 1e3 * q->fit.depth_max_m, q->sample.E_Pa,
            q->sample.nu);
        print_curve(out, "Q, force", "N", &q->fit.Q);
        if (q->fit.has_across)
            print_curve(out, "P, across", "m", &q->fit.P);
        fprintf(out, "  true on the line of the table only; drawn in %s\n", drawing);
    }
    return status;
}
