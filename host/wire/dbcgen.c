#include "dbcgen.h"

#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>

enum { NAME_ROOM = 2 * DBC_MAX_NAME + 2 };

/* CamelCase -> camel_case: an underscore before every capital that follows a small letter or digit. */
static const char *snake(const char *camel, char out[NAME_ROOM])
{
    size_t n = 0;
    for (size_t i = 0; camel[i]; i++) {
        if (isupper((unsigned char)camel[i]) && i > 0 && !isupper((unsigned char)camel[i - 1]) && camel[i - 1] != '_')
            out[n++] = '_';
        out[n++] = (char)tolower((unsigned char)camel[i]);
    }
    out[n] = '\0';
    return out;
}

static const char *shout(const char *camel, char out[NAME_ROOM])
{
    snake(camel, out);
    for (size_t i = 0; out[i]; i++)
        out[i] = (char)toupper((unsigned char)out[i]);
    return out;
}

static const char *c_type(const struct dbc_signal *signal)
{
    static const char *const types[2][3] = {{"uint8_t", "uint16_t", "uint32_t"}, {"int8_t", "int16_t", "int32_t"}};
    return types[signal->is_signed][signal->bits <= 8 ? 0 : signal->bits <= 16 ? 1 : 2];
}

static const struct dbc_signal *selector(const struct dbc_message *m)
{
    for (size_t i = 0; i < m->signal_count; i++)
        if (m->signal[i].kind == DBC_SELECTOR)
            return &m->signal[i];
    return NULL;
}

/* Words of `text` in a comment of at most 120 columns, as clang-format leaves it. */
static void comment(FILE *out, const char *text)
{
    size_t column = 3;
    fprintf(out, "/* ");
    while (*text) {
        const size_t n = strcspn(text, " \n");
        if (column + n + 3 > 120) {
            fprintf(out, "\n * ");
            column = 3;
        } else if (column > 3) {
            fputc(' ', out);
            column++;
        }
        fprintf(out, "%.*s", (int)n, text);
        column += n;
        text += n;
        text += strspn(text, " \n");
    }
    fprintf(out, " */\n");
}

/* Columns are aligned as clang-format would, so that the generated files pass its check. */
static int pad(FILE *out, size_t written, size_t width)
{
    return fprintf(out, "%*s", (int)(width - written), "");
}

static size_t member_width(const struct dbc_signal *signal)
{
    char text[NAME_ROOM];
    return strlen(c_type(signal)) + 1 + strlen(snake(signal->name, text)) + 1;
}

static void member(FILE *out, const struct dbc_signal *signal, size_t width)
{
    char text[NAME_ROOM];
    fprintf(out, "    %s %s;", c_type(signal), snake(signal->name, text));
    pad(out, member_width(signal), width);
    fprintf(out, " /* ");
    if (signal->kind == DBC_PAGED)
        fprintf(out, "page %u: ", signal->page);
    else if (signal->kind == DBC_SELECTOR)
        fprintf(out, "page: ");
    fprintf(out, "%u bit%s", signal->bits, signal->bits == 1 ? "" : "s");
    if (signal->factor != 1 || signal->offset != 0)
        fprintf(out, " of %.9g%s%s", signal->factor, *signal->unit ? " " : "", signal->unit);
    else if (*signal->unit)
        fprintf(out, ", %s", signal->unit);
    if (signal->offset != 0)
        fprintf(out, " above %.9g", signal->offset);
    fprintf(out, ", %.10g..%.10g */\n", signal->minimum, signal->maximum);
}

static bool scaled(const struct dbc_signal *signal)
{
    return signal->factor != 1 || signal->offset != 0;
}

/* "#define WIRE_MESSAGE_SIGNAL_KIND VALUE" with the value in the column `width` behind the name. */
static void macro(FILE *out, const struct dbc_message *m, const struct dbc_signal *signal, const char *kind,
                  const char *value, size_t width)
{
    char upper[NAME_ROOM], field[NAME_ROOM];
    const int n = fprintf(out, "#define WIRE_%s_%s_%s", shout(m->name, upper), shout(signal->name, field), kind);
    pad(out, n < 0 ? width : (size_t)n, width);
    fprintf(out, " %s\n", value);
}

/* A float literal that has a point or an exponent. */
static const char *float_literal(double value, char out[40])
{
    snprintf(out, 32, "%.9g", value);
    strcat(out, strpbrk(out, ".e") ? "f" : ".0f");
    return out;
}

