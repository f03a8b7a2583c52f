#include "plot.h"

#include <math.h>
#include <string.h>

enum { WIDTH = 760, HEIGHT = 420, LEFT = 92, RIGHT = 44, TOP = 40, BOTTOM = 96 };

/* Colour-blind safe (Okabe and Ito 2008); the first is the text's. */
static const char *const colour[PLOT_MAX_SERIES] = {"currentColor", "#0072b2", "#d55e00", "#009e73",
                                                    "#cc79a7",      "#56b4e9", "#e69f00", "#f0e442",
                                                    "#8a6d00",      "#7f7f7f", "#b15928"};

void plot_escape(FILE *out, const char *text)
{
    for (; *text; text++)
        if (*text == '&')
            fputs("&amp;", out);
        else if (*text == '<')
            fputs("&lt;", out);
        else if (*text == '>')
            fputs("&gt;", out);
        else if (*text == '"')
            fputs("&quot;", out);
        else
            fputc(*text, out);
}

void plot_value_text(enum plot_unit unit, double value, char *text, size_t room)
{
    double shown = unit == PLOT_PERCENT ? 100 * value : unit == PLOT_BYTES ? value / 1024 : value;
    const char *behind = unit == PLOT_PERCENT ? " %" : unit == PLOT_BYTES ? " KiB" : "";
    if (fabs(shown) >= 1000 && fabs(shown) < 1e9)
        snprintf(text, room, "%.0f%s", shown, behind);
    else
        snprintf(text, room, "%.3g%s", shown, behind);
}

/* Tick number k of an axis: 1, 2, 5 of each decade, through decimal text so that 0.002 is 0.002; powers of two of bytes. */
static double tick_value(enum plot_unit unit, int k)
{
    if (unit == PLOT_BYTES)
        return ldexp(1, k);
    static const int digit[3] = {1, 2, 5};
    int decade = k >= 0 ? k / 3 : -((2 - k) / 3);
    char text[40];
    double value = 0;
    snprintf(text, sizeof text, "%de%d", digit[k - 3 * decade], decade);
    sscanf(text, "%lf", &value);
    return value;
}

static bool scale(struct plot_axis *axis, double low, double high)
{
    int first = axis->unit == PLOT_BYTES ? 0 : -36, last = axis->unit == PLOT_BYTES ? 40 : 36;
    while (first < last && tick_value(axis->unit, first + 1) <= low)
        first++;
    while (last > first + 1 && tick_value(axis->unit, last - 1) >= high)
        last--;
    /* over many decades only their first ticks, so that labels do not touch */
    int stride = axis->unit != PLOT_BYTES && last - first > 9    ? 3
                 : axis->unit == PLOT_BYTES && last - first > 12 ? 2
                                                                 : 1;
    if (stride == 3) {
        while (first % 3)
            first--;
        while (last % 3)
            last++;
    }
    if (stride == 2 && (last - first) % 2)
        last++;
    axis->ticks = 0;
    for (int k = first; k <= last && axis->ticks < PLOT_MAX_TICKS; k += stride)
        axis->tick[axis->ticks++] = tick_value(axis->unit, k);
    axis->low = axis->tick[0];
    axis->high = axis->tick[axis->ticks - 1];
    return axis->high > axis->low;
}

static bool drawn(const struct plot_mark *m)
{
    return isfinite(m->x) && isfinite(m->y) && m->x > 0 && m->y >= 0;
}

bool plot_scale(struct plot *plot)
{
    double x_low = INFINITY, x_high = 0, y_low = INFINITY, y_high = 0;
    for (size_t i = 0; i < plot->count; i++) {
        const struct plot_mark *m = &plot->mark[i];
        if (!drawn(m))
            continue;
        x_low = fmin(x_low, m->x);
        x_high = fmax(x_high, m->x);
        if (m->y > 0) {
            y_low = fmin(y_low, m->y);
            y_high = fmax(y_high, m->y);
        }
    }
    if (!(x_high > 0))
        return false;
    if (!(y_high > 0)) /* no error at all: some axis */
        y_low = 1e-6, y_high = 1e-5;
    return scale(&plot->x, x_low, x_high) && scale(&plot->y, y_low, y_high);
}

