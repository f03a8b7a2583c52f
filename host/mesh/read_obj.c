/* Wavefront OBJ: vertices and faces; what describes only the look is skipped. */
#include <stdlib.h>
#include <string.h>

#include "mesh_readers.h"

/* A corner "7", "7/1", "7//3" or "7/1/3"; negative numbers count back from the last vertex. */
static int read_corner(struct scan *s, const struct soup *soup, uint32_t *vertex)
{
    const char *token;
    size_t n = scan_peek(s, &token);
    char *end;
    long long number = strtoll(token, &end, 10);
    if (end == token || (size_t)(end - token) > n || ((size_t)(end - token) < n && *end != '/'))
        return scan_fail(s, STATUS_MESH_SYNTAX, "\"%.*s\" stands where a corner should", (int)(n < 30 ? n : 30), token);
    long long place = number > 0 ? number - 1 : number + (long long)soup->vertex_count;
    if (number == 0 || place < 0 || place >= (long long)soup->vertex_count)
        return scan_fail(s, STATUS_MESH_INDEX, "a face names vertex %lld, but %zu stand before it", number,
                         soup->vertex_count);
    s->at += n;
    *vertex = (uint32_t)place;
    return STATUS_OK;
}

static int read_face(struct scan *s, struct soup *soup)
{
    uint32_t corner[SOUP_POLYGON];
    size_t count = 0;
    while (scan_more_on_line(s)) {
        if (s->bytes[s->at] == '\\') { /* the line goes on in the next */
            scan_next_line(s);
            continue;
        }
        if (count == SOUP_POLYGON)
            return scan_fail(s, STATUS_MESH_SYNTAX, "a face of more than %d corners", SOUP_POLYGON);
        int status = read_corner(s, soup, &corner[count++]);
        if (status)
            return status;
    }
    if (count < 3)
        return scan_fail(s, STATUS_MESH_SYNTAX, "a face of %zu corners", count);
    return soup_polygon(soup, s, corner, count);
}

static bool is_skipped(const char *word)
{
    static const char *const words[] = {
        "vt", "vn",     "vp",  "g",      "o",   "s",          "usemtl",    "mtllib", "l",        "p",        "usemap",
        "mg", "cstype", "deg", "maplib", "lod", "shadow_obj", "trace_obj", "bevel",  "c_interp", "d_interp", "vc"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strcmp(word, words[i]) == 0)
            return true;
    return false;
}

int read_obj(struct scan *s, struct soup *soup)
{
    int status = STATUS_OK;
    s->comment = '#';
    while (status == STATUS_OK && scan_skip(s)) {
        char word[16];
        status = scan_word(s, word, sizeof word, "a keyword");
        if (status)
            break;
        if (strcmp(word, "v") == 0) {
            double x[3];
            for (int k = 0; k < 3 && status == STATUS_OK; k++)
                status = scan_double(s, &x[k], "a coordinate");
            if (status == STATUS_OK)
                status = soup_vertex(soup, s, x);
        } else if (strcmp(word, "f") == 0) {
            status = read_face(s, soup);
        } else if (!is_skipped(word)) {
            status = scan_fail(s, STATUS_MESH_SYNTAX, "the keyword \"%.15s\" is not known", word);
        }
        scan_next_line(s);
    }
    return status;
}
