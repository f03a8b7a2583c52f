/* A scatter plot with logarithmic axes as inline SVG, drawn here: the marks of a trade, the Pareto front through those that
 * nothing beats, and hover titles. */
#ifndef TROCAR_PLOT_H
#define TROCAR_PLOT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum { PLOT_MAX_TICKS = 40, PLOT_MAX_SERIES = 11 };

enum plot_unit { PLOT_NUMBER, PLOT_PERCENT, PLOT_BYTES };

struct plot_axis {
    const char *label;
    enum plot_unit unit;
    double low, high; /* of the axis; both are ticks */
    size_t ticks;
    double tick[PLOT_MAX_TICKS];
};

struct plot_mark {
    double x, y; /* y = 0 (no error) is drawn on the lower edge; x = 0 or a number that is not finite leaves the mark
                    * out */
    bool front;
    int series; /* 0 .. PLOT_MAX_SERIES - 1 */
    char title[300];
    char label[100]; /* beside the mark when it is on the front; may be empty */
};

struct plot {
    const char *title;
    struct plot_axis x, y;
    size_t count;
    struct plot_mark *mark;
    const char *series[PLOT_MAX_SERIES]; /* names for the legend; NULL: not used */
    bool curve[PLOT_MAX_SERIES];         /* the marks of this series are one line, in their order */
};

/* Axes that hold all marks: ticks at 1, 2, 5 of each decade, for bytes at powers of two. False when there is no mark. */
bool plot_scale(struct plot *plot);
/* The value with its unit, as the axis shows it. */
void plot_value_text(enum plot_unit unit, double value, char *text, size_t room);
/* `standalone`: a file of its own, with the XML namespace and its own colours, for light and dark pages. */
void plot_svg(FILE *out, const struct plot *plot, bool standalone);
/* Text with &, <, > and " escaped. */
void plot_escape(FILE *out, const char *text);

#endif