static double place(const struct plot_axis *axis, double value)
{
    double v = value > axis->low ? value : axis->low;
    return log(v / axis->low) / log(axis->high / axis->low);
}

static double px(const struct plot *plot, double x)
{
    return LEFT + (WIDTH - LEFT - RIGHT) * place(&plot->x, x);
}

static double py(const struct plot *plot, double y)
{
    return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * place(&plot->y, y);
}

static void axes(FILE *out, const struct plot *plot)
{
    char text[60];
    for (size_t k = 0; k < plot->x.ticks; k++) {
        double x = px(plot, plot->x.tick[k]);
        plot_value_text(plot->x.unit, plot->x.tick[k], text, sizeof text);
        fprintf(out, "<line class=\"grid\" x1=\"%.1f\" y1=\"%d\" x2=\"%.1f\" y2=\"%d\"/>", x, TOP, x, HEIGHT - BOTTOM);
        fprintf(out, "<text class=\"tick\" x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%s</text>\n", x,
                HEIGHT - BOTTOM + 17, text);
    }
    for (size_t k = 0; k < plot->y.ticks; k++) {
        double y = py(plot, plot->y.tick[k]);
        plot_value_text(plot->y.unit, plot->y.tick[k], text, sizeof text);
        fprintf(out, "<line class=\"grid\" x1=\"%d\" y1=\"%.1f\" x2=\"%d\" y2=\"%.1f\"/>", LEFT, y, WIDTH - RIGHT, y);
        fprintf(out, "<text class=\"tick\" x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%s</text>\n", LEFT - 7, y + 4, text);
    }
    fprintf(out, "<text class=\"label\" x=\"%d\" y=\"%d\" text-anchor=\"middle\">", (LEFT + WIDTH - RIGHT) / 2,
            HEIGHT - BOTTOM + 38);
    plot_escape(out, plot->x.label);
    fprintf(out, "</text>\n<text class=\"label\" transform=\"translate(14 %d) rotate(-90)\" text-anchor=\"middle\">",
            (TOP + HEIGHT - BOTTOM) / 2);
    plot_escape(out, plot->y.label);
    fputs("</text>\n", out);
}

/* The next mark of the front to the right of x; plot->count when there is none. */
static size_t next_on_front(const struct plot *plot, double x)
{
    size_t next = plot->count;
    for (size_t i = 0; i < plot->count; i++)
        if (plot->mark[i].front && drawn(&plot->mark[i]) && plot->mark[i].x > x &&
            (next == plot->count || plot->mark[i].x < plot->mark[next].x))
            next = i;
    return next;
}

/* Steps: until the next mark costs that much, nothing better is to be had. */
static void front(FILE *out, const struct plot *plot)
{
    size_t at = next_on_front(plot, 0);
    if (at == plot->count)
        return;
    fprintf(out, "<path class=\"front\" d=\"M%.1f %.1f", px(plot, plot->mark[at].x), py(plot, plot->mark[at].y));
    while ((at = next_on_front(plot, plot->mark[at].x)) < plot->count)
        fprintf(out, "H%.1fV%.1f", px(plot, plot->mark[at].x), py(plot, plot->mark[at].y));
    fputs("\"/>\n", out);
}

static void curve(FILE *out, const struct plot *plot, int series)
{
    char move = 'M';
    fputs("<path fill=\"none\" stroke-width=\"2\" d=\"", out);
    for (size_t i = 0; i < plot->count; i++)
        if (plot->mark[i].series == series && drawn(&plot->mark[i])) {
            fprintf(out, "%c%.1f %.1f", move, px(plot, plot->mark[i].x), py(plot, plot->mark[i].y));
            move = 'L';
        }
    fprintf(out, "\" stroke=\"%s\"/>\n", colour[series]);
}

