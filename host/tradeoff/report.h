/* A measured trade as a table, one JSON object, a page of its own and a single plot. The page shows nothing that the JSON
 * has not: numbers, texts and the ticks of the axes. */
#ifndef TROCAR_TRADEOFF_REPORT_H
#define TROCAR_TRADEOFF_REPORT_H

#include <stdio.h>

#include "plot.h"
#include "tradeoff.h"

void report_table(FILE *out, const struct tradeoff *result);
int report_json(FILE *out, const struct tradeoff *result, struct failure *why);
int report_html(const struct tradeoff *result, const char *path, struct failure *why);
int report_svg(const struct tradeoff *result, const char *path, struct failure *why);

/* What must be known to read the numbers. */
enum { REPORT_NOTES = 11 };
extern const char *const report_note[REPORT_NOTES];

/* The plots: 0 error against time, 1 error against bytes. False when nothing of it was measured. Free plot->mark. */
enum { REPORT_PLOTS = 2 };
bool report_plot(const struct tradeoff *result, int which, struct plot *plot);

/* One column of the table: what the table and the page show of a point, in this order. */
struct report_column {
    const char *head, *unit;
    enum plot_unit shown;
    double (*value)(const struct tradeoff_point *point);
};
extern const struct report_column report_column[];
extern const size_t report_columns;

#endif
