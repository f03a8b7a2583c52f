#include "report.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "progress.h"

const char *const report_note[REPORT_NOTES] = {
    "Bank errors: " COMPRESSION_ERROR_REFERENCE
    ", against what the bank stores, over random contact sets: one contact, "
    "patches of 3 to 10, two tools, and the displacement of the whole surface. p95 is exceeded by 5 % of the sets.",
    "Tick errors: the force of every tick of the recording against " TRADEOFF_TICK_REFERENCE
    "; relative to the largest force.",
    "Solver errors: what the bound of steps or sweeps leaves: the force of every tick "
    "against " TRADEOFF_SOLVER_REFERENCE "; relative to the largest force.",
    "Mesh errors: the stiffness against " TRADEOFF_MESH_REFERENCE
    "; the mean under the scene's and under one of 20 mm radius; - for the reference itself.",
    "Errors of different references are not added. None contains the error of linear elasticity.",
    "Instructions: counted by callgrind on the native controller, per tick in contact; of this machine's processor, "
    "not of "
    "a controller's.",
    "M7 bound: no tick of a Cortex-M7 takes more instructions; all points touch and the solver takes all its steps.",
    "Nanoseconds: of this machine, median over runs, with whatever else it was doing.",
    "At a lower rate the force is held between ticks; the controller of this version ticks at 1000 Hz, so the lower "
    "rates "
    "are computed from its forces, and the load from its instructions.",
    "Seconds: of reading, assembling, computing the exact compliance and storing it, on this machine.",
    "RAM: the controller's state and its memory for decoded rows, without the stack.",
};

#define COLUMN(name, expression)                                                                                       \
    static double name(const struct tradeoff_point *p)                                                                 \
    {                                                                                                                  \
        return expression;                                                                                             \
    }
COLUMN(bytes, p->bytes)
COLUMN(bytes_per_node, p->bytes_per_node)
COLUMN(one, p->bank[COMPRESSION_ERROR_ONE].p95)
COLUMN(patch, p->bank[COMPRESSION_ERROR_PATCH].p95)
COLUMN(patch_max, p->bank[COMPRESSION_ERROR_PATCH].max)
COLUMN(two, p->bank[COMPRESSION_ERROR_TWO].p95)
COLUMN(field, p->bank[COMPRESSION_ERROR_FIELD].p95)
COLUMN(tick_p95, p->tick_p95)
COLUMN(tick_max, p->tick_max)
COLUMN(solver_p95, p->solver_p95)
COLUMN(solver_max, p->solver_max)
COLUMN(mesh_own, p->mesh[0].mean)
COLUMN(mesh_wide, p->mesh[1].mean)
COLUMN(worst_bound, p->worst_bound)
COLUMN(instructions_mean, p->instructions_mean)
COLUMN(instructions_max, p->instructions_max)
COLUMN(load_max, p->load_max)
COLUMN(ns_mean, p->ns_mean)
COLUMN(ns_max, p->ns_max)
COLUMN(state_bytes, p->state_bytes)
COLUMN(build_s, p->build_s)

const struct report_column report_column[] = {
    {"bank", "", PLOT_BYTES, bytes},
    {"per node", "bytes", PLOT_NUMBER, bytes_per_node},
    {"one", "p95", PLOT_PERCENT, one},
    {"patch", "p95", PLOT_PERCENT, patch},
    {"patch", "max", PLOT_PERCENT, patch_max},
    {"two tools", "p95", PLOT_PERCENT, two},
    {"field", "p95", PLOT_PERCENT, field},
    {"tick", "p95", PLOT_PERCENT, tick_p95},
    {"tick", "max", PLOT_PERCENT, tick_max},
    {"solver", "p95", PLOT_PERCENT, solver_p95},
    {"solver", "max", PLOT_PERCENT, solver_max},
    {"mesh", "tool", PLOT_PERCENT, mesh_own},
    {"mesh", "wide tool", PLOT_PERCENT, mesh_wide},
    {"instr.", "mean", PLOT_NUMBER, instructions_mean},
    {"instr.", "worst", PLOT_NUMBER, instructions_max},
    {"M7 bound", "instr.", PLOT_NUMBER, worst_bound},
    {"load/ms", "worst", PLOT_NUMBER, load_max},
    {"time", "ns, mean", PLOT_NUMBER, ns_mean},
    {"time", "ns, worst", PLOT_NUMBER, ns_max},
    {"RAM", "", PLOT_BYTES, state_bytes},
    {"build", "s", PLOT_NUMBER, build_s},
};
const size_t report_columns = sizeof report_column / sizeof report_column[0];

static void cell(const struct report_column *column, const struct tradeoff_point *p, char *text, size_t room)
{
    double value = column->value(p);
    if (isfinite(value))
        plot_value_text(column->shown, value, text, room);
    else
        snprintf(text, room, "-");
}