static void scales(FILE *out, const struct dbc_message *m)
{
    char text[NAME_ROOM], literal[40];
    size_t width = 0;
    for (size_t i = 0; i < m->signal_count; i++) {
        const struct dbc_signal *signal = &m->signal[i];
        const size_t prefix = strlen("#define WIRE__") + strlen(snake(m->name, text));
        const size_t n =
            prefix + strlen(snake(signal->name, text)) + strlen(signal->offset != 0 ? "_OFFSET" : "_SCALE");
        if (scaled(signal) && n > width)
            width = n;
    }
    for (size_t i = 0; i < m->signal_count; i++) {
        const struct dbc_signal *signal = &m->signal[i];
        if (!scaled(signal))
            continue;
        macro(out, m, signal, "SCALE", float_literal(signal->factor, literal), width);
        if (signal->offset != 0)
            macro(out, m, signal, "OFFSET", float_literal(signal->offset, literal), width);
        snprintf(literal, sizeof literal, "%u", signal->bits);
        macro(out, m, signal, "BITS", literal, width);
    }
}

static void declare(FILE *out, const struct dbc_message *m)
{
    char upper[NAME_ROOM], lower[NAME_ROOM];
    bool per_node;
    const uint32_t base = dbc_base(m, &per_node);
    shout(m->name, upper);
    snake(m->name, lower);
    fprintf(out, "\n");
    comment(out, *m->comment ? m->comment : m->name);
    fprintf(out, "enum { WIRE_%s_ID = 0x%03" PRIx32 "%s, WIRE_%s_LENGTH = %u };\n", upper, base,
            per_node ? " /* + node */" : "", upper, m->length);
    scales(out, m);
    fprintf(out, "struct wire_%s {\n", lower);
    size_t width = 0;
    for (size_t i = 0; i < m->signal_count; i++)
        if (member_width(&m->signal[i]) > width)
            width = member_width(&m->signal[i]);
    for (size_t i = 0; i < m->signal_count; i++)
        member(out, &m->signal[i], width);
    fprintf(out, "};\n");
    fprintf(out, "void wire_%s_pack(uint8_t data[8], const struct wire_%s *m);\n", lower, lower);
    fprintf(out, "bool wire_%s_unpack(struct wire_%s *m, const uint8_t *data, uint8_t length);\n", lower, lower);
}

static int finish(FILE *out, struct failure *why)
{
    if (fflush(out) != 0 || ferror(out))
        return failure_set(why, STATUS_FILE_WRITE, NULL, "", "the generated code could not be written");
    return STATUS_OK;
}

int dbcgen_header(FILE *out, const struct dbc *dbc, struct failure *why)
{
    fprintf(
        out,
        "/* Generated by dbcgen from wire.dbc; do not edit. Every frame of the protocol: identifiers, packing and\n"
        " * unpacking. What the signals mean is in SPEC.md, section Wire.\n"
        " *\n"
        " * Structs hold raw integers; physical = raw * WIRE_MESSAGE_SIGNAL_SCALE. Pack keeps the low bits of each "
        "and\n"
        " * fills data[8] with zeros beyond the message's length. Unpack returns false, and leaves *m alone, when the\n"
        " * length is not the message's. A message with pages carries one at a time: pack writes the signals of the "
        "page\n"
        " * that *m selects and unpack writes only those of the page received (false for a page that is not in "
        "wire.dbc);\n"
        " * signals without a page are always present. WIRE_..._ID marked `+ node` is the base to which the node is\n"
        " * added. Ranges are not checked here. */\n");
    fprintf(out, "#ifndef TROCAR_WIRE_H\n#define TROCAR_WIRE_H\n\n#include <stdbool.h>\n#include <stdint.h>\n\n");
    fprintf(out, "/* The raw integer nearest to value / scale (halves away from 0), held to what `bits` can carry: "
                 "1..31 bits, or\n"
                 " * 32 signed. NaN gives 0. */\n"
                 "int32_t wire_quantise(float value, float scale, int bits, bool is_signed);\n");
    for (size_t i = 0; i < dbc->message_count; i++)
        declare(out, &dbc->message[i]);
    fprintf(out, "\n#endif\n");
    return finish(out, why);
}

static void pack_signal(FILE *out, const struct dbc_signal *signal, const char *indent)
{
    char text[NAME_ROOM];
    fprintf(out, "%sbits |= field((uint32_t)m->%s, %u, %u);\n", indent, snake(signal->name, text), signal->start,
            signal->bits);
}

static void unpack_signal(FILE *out, const struct dbc_signal *signal, const char *indent)
{
    char text[NAME_ROOM];
    fprintf(out, "%sm->%s = (%s)%s(bits, %u, %u);\n", indent, snake(signal->name, text), c_type(signal),
            signal->is_signed ? "signed_field_of" : "field_of", signal->start, signal->bits);
}

/* `case`s of a page switch, pages in rising order. */
static void pages(FILE *out, const struct dbc_message *m,
                  void (*each)(FILE *out, const struct dbc_signal *signal, const char *indent))
{
    for (unsigned page = 0; page < 256; page++) {
        bool open = false;
        for (size_t i = 0; i < m->signal_count; i++) {
            const struct dbc_signal *signal = &m->signal[i];
            if (signal->kind != DBC_PAGED || signal->page != page)
                continue;
            if (!open)
                fprintf(out, "    case %u:\n", page);
            open = true;
            each(out, signal, "        ");
        }
        if (open)
            fprintf(out, "        break;\n");
    }
}