static void legend(FILE *out, const struct plot *plot)
{
    double x = LEFT, y = HEIGHT - 32;
    bool ringed = next_on_front(plot, 0) < plot->count;
    for (int s = 0; s <= PLOT_MAX_SERIES; s++) {
        const char *name = s < PLOT_MAX_SERIES ? plot->series[s]
                           : ringed            ? "ringed, on the line: nothing measured beats it"
                                               : NULL;
        if (!name)
            continue;
        double width = 26 + 6.4 * (double)strlen(name);
        if (x + width > WIDTH - RIGHT && x > LEFT) {
            x = LEFT;
            y += 18;
        }
        if (s < PLOT_MAX_SERIES)
            fprintf(out, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"5\" fill=\"%s\"/>", x + 5, y - 4, colour[s]);
        else
            fprintf(out, "<circle class=\"ring\" cx=\"%.1f\" cy=\"%.1f\" r=\"6\"/>", x + 5, y - 4);
        fprintf(out, "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\">", x + 15, y);
        plot_escape(out, name);
        fputs("</text>\n", out);
        x += width;
    }
}

/* The ring of a mark on the front, and its label: to the right, where the line leaves room above it; at the right edge to
 * the left. */
static void ring(FILE *out, const struct plot *plot, const struct plot_mark *m)
{
    double x = px(plot, m->x), y = py(plot, m->y), width = 6.2 * (double)strlen(m->label);
    bool left = x + 14 + width > WIDTH - 4;
    fprintf(out, "<circle class=\"ring\" cx=\"%.1f\" cy=\"%.1f\" r=\"9\"/>", x, y);
    if (!*m->label)
        return;
    fprintf(out, "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">", left ? x - 14 : x + 12,
            left ? y + 4 : y - 9, left ? "end" : "start");
    plot_escape(out, m->label);
    fputs("</text>", out);
}

void plot_svg(FILE *out, const struct plot *plot, bool standalone)
{
    fprintf(out, "<svg%s viewBox=\"0 0 %d %d\" width=\"%d\" role=\"img\">\n",
            standalone ? " xmlns=\"http://www.w3.org/2000/svg\"" : "", WIDTH, HEIGHT, WIDTH);
    if (standalone)
        fputs(
            "<style>svg{background:#fff;font:13px "
            "system-ui,sans-serif;fill:#222}.grid{stroke:#ddd}.tick{font-size:12px}"
            ".front{fill:none;stroke:#888;stroke-width:1.5;stroke-dasharray:5 4}"
            ".ring{fill:none;stroke:#888;stroke-width:1.5}.head{font-size:15px;font-weight:600}"
            "@media(prefers-color-scheme:dark){svg{background:#181818;color:#e6e6e6;fill:#e6e6e6}.grid{stroke:#3a3a3a}"
            ".front,.ring{stroke:#aaa}}</style>\n",
            out);
    fprintf(out, "<text class=\"head\" x=\"%d\" y=\"22\">", LEFT);
    plot_escape(out, plot->title);
    fputs("</text>\n", out);
    axes(out, plot);
    front(out, plot);
    for (int series = 0; series < PLOT_MAX_SERIES; series++)
        if (plot->curve[series])
            curve(out, plot, series);
    for (size_t i = 0; i < plot->count; i++) {
        const struct plot_mark *m = &plot->mark[i];
        if (!drawn(m) || plot->curve[m->series])
            continue;
        fputs("<g class=\"mark\"><title>", out);
        plot_escape(out, m->title);
        fputs("</title>", out);
        if (m->front)
            ring(out, plot, m);
        fprintf(out, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"5\" fill=\"%s\"/></g>\n", px(plot, m->x), py(plot, m->y),
                colour[m->series]);
    }
    legend(out, plot);
    fputs("</svg>\n", out);
}
