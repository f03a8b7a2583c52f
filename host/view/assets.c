#include "assets.h"

#include <string.h>

#define ASSET(name) extern const unsigned char asset_##name[], asset_##name##_end[]
ASSET(index_html);
ASSET(style_css);
ASSET(instrument_js);
ASSET(stage_js);
ASSET(trace_js);
ASSET(view_js);
ASSET(icon_svg);
ASSET(three_js);
ASSET(orbit_js);

const struct asset *asset_find(const char *path)
{
    /* The lengths are differences of linker symbols, which C does not count as constants: filled at the first call. */
    static struct asset table[10];
    if (!table[0].path) {
        const char *html = "text/html; charset=utf-8", *css = "text/css; charset=utf-8";
        const char *script = "text/javascript; charset=utf-8", *svg = "image/svg+xml";
        const struct {
            const char *path, *type;
            const unsigned char *from, *to;
        } files[10] = {{"/", html, asset_index_html, asset_index_html_end},
                       {"/index.html", html, asset_index_html, asset_index_html_end},
                       {"/style.css", css, asset_style_css, asset_style_css_end},
                       {"/instrument.js", script, asset_instrument_js, asset_instrument_js_end},
                       {"/stage.js", script, asset_stage_js, asset_stage_js_end},
                       {"/trace.js", script, asset_trace_js, asset_trace_js_end},
                       {"/view.js", script, asset_view_js, asset_view_js_end},
                       {"/icon.svg", svg, asset_icon_svg, asset_icon_svg_end},
                       {"/three.min.js", script, asset_three_js, asset_three_js_end},
                       {"/OrbitControls.js", script, asset_orbit_js, asset_orbit_js_end}};
        for (size_t i = 0; i < 10; i++)
            table[i] =
                (struct asset){files[i].path, files[i].type, files[i].from, (size_t)(files[i].to - files[i].from)};
    }
    for (size_t i = 0; i < sizeof table / sizeof *table; i++)
        if (strcmp(table[i].path, path) == 0)
            return &table[i];
    return NULL;
}
