#include "fit_drawing.h"

#include <stdlib.h>

#include "progress.h"

struct plot_mark fit_mark(double x, double y, int series, const char *what)
{
    struct plot_mark m = {.x = x, .y = y, .series = series};
    snprintf(m.title, sizeof m.title, "%s at %.4g: %.4g", what, x, y);
    return m;
}

int fit_draw(struct plot *plot, const char *path, struct failure *why)
{
    char *text = NULL;
    size_t length = 0;
    FILE *out = open_memstream(&text, &length);
    if (!out)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the drawing");
    if (plot_scale(plot))
        plot_svg(out, plot, true);
    int status = STATUS_OK;
    if (fclose(out) != 0)
        status = failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the drawing");
    if (status == STATUS_OK)
        status = file_replace(path, text, length, why);
    free(text);
    return status;
}
