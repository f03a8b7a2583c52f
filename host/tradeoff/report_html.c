#include <math.h>
#include <stdlib.h>

#include "progress.h"
#include "report.h"

static const char head[] =
    "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
    "<meta name=\"viewport\" content=\"width=device-width\">\n"
    "<link rel=\"icon\" href=\"data:,\">\n"
    "<style>\n"
    ":root{color-scheme:light dark;--ink:#222;--soft:#666;--line:#ddd;--paper:#fff;--best:#eef6ee}\n"
    "@media(prefers-color-scheme:dark){:root{--ink:#e6e6e6;--soft:#aaa;--line:#3a3a3a;--paper:#181818;--best:#22301f}}"
    "\n"
    "body{font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:78rem;margin:2rem auto;"
    "padding:0 1rem}\n"
    "h1{font-size:1.4rem}h2{font-size:1.1rem;margin-top:2rem}.soft{color:var(--soft)}\n"
    "svg{max-width:100%;height:auto;fill:var(--ink);font-size:13px}.grid{stroke:var(--line)}.tick{font-size:12px}\n"
    ".head{font-size:15px;font-weight:600}.front{fill:none;stroke:var(--soft);stroke-width:1.5;stroke-dasharray:5 4}\n"
    ".ring{fill:none;stroke:var(--soft);stroke-width:1.5}.mark:hover circle{stroke:var(--ink);stroke-width:2}\n"
    ".wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.85rem}\n"
    "th,td{padding:.2rem .5rem;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}\n"
    "th:first-child,td:first-child{text-align:left}tr.best{background:var(--best)}\n"
    "</style>\n";

static void table(FILE *out, const struct tradeoff *r)
{
    char text[60];
    fputs("<div class=\"wide\"><table><thead><tr><th>setting</th>", out);
    for (size_t c = 0; c < report_columns; c++)
        fprintf(out, "<th>%s<br>%s</th>", report_column[c].head, report_column[c].unit);
    fputs("<th>best of</th></tr></thead><tbody>\n", out);
    for (size_t i = 0; i < r->points; i++) {
        const struct tradeoff_point *p = &r->point[i];
        fprintf(out, "<tr%s><td>", p->front_time || p->front_bytes ? " class=\"best\"" : "");
        plot_escape(out, p->name);
        fputs("</td>", out);
        for (size_t c = 0; c < report_columns; c++) {
            double value = report_column[c].value(p);
            if (isfinite(value))
                plot_value_text(report_column[c].shown, value, text, sizeof text);
            else
                snprintf(text, sizeof text, "-");
            fprintf(out, "<td>%s</td>", text);
        }
        fprintf(out, "<td>%s%s%s</td></tr>\n", p->front_time ? "time" : "", p->front_time && p->front_bytes ? ", " : "",
                p->front_bytes ? "bytes" : "");
    }
    fputs("</tbody></table></div>\n", out);
}

static void sections(FILE *out, const struct tradeoff *r)
{
    const struct tradeoff_point *p = &r->point[0];
    fputs(
        "<h2>The scene's bank by section</h2>\n<table><thead><tr><th>section</th><th>bytes</th></tr></thead><tbody>\n",
        out);
    for (size_t k = 0; k < p->sections; k++) {
        fputs("<tr><td>", out);
        plot_escape(out, p->section[k].tag);
        fprintf(out, "</td><td>%.0f</td></tr>\n", p->section[k].bytes);
    }
    fputs("</tbody></table>\n", out);
}

static void page(FILE *out, const struct tradeoff *r)
{
    fprintf(out, "%s<title>", head);
    plot_escape(out, r->scene);
    fputs(": what accuracy costs</title></head><body>\n<h1>What accuracy costs in time: ", out);
    plot_escape(out, r->scene);
    fputs("</h1>\n<p class=\"soft\">", out);
    plot_escape(out, r->mesh);
    fprintf(out, ", %.0f surface nodes; gesture ", r->points ? r->point[0].surface_nodes : 0);
    plot_escape(out, r->gesture);
    fprintf(out,
            ", %.0f ticks, %.0f of them in contact; %.0f random contact sets of each kind; mesh error at %.0f sites "
            "under tools of %.4g and %.4g m radius; measured in %.4g s</p>\n",
            r->ticks, r->contact_ticks, r->trials, r->sites, r->tool_radius_m[0], r->tool_radius_m[1], r->seconds);
    fputs("<h2>What to pick</h2>\n<ul>\n", out);
    for (size_t k = 0; k < r->advices; k++) {
        fputs("<li>", out);
        plot_escape(out, r->advice[k].text);
        fputs("</li>\n", out);
    }
    fputs("</ul>\n", out);
    for (int k = 0; k < REPORT_PLOTS; k++) {
        struct plot plot;
        if (!report_plot(r, k, &plot))
            continue;
        plot_svg(out, &plot, false);
        free(plot.mark);
    }
    fputs("<h2>Everything that was measured</h2>\n", out);
    table(out, r);
    if (r->left_out > 0) {
        fprintf(out, "<p>%.0f settings were left out, the first because ", r->left_out);
        plot_escape(out, r->left_out_why);
        fputs("</p>\n", out);
    }
    if (!r->instructions_known) {
        fputs("<p>Instructions were not counted: ", out);
        plot_escape(out, r->instructions_reason);
        fputs("</p>\n", out);
    }
    if (r->points)
        sections(out, r);
    fputs("<h2>How to read it</h2>\n<ul>\n", out);
    for (int k = 0; k < REPORT_NOTES; k++) {
        fputs("<li>", out);
        plot_escape(out, report_note[k]);
        fputs("</li>\n", out);
    }
    fputs("</ul>\n</body></html>\n", out);
}

int report_html(const struct tradeoff *r, const char *path, struct failure *why)
{
    char *text = NULL;
    size_t length = 0;
    FILE *out = open_memstream(&text, &length);
    if (out)
        page(out, r);
    bool good = out && fclose(out) == 0;
    int status = good ? file_replace(path, text, length, why)
                      : failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the report");
    free(text);
    return status;
}
