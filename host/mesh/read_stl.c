/* STL, text and binary: triangles without sharing; soup_close welds them. */
#include <string.h>
#include <strings.h>

#include "mesh_readers.h"

static bool word_is(struct scan *s, const char *word)
{
    const char *token;
    size_t n = scan_peek(s, &token);
    if (n != strlen(word) || strncasecmp(token, word, n) != 0)
        return false;
    s->at += n;
    return true;
}

static int want(struct scan *s, const char *word)
{
    if (word_is(s, word))
        return STATUS_OK;
    const char *token;
    size_t n = scan_peek(s, &token);
    if (n == 0)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the file ends where \"%s\" should follow", word);
    return scan_fail(s, STATUS_MESH_SYNTAX, "\"%.*s\" stands where \"%s\" should", (int)(n < 30 ? n : 30), token, word);
}

static int add(struct soup *soup, struct scan *s, double x[3][3])
{
    uint32_t first = (uint32_t)soup->vertex_count;
    int status = STATUS_OK;
    for (int k = 0; k < 3 && status == STATUS_OK; k++)
        status = soup_vertex(soup, s, x[k]);
    return status ? status : soup_triangle(soup, s, first, first + 1, first + 2);
}

static int read_facet(struct scan *s, struct soup *soup)
{
    char ignored[8]; /* the normal is not used: it may be anything, even NaN */
    double x[3][3];
    int status = want(s, "normal");
    for (int k = 0; k < 3 && status == STATUS_OK; k++)
        status = scan_word(s, ignored, sizeof ignored, "a normal");
    if (status == STATUS_OK)
        status = want(s, "outer");
    if (status == STATUS_OK)
        status = want(s, "loop");
    for (int i = 0; i < 9 && status == STATUS_OK; i++) {
        if (i % 3 == 0)
            status = want(s, "vertex");
        if (status == STATUS_OK)
            status = scan_double(s, &x[i / 3][i % 3], "a coordinate");
    }
    if (status == STATUS_OK)
        status = want(s, "endloop");
    if (status == STATUS_OK)
        status = want(s, "endfacet");
    return status ? status : add(soup, s, x);
}

static int read_text(struct scan *s, struct soup *soup)
{
    int status = STATUS_OK;
    while (status == STATUS_OK && scan_skip(s)) {
        status = want(s, "solid");
        scan_next_line(s);
        while (status == STATUS_OK && word_is(s, "facet"))
            status = read_facet(s, soup);
        if (status == STATUS_OK)
            status = want(s, "endsolid");
        scan_next_line(s);
    }
    return status;
}

int read_stl(struct scan *s, struct soup *soup)
{
    enum { HEAD = 84, FACET = 50 };
    uint32_t count = 0;
    if (s->length >= HEAD) {
        s->at = 80;
        scan_i32(s, (int32_t *)&count, "the number of triangles");
    }
    bool exact = s->length >= HEAD && s->length - HEAD == (uint64_t)count * FACET;
    bool text = s->length >= 5 && strncasecmp((const char *)s->bytes, "solid", 5) == 0;
    if (text && !exact) {
        s->at = 0;
        return read_text(s, soup);
    }
    s->binary = true;
    if (s->length < HEAD)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the file ends inside its head");
    if ((s->length - HEAD) / FACET < count)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the file announces %u triangles, but only %zu bytes follow", count,
                         s->length - HEAD);
    int status = STATUS_OK;
    for (uint32_t i = 0; i < count && status == STATUS_OK; i++) {
        double x[3][3];
        s->at = HEAD + (size_t)i * FACET + 12;
        for (int k = 0; k < 9 && status == STATUS_OK; k++)
            status = scan_f32(s, &x[k / 3][k % 3], "a coordinate");
        if (status == STATUS_OK)
            status = add(soup, s, x);
    }
    return status;
}