void report_table(FILE *out, const struct tradeoff *r)
{
    char text[60];
    size_t name = 7, width[32];
    for (size_t i = 0; i < r->points; i++)
        name = strlen(r->point[i].name) > name ? strlen(r->point[i].name) : name;
    fprintf(out, "%s (%s): %s measured on the gesture \"%s\" of %.0f ticks, %.0f in contact, in %.4g s\n\n", r->scene,
            r->mesh, r->quick ? "quickly" : "fully", r->gesture, r->ticks, r->contact_ticks, r->seconds);
    for (size_t c = 0; c < report_columns; c++) {
        width[c] = strlen(report_column[c].head);
        width[c] = strlen(report_column[c].unit) > width[c] ? strlen(report_column[c].unit) : width[c];
        for (size_t i = 0; i < r->points; i++) {
            cell(&report_column[c], &r->point[i], text, sizeof text);
            width[c] = strlen(text) > width[c] ? strlen(text) : width[c];
        }
    }
    for (int line = 0; line < 2; line++) {
        fprintf(out, "%-*s", (int)name, line ? "" : "setting");
        for (size_t c = 0; c < report_columns; c++)
            fprintf(out, "  %*s", (int)width[c], line ? report_column[c].unit : report_column[c].head);
        fputc('\n', out);
    }
    for (size_t i = 0; i < r->points; i++) {
        const struct tradeoff_point *p = &r->point[i];
        fprintf(out, "%-*s", (int)name, p->name);
        for (size_t c = 0; c < report_columns; c++) {
            cell(&report_column[c], p, text, sizeof text);
            fprintf(out, "  %*s", (int)width[c], text);
        }
        fprintf(out, "  %c%c\n", p->front_time ? 't' : ' ', p->front_bytes ? 'b' : ' ');
    }
    fputs("\nt, b: no other setting is at least as good in error and in load per millisecond (t), in patch error and "
          "in bytes "
          "(b).\n",
          out);
    if (r->left_out > 0)
        fprintf(out, "%.0f settings were left out, the first because %s\n", r->left_out, r->left_out_why);
    if (!r->instructions_known)
        fprintf(out, "Instructions were not counted: %s.\n", r->instructions_reason);
    fputc('\n', out);
    for (size_t k = 0; k < r->advices; k++)
        fprintf(out, "%s\n", r->advice[k].text);
    fputc('\n', out);
    for (int k = 0; k < REPORT_NOTES; k++)
        fprintf(out, "%s\n", report_note[k]);
}

/* By what a setting differs from the first: one knob's series, or the last for several. */
static int series_of(const struct tradeoff *r, size_t i)
{
    int series = 0;
    for (int k = 0; k < KNOBS; k++)
        if (r->point[i].setting.value[k] != r->point[0].setting.value[k])
            series = series ? KNOBS + 1 : k + 1;
    return series < PLOT_MAX_SERIES ? series : PLOT_MAX_SERIES - 1;
}

bool report_plot(const struct tradeoff *r, int which, struct plot *plot)
{
    bool time = which == 0;
    *plot = (struct plot){
        .title = time ? "Force error against time" : "Force error against the bank's size",
        .x = {.label = !time                   ? "bytes of the bank, everything included"
                       : r->instructions_known ? "instructions in the worst millisecond"
                                               : "nanoseconds of the worst tick, on this machine",
              .unit = time ? PLOT_NUMBER : PLOT_BYTES},
        .y = {.label = time ? "tick error, p95" : "patch error of the force, p95", .unit = PLOT_PERCENT},
        .count = r->points,
        .mark = calloc(r->points + 1, sizeof *plot->mark),
    };
    if (!plot->mark)
        return false;
    for (size_t i = 0; i < r->points; i++) {
        const struct tradeoff_point *p = &r->point[i];
        struct plot_mark *m = &plot->mark[i];
        char x[60], y[60];
        if (!time && i && knob_differ(&p->setting, &r->point[0].setting) >= STAGE_CONTROLLER)
            continue; /* the same bank as the first: x = 0 leaves the mark out */
        m->x = !time ? p->bytes : r->instructions_known ? p->load_max : p->ns_max;
        m->y = time ? p->tick_p95 : p->bank[COMPRESSION_ERROR_PATCH].p95;
        m->front = time ? p->front_time : p->front_bytes;
        m->series = series_of(r, i);
        plot_value_text(plot->x.unit, m->x, x, sizeof x);
        plot_value_text(plot->y.unit, m->y, y, sizeof y);
        snprintf(m->label, sizeof m->label, "%.99s", p->name);
        snprintf(m->title, sizeof m->title, "%s: %s, error %s", p->name, x, y);
        plot->series[m->series] = m->series == 0 ? "as the scene says"
                                  : m->series == PLOT_MAX_SERIES - 1 || m->series > KNOBS
                                      ? "several knobs"
                                      : knob_table[m->series - 1].legend;
    }
    bool good = plot_scale(plot);
    if (!good) {
        free(plot->mark);
        plot->mark = NULL;
    }
    return good;
}

int report_svg(const struct tradeoff *r, const char *path, struct failure *why)
{
    struct plot plot;
    char *text = NULL;
    size_t length = 0;
    if (!report_plot(r, 1, &plot))
        return failure_set(why, STATUS_CHECK_FAILED, path, NULL, "there is nothing to plot");
    FILE *out = open_memstream(&text, &length);
    if (out)
        plot_svg(out, &plot, true);
    bool good = out && fclose(out) == 0;
    int status = good ? file_replace(path, text, length, why)
                      : failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the plot");
    free(plot.mark);
    free(text);
    return status;
}
