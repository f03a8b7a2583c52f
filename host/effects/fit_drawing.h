/* Measured beside fitted, as a drawing beside a bank. */
#ifndef TROCAR_FIT_DRAWING_H
#define TROCAR_FIT_DRAWING_H

#include "failure.h"
#include "plot.h"

/* A mark whose title says what it is and its values. */
struct plot_mark fit_mark(double x, double y, int series, const char *what);

/* The plot as a file of its own, whole or not at all; nothing when no mark can be shown. FILE_*, MEMORY. */
int fit_draw(struct plot *plot, const char *path, struct failure *why);

#endif
