#include "vtk_xml_data.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

/* Bytes behind base64 or none. Groups of four characters decode by themselves, so that a header and its data may be encoded
 * as one or, as some writers do, one after the other. */
struct source {
    struct scan *s;
    size_t at, end;
    bool base64;
    unsigned char group[3];
    size_t held; /* bytes of `group` not yet taken, its last ones first in line */
    size_t group_size;
};

static int sextet(unsigned char c)
{
    if (c >= 'A' && c <= 'Z')
        return c - 'A';
    if (c >= 'a' && c <= 'z')
        return c - 'a' + 26;
    if (c >= '0' && c <= '9')
        return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

static int cut_short(struct source *from)
{
    from->s->at = from->at;
    return scan_fail(from->s, STATUS_MESH_SYNTAX, "the data end too early or are not base64");
}

static int fill_group(struct source *from)
{
    uint32_t bits = 0;
    int characters = 0, padding = 0;
    while (characters < 4) {
        if (from->at >= from->end)
            return cut_short(from);
        unsigned char c = from->s->bytes[from->at++];
        if (c == ' ' || c == '\n' || c == '\r' || c == '\t')
            continue;
        int value = sextet(c);
        if (c == '=' && characters >= 2)
            padding++;
        else if (value < 0 || padding)
            return cut_short(from);
        bits = bits << 6 | (uint32_t)(value < 0 ? 0 : value);
        characters++;
    }
    for (int k = 0; k < 3; k++)
        from->group[k] = (unsigned char)(bits >> (16 - 8 * k));
    from->held = from->group_size = 3 - (size_t)padding;
    return STATUS_OK;
}

static int take(struct source *from, void *to, size_t size)
{
    unsigned char *out = to;
    if (!from->base64) {
        if (size > from->end - from->at)
            return cut_short(from);
        memcpy(out, from->s->bytes + from->at, size);
        from->at += size;
        return STATUS_OK;
    }
    while (size > 0) {
        if (from->held == 0) {
            int status = fill_group(from);
            if (status)
                return status;
            continue;
        }
        *out++ = from->group[from->group_size - from->held--];
        size--;
    }
    return STATUS_OK;
}

/* More bytes than this cannot follow. */
static uint64_t most_left(const struct source *from)
{
    return from->end - from->at + 3;
}

static int take_header(struct source *from, const struct xml_encoding *encoding, uint64_t *value)
{
    uint32_t narrow = 0;
    int status = encoding->wide_header ? take(from, value, 8) : take(from, &narrow, 4);
    if (status)
        return status;
    if (encoding->swap)
        encoding->wide_header ? swap_bytes(value, 8) : swap_bytes(&narrow, 4);
    if (!encoding->wide_header)
        *value = narrow;
    return STATUS_OK;
}

static int implausible(struct source *from, const char *what, uint64_t value)
{
    from->s->at = from->at;
    return scan_fail(from->s, STATUS_MESH_SYNTAX, "the header of an array says %s %llu, which does not fit the file",
                     what, (unsigned long long)value);
}

static unsigned char *room_for(struct source *from, size_t size)
{
    unsigned char *room = malloc(size ? size : 1);
    if (!room)
        scan_fail(from->s, STATUS_MEMORY, "no memory for an array of %zu bytes", size);
    return room;
}

static int plain(struct source *from, const struct xml_encoding *encoding, unsigned char **bytes, size_t *size)
{
    uint64_t length = 0;
    int status = take_header(from, encoding, &length);
    if (status)
        return status;
    if (length > most_left(from))
        return implausible(from, "bytes", length);
    *bytes = room_for(from, (size_t)length);
    if (!*bytes)
        return STATUS_MEMORY;
    *size = (size_t)length;
    return take(from, *bytes, (size_t)length);
}

static int inflate_blocks(struct source *from, const uint64_t *stored, uint64_t blocks, uint64_t block_size,
                          unsigned char *to, size_t size)
{
    size_t done = 0;
    int status = STATUS_OK;
    for (uint64_t i = 0; i < blocks && status == STATUS_OK; i++) {
        if (stored[i] > most_left(from))
            return implausible(from, "a block of", stored[i]);
        unsigned char *packed = room_for(from, (size_t)stored[i]);
        if (!packed)
            return STATUS_MEMORY;
        uLongf wanted = size - done < block_size ? size - done : block_size, got = wanted;
        status = take(from, packed, (size_t)stored[i]);
        if (status == STATUS_OK && (uncompress(to + done, &got, packed, stored[i]) != Z_OK || got != wanted)) {
            from->s->at = from->at;
            status = scan_fail(from->s, STATUS_MESH_SYNTAX, "a compressed block is damaged");
        }
        free(packed);
        done += wanted;
    }
    return status;
}

/* Header: blocks, size of a block, size of the last one (0: full), then each block's compressed size. */
static int compressed(struct source *from, const struct xml_encoding *encoding, unsigned char **bytes, size_t *size)
{
    enum { MOST_RATIO = 1032 }; /* of deflate */
    uint64_t blocks = 0, block_size = 0, last = 0;
    int status = take_header(from, encoding, &blocks);
    if (status == STATUS_OK)
        status = take_header(from, encoding, &block_size);
    if (status == STATUS_OK)
        status = take_header(from, encoding, &last);
    if (status)
        return status;
    if (blocks > most_left(from) / 4)
        return implausible(from, "blocks", blocks);
    uint64_t most = most_left(from) * MOST_RATIO;
    if (block_size > most || last > block_size || (blocks && block_size > most / blocks))
        return implausible(from, "bytes per block", block_size);
    uint64_t total = blocks * block_size - (blocks && last ? block_size - last : 0);
    uint64_t *stored = malloc((size_t)(blocks + 1) * sizeof *stored);
    if (!stored)
        return scan_fail(from->s, STATUS_MEMORY, "no memory for %llu blocks", (unsigned long long)blocks);
    for (uint64_t i = 0; i < blocks && status == STATUS_OK; i++) {
        stored[i] = 0;
        status = take_header(from, encoding, &stored[i]);
    }
    if (status == STATUS_OK) {
        *bytes = room_for(from, (size_t)total);
        *size = (size_t)total;
        status = *bytes ? inflate_blocks(from, stored, blocks, block_size, *bytes, *size) : STATUS_MEMORY;
    }
    free(stored);
    return status;
}

static int count_text(struct scan part)
{
    const char *token;
    size_t n, count = 0;
    while ((n = scan_peek(&part, &token)) > 0 && count < INT32_MAX) {
        part.at += n;
        count++;
    }
    return (int)count;
}

static int wrong_count(struct scan *s, const struct xml_array *array, size_t count, size_t expected)
{
    return scan_fail(s, STATUS_MESH_SYNTAX, "the array \"%.60s\" holds %zu numbers instead of %zu", array->name, count,
                     expected);
}

int xml_numbers(struct scan *s, const struct xml_array *array, const struct xml_encoding *encoding, size_t expected,
                bool finite, double **values, size_t *count)
{
    *values = NULL;
    s->line = array->line;
    s->at = array->at;
    s->binary = array->form != XML_TEXT;
    if (array->form == XML_TEXT) {
        struct scan part = *s;
        part.length = array->end;
        *count = (size_t)count_text(part);
        if (expected != SIZE_MAX && *count != expected)
            return wrong_count(s, array, *count, expected);
        return vtk_text(&part, *count, finite, values);
    }
    struct source from = {.s = s, .at = array->at, .end = array->end, .base64 = array->form == XML_BASE64};
    unsigned char *bytes = NULL;
    size_t size = 0, each = vtk_size(array->type);
    int status = encoding->zlib ? compressed(&from, encoding, &bytes, &size) : plain(&from, encoding, &bytes, &size);
    *count = size / each;
    if (status == STATUS_OK && (size % each || (expected != SIZE_MAX && *count != expected)))
        status = wrong_count(s, array, *count, expected == SIZE_MAX ? *count : expected);
    if (status == STATUS_OK) {
        *values = malloc((*count ? *count : 1) * sizeof **values);
        if (!*values)
            status = scan_fail(s, STATUS_MEMORY, "no memory for %zu numbers", *count);
    }
    for (size_t i = 0; status == STATUS_OK && i < *count; i++) {
        (*values)[i] = vtk_value(bytes + i * each, array->type, encoding->swap);
        if (finite && !isfinite((*values)[i]))
            status =
                scan_fail(s, STATUS_MESH_NONFINITE, "number %zu of the array \"%.60s\" is not finite", i, array->name);
    }
    if (status) {
        free(*values);
        *values = NULL;
    }
    free(bytes);
    return status;
}