static void define(FILE *out, const struct dbc_message *m)
{
    char lower[NAME_ROOM], upper[NAME_ROOM], text[NAME_ROOM];
    const struct dbc_signal *page = selector(m);
    snake(m->name, lower);
    shout(m->name, upper);
    fprintf(out, "\nvoid wire_%s_pack(uint8_t data[8], const struct wire_%s *m)\n{\n    uint64_t bits = 0;\n", lower,
            lower);
    for (size_t i = 0; i < m->signal_count; i++)
        if (m->signal[i].kind != DBC_PAGED)
            pack_signal(out, &m->signal[i], "    ");
    if (page) {
        fprintf(out, "    switch (field((uint32_t)m->%s, 0, %u)) {\n", snake(page->name, text), page->bits);
        pages(out, m, pack_signal);
        fprintf(out, "    default:\n        break;\n    }\n");
    }
    fprintf(out, "    store(data, bits);\n}\n");

    fprintf(out, "\nbool wire_%s_unpack(struct wire_%s *m, const uint8_t *data, uint8_t length)\n{\n", lower, lower);
    fprintf(out, "    if (length != WIRE_%s_LENGTH)\n        return false;\n", upper);
    fprintf(out, "    const uint64_t bits = load(data, WIRE_%s_LENGTH);\n", upper);
    if (page) {
        fprintf(out, "    switch (field_of(bits, %u, %u)) {\n", page->start, page->bits);
        pages(out, m, unpack_signal);
        fprintf(out, "    default:\n        return false;\n    }\n");
    }
    for (size_t i = 0; i < m->signal_count; i++)
        if (m->signal[i].kind != DBC_PAGED)
            unpack_signal(out, &m->signal[i], "    ");
    fprintf(out, "    return true;\n}\n");
}

int dbcgen_source(FILE *out, const struct dbc *dbc, struct failure *why)
{
    fprintf(out, "/* Generated by dbcgen from wire.dbc; do not edit. */\n#include \"wire.h\"\n");
    fprintf(out,
            "\n"
            "/* Bits start .. start + bits - 1 of a frame, bit 0 being the lowest of byte 0 (Intel order). */\n"
            "static uint64_t field(uint32_t value, unsigned start, unsigned bits)\n"
            "{\n"
            "    return ((uint64_t)value & ((UINT64_C(1) << bits) - 1)) << start;\n"
            "}\n"
            "\n"
            "static uint32_t field_of(uint64_t frame, unsigned start, unsigned bits)\n"
            "{\n"
            "    return (uint32_t)(frame >> start & ((UINT64_C(1) << bits) - 1));\n"
            "}\n"
            "\n"
            "static int32_t signed_field_of(uint64_t frame, unsigned start, unsigned bits)\n"
            "{\n"
            "    const uint32_t value = field_of(frame, start, bits), sign = UINT32_C(1) << (bits - 1);\n"
            "    /* two's complement without a shift of a negative number: value - 2 sign when the sign bit is set */\n"
            "    return (int32_t)((int64_t)(value ^ sign) - (int64_t)sign);\n"
            "}\n"
            "\n"
            "static void store(uint8_t data[8], uint64_t bits)\n"
            "{\n"
            "    for (unsigned i = 0; i < 8; i++) /* bound: 8 */\n"
            "        data[i] = (uint8_t)(bits >> 8 * i & 0xff);\n"
            "}\n"
            "\n"
            "static uint64_t load(const uint8_t *data, unsigned length)\n"
            "{\n"
            "    uint64_t bits = 0;\n"
            "    for (unsigned i = 0; i < length; i++) /* bound: 8, the length of a frame */\n"
            "        bits |= (uint64_t)data[i] << 8 * i;\n"
            "    return bits;\n"
            "}\n");
    fprintf(out, "\n"
                 "int32_t wire_quantise(float value, float scale, int bits, bool is_signed)\n"
                 "{\n"
                 "    const int32_t maximum = (int32_t)((UINT32_C(1) << (is_signed ? bits - 1 : bits)) - 1);\n"
                 "    const int32_t minimum = is_signed ? -maximum - 1 : 0;\n"
                 "    const float steps = value / scale;\n"
                 "    if (steps >= (float)maximum)\n"
                 "        return maximum;\n"
                 "    if (steps <= (float)minimum)\n"
                 "        return minimum;\n"
                 "    if (!(steps == steps))\n"
                 "        return 0;\n"
                 "    /* the conversion drops the fraction, and the difference to it is exact: below 2^24 both are "
                 "multiples of the\n"
                 "     * same power of two, above there is no fraction */\n"
                 "    const int32_t whole = (int32_t)steps;\n"
                 "    const float fraction = steps - (float)whole;\n"
                 "    return whole + (fraction >= 0.5f) - (fraction <= -0.5f);\n"
                 "}\n");
    for (size_t i = 0; i < dbc->message_count; i++)
        define(out, &dbc->message[i]);
    return finish(out, why);
}
