#include "dbc.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "progress.h"

/* A cursor in the text; `failed` makes every later step a no-op, so that callers check once. */
struct scanner {
    const char *at, *file;
    long line;
    bool failed;
    struct dbc *dbc;
    struct failure *why;
};

#define FAIL(s, ...)                                                                                                   \
    do {                                                                                                               \
        if (!(s)->failed) {                                                                                            \
            (s)->failed = true;                                                                                        \
            failure_at((s)->why, STATUS_BUS_DBC, (s)->file, (s)->line, "", __VA_ARGS__);                               \
        }                                                                                                              \
    } while (0)

static void skip_space(struct scanner *s)
{
    while (isspace((unsigned char)*s->at)) {
        if (*s->at == '\n')
            s->line++;
        s->at++;
    }
}

static bool is_word(char c)
{
    return isalnum((unsigned char)c) || c == '_';
}

/* Length of the word (C identifier) at the cursor, 0 for none. */
static size_t word_length(const char *at)
{
    size_t n = 0;
    if (isdigit((unsigned char)*at))
        return 0;
    while (is_word(at[n]))
        n++;
    return n;
}

/* Take what stands next if it is this word or character; otherwise the cursor stays, line breaks included, so that an
 * error found later is reported on the line of what was read last. */
static bool accept_word(struct scanner *s, const char *word)
{
    if (s->failed)
        return false;
    const struct scanner start = *s;
    skip_space(s);
    const size_t n = strlen(word);
    if (word_length(s->at) == n && strncmp(s->at, word, n) == 0) {
        s->at += n;
        return true;
    }
    *s = start;
    return false;
}

static bool accept(struct scanner *s, char c)
{
    if (s->failed)
        return false;
    const struct scanner start = *s;
    skip_space(s);
    if (*s->at == c) {
        s->at++;
        return true;
    }
    *s = start;
    return false;
}

static void expect(struct scanner *s, char c)
{
    if (s->failed || accept(s, c))
        return;
    skip_space(s);
    const int seen = (unsigned char)*s->at;
    if (seen == '\0')
        FAIL(s, "'%c' is expected, but the file ends", c);
    else
        FAIL(s, "'%c' is expected before '%c'", c, isprint(seen) ? seen : '?');
}

static void name(struct scanner *s, char out[DBC_MAX_NAME + 1], const char *what)
{
    out[0] = '\0';
    if (s->failed)
        return;
    skip_space(s);
    const size_t n = word_length(s->at);
    if (n == 0) {
        FAIL(s, "the name of a %s is expected", what);
    } else if (n > DBC_MAX_NAME) {
        FAIL(s, "the name of a %s has %zu characters, more than %d", what, n, DBC_MAX_NAME);
    } else {
        memcpy(out, s->at, n);
        out[n] = '\0';
        s->at += n;
    }
}

static int64_t integer(struct scanner *s, int64_t minimum, int64_t maximum, const char *what)
{
    if (s->failed)
        return 0;
    skip_space(s);
    char *end;
    errno = 0;
    const long long value = strtoll(s->at, &end, 10);
    if (end == s->at)
        FAIL(s, "a whole number is expected as %s", what);
    else if (errno || value < minimum || value > maximum)
        FAIL(s, "%s is %.*s, not in %" PRId64 "..%" PRId64, what, (int)(end - s->at < 40 ? end - s->at : 40), s->at,
             minimum, maximum);
    s->at = end;
    return s->failed ? 0 : value;
}

static double real(struct scanner *s, const char *what)
{
    if (s->failed)
        return 0;
    skip_space(s);
    /* strtod would also take "inf", "nan" and hexadecimal, which DBC has not */
    const size_t n = strspn(s->at, "+-.0123456789eE");
    char *end;
    const double value = strtod(s->at, &end);
    if (n == 0 || end != s->at + n || !isfinite(value))
        FAIL(s, "a number is expected as %s", what);
    s->at += n;
    return s->failed ? 0 : value;
}

/* A string in quotes; it may run over lines, as DBC allows. */
static void string(struct scanner *s, char *out, size_t room, const char *what)
{
    expect(s, '"');
    out[0] = '\0';
    size_t n = 0;
    const long start = s->line;
    while (!s->failed && *s->at != '"') {
        if (*s->at == '\0') {
            s->line = start;
            FAIL(s, "the string of %s is not closed", what);
        } else if (n + 1 >= room) {
            FAIL(s, "the string of %s has more than %zu characters", what, room - 1);
        } else {
            if (*s->at == '\n')
                s->line++;
            out[n++] = *s->at++;
        }
    }
    out[s->failed ? 0 : n] = '\0';
    if (!s->failed)
        s->at++;
}

static unsigned node(struct scanner *s, const char *what)
{
    char text[DBC_MAX_NAME + 1];
    name(s, text, what);
    for (size_t i = 0; !s->failed && i < s->dbc->node_count; i++)
        if (strcmp(s->dbc->node[i], text) == 0)
            return (unsigned)i;
    FAIL(s, "%s %s is not among the nodes of BU_", what, text);
    return 0;
}

static struct dbc_message *message(struct scanner *s)
{
    const uint32_t id = (uint32_t)integer(s, 0, 0x7ff, "the identifier");
    for (size_t i = 0; !s->failed && i < s->dbc->message_count; i++)
        if (s->dbc->message[i].id == id)
            return &s->dbc->message[i];
    FAIL(s, "no message has the identifier %" PRIu32, id);
    return NULL;
}

static struct dbc_signal *find_signal(struct dbc_message *m, const char *text)
{
    for (size_t i = 0; i < m->signal_count; i++)
        if (strcmp(m->signal[i].name, text) == 0)
            return &m->signal[i];
    return NULL;
}

static struct dbc_signal *signal_of(struct scanner *s, struct dbc_message *m)
{
    char text[DBC_MAX_NAME + 1];
    name(s, text, "signal");
    if (s->failed)
        return NULL;
    struct dbc_signal *signal = find_signal(m, text);
    if (!signal)
        FAIL(s, "message %s has no signal %s", m->name, text);
    return signal;
}

static bool meet(const struct dbc_signal *a, const struct dbc_signal *b)
{
    if (a->kind == DBC_PAGED && b->kind == DBC_PAGED && a->page != b->page)
        return false;
    return a->start < b->start + b->bits && b->start < a->start + a->bits;
}

static void check_signal(struct scanner *s, const struct dbc_message *m, const struct dbc_signal *signal)
{
    if (signal->start + signal->bits > 8 * m->length)
        FAIL(s, "signal %s ends at bit %u, beyond the %u bytes of %s", signal->name, signal->start + signal->bits - 1,
             m->length, m->name);
    if (signal->factor == 0)
        FAIL(s, "the factor of signal %s is 0", signal->name);
    const double low = signal->is_signed ? -ldexp(1, (int)signal->bits - 1) : 0;
    const double high = ldexp(1, (int)signal->bits - (signal->is_signed ? 1 : 0)) - 1;
    const double a = low * signal->factor + signal->offset, b = high * signal->factor + signal->offset;
    const double half_step = fabs(signal->factor) / 2;
    if (signal->minimum > signal->maximum || signal->minimum < fmin(a, b) - half_step ||
        signal->maximum > fmax(a, b) + half_step)
        FAIL(s, "the range of signal %s is [%g|%g], but its bits hold [%g|%g]", signal->name, signal->minimum,
             signal->maximum, fmin(a, b), fmax(a, b));
    for (size_t i = 0; i < m->signal_count; i++) {
        const struct dbc_signal *other = &m->signal[i];
        if (strcmp(other->name, signal->name) == 0)
            FAIL(s, "message %s has two signals %s", m->name, signal->name);
        if (meet(other, signal))
            FAIL(s, "signals %s and %s of %s overlap", other->name, signal->name, m->name);
        if (other->kind == DBC_SELECTOR && signal->kind == DBC_SELECTOR)
            FAIL(s, "message %s has two page selectors", m->name);
    }
}

/* The M or mN between the name and the colon. */
static void multiplexing(struct scanner *s, struct dbc_signal *signal)
{
    signal->kind = DBC_ALWAYS;
    if (accept(s, 'M')) {
        signal->kind = DBC_SELECTOR;
    } else if (accept(s, 'm')) {
        signal->kind = DBC_PAGED;
        signal->page = (unsigned)integer(s, 0, 255, "the page");
    }
}

static void read_signal(struct scanner *s, struct dbc_message *m)
{
    if (m->signal_count == DBC_MAX_SIGNALS) {
        FAIL(s, "message %s has more than %d signals", m->name, DBC_MAX_SIGNALS);
        return;
    }
    struct dbc_signal *signal = &m->signal[m->signal_count];
    name(s, signal->name, "signal");
    signal->line = s->line;
    multiplexing(s, signal);
    expect(s, ':');
    signal->start = (unsigned)integer(s, 0, 63, "the start bit");
    expect(s, '|');
    signal->bits = (unsigned)integer(s, 1, 32, "the number of bits");
    expect(s, '@');
    if (accept(s, '0'))
        FAIL(s, "signal %s has Motorola byte order (@0), only Intel (@1) is understood", signal->name);
    expect(s, '1');
    signal->is_signed = accept(s, '-');
    if (!signal->is_signed)
        expect(s, '+');
    expect(s, '(');
    signal->factor = real(s, "the factor");
    expect(s, ',');
    signal->offset = real(s, "the offset");
    expect(s, ')');
    expect(s, '[');
    signal->minimum = real(s, "the minimum");
    expect(s, '|');
    signal->maximum = real(s, "the maximum");
    expect(s, ']');
    string(s, signal->unit, sizeof signal->unit, "a unit");
    do
        signal->receivers |= 1u << node(s, "receiver");
    while (accept(s, ','));
    if (!s->failed)
        check_signal(s, m, signal);
    if (!s->failed)
        m->signal_count++;
}

/* What can be judged only when all signals of a message are known. */
static void check_pages(struct scanner *s, const struct dbc_message *m)
{
    const long end = s->line;
    const struct dbc_signal *selector = NULL;
    for (size_t i = 0; i < m->signal_count; i++)
        if (m->signal[i].kind == DBC_SELECTOR)
            selector = &m->signal[i];
    if (selector)
        s->line = selector->line;
    if (selector && selector->is_signed)
        FAIL(s, "the page selector %s of %s is signed", selector->name, m->name);
    for (size_t i = 0; i < m->signal_count; i++) {
        const struct dbc_signal *signal = &m->signal[i];
        if (signal->kind != DBC_PAGED)
            continue;
        s->line = signal->line;
        if (!selector)
            FAIL(s, "signal %s of %s is on a page, but no signal selects one", signal->name, m->name);
        else if (selector->bits < 32 && signal->page >> selector->bits)
            FAIL(s, "signal %s of %s is on page %u, which the %u bits of %s cannot hold", signal->name, m->name,
                 signal->page, selector->bits, selector->name);
    }
    s->line = end;
}

static void read_message(struct scanner *s)
{
    if (s->dbc->message_count == DBC_MAX_MESSAGES) {
        FAIL(s, "there are more than %d messages", DBC_MAX_MESSAGES);
        return;
    }
    struct dbc_message *m = &s->dbc->message[s->dbc->message_count];
    m->id = (uint32_t)integer(s, 0, 0x7ff, "the identifier");
    m->line = s->line;
    name(s, m->name, "message");
    expect(s, ':');
    m->length = (unsigned)integer(s, 0, 8, "the length");
    m->sender = node(s, "sender");
    for (size_t i = 0; !s->failed && i < s->dbc->message_count; i++) {
        if (s->dbc->message[i].id == m->id)
            FAIL(s, "%s and %s have the same identifier %" PRIu32, s->dbc->message[i].name, m->name, m->id);
        else if (strcmp(s->dbc->message[i].name, m->name) == 0)
            FAIL(s, "two messages have the name %s", m->name);
    }
    if (s->failed)
        return;
    s->dbc->message_count++;
    while (accept_word(s, "SG_"))
        read_signal(s, m);
    check_pages(s, m);
}

static void read_nodes(struct scanner *s)
{
    expect(s, ':');
    if (s->dbc->node_count)
        FAIL(s, "BU_ is given twice");
    for (;;) {
        skip_space(s);
        const size_t n = word_length(s->at);
        /* the next section also starts with a word, but none of its keywords can name a node: they end in '_' */
        if (s->failed || n == 0 || s->at[n - 1] == '_')
            return;
        if (s->dbc->node_count == DBC_MAX_NODES) {
            FAIL(s, "there are more than %d nodes", DBC_MAX_NODES);
            return;
        }
        name(s, s->dbc->node[s->dbc->node_count], "node");
        for (size_t i = 0; !s->failed && i < s->dbc->node_count; i++)
            if (strcmp(s->dbc->node[i], s->dbc->node[s->dbc->node_count]) == 0)
                FAIL(s, "node %s is listed twice", s->dbc->node[i]);
        s->dbc->node_count++;
    }
}

static void read_comment(struct scanner *s)
{
    char text[DBC_MAX_COMMENT + 1];
    char *into = s->dbc->comment;
    if (accept_word(s, "BO_")) {
        struct dbc_message *m = message(s);
        into = m ? m->comment : text;
    } else if (accept_word(s, "SG_")) {
        struct dbc_message *m = message(s);
        if (m)
            signal_of(s, m);
        into = text;
    }
    string(s, into, sizeof text, "a comment");
    expect(s, ';');
}

static void read_values(struct scanner *s)
{
    struct dbc_message *m = message(s);
    struct dbc_signal *signal = m ? signal_of(s, m) : NULL;
    while (!s->failed && !accept(s, ';')) {
        if (signal->value_count == DBC_MAX_VALUES) {
            FAIL(s, "signal %s has more than %d named values", signal->name, DBC_MAX_VALUES);
            return;
        }
        struct dbc_value *value = &signal->value[signal->value_count++];
        value->raw = integer(s, INT32_MIN, UINT32_MAX, "a value");
        string(s, value->name, sizeof value->name, "a value");
    }
}

static void read_symbols(struct scanner *s)
{
    expect(s, ':');
    for (;;) {
        skip_space(s);
        const size_t n = word_length(s->at);
        if (s->failed || n == 0 || (n == 3 && strncmp(s->at, "BS_", 3) == 0))
            return;
        s->at += n;
    }
}

static void read_section(struct scanner *s)
{
    char text[DBC_MAX_COMMENT + 1];
    if (accept_word(s, "VERSION")) {
        string(s, text, sizeof text, "the version");
    } else if (accept_word(s, "NS_")) {
        read_symbols(s);
    } else if (accept_word(s, "BS_")) {
        expect(s, ':');
    } else if (accept_word(s, "BU_")) {
        read_nodes(s);
    } else if (accept_word(s, "BO_")) {
        read_message(s);
    } else if (accept_word(s, "CM_")) {
        read_comment(s);
    } else if (accept_word(s, "VAL_")) {
        read_values(s);
    } else if (accept_word(s, "SG_")) {
        FAIL(s, "a signal stands outside a message");
    } else {
        const int n = (int)strcspn(s->at, " \t\r\n:;");
        FAIL(s, "'%.*s' is not a keyword of the subset that is understood", n < 32 ? n : 32, s->at);
    }
}

int dbc_parse(const char *text, const char *file, struct dbc **out, struct failure *why)
{
    *out = NULL;
    struct dbc *dbc = calloc(1, sizeof *dbc);
    if (!dbc)
        return failure_set(why, STATUS_MEMORY, file, "", "no memory for the protocol");
    struct scanner s = {.at = text, .file = file, .line = 1, .dbc = dbc, .why = why};
    for (skip_space(&s); !s.failed && *s.at; skip_space(&s))
        read_section(&s);
    if (!s.failed && dbc->message_count == 0)
        FAIL(&s, "there is no message");
    if (s.failed) {
        free(dbc);
        return STATUS_BUS_DBC;
    }
    *out = dbc;
    return STATUS_OK;
}

int dbc_read(const char *path, struct dbc **out, struct failure *why)
{
    unsigned char *bytes = NULL;
    size_t length = 0;
    *out = NULL;
    const int status = file_load(path, &bytes, &length, why);
    if (status < 0)
        return status;
    int result;
    if (memchr(bytes, '\0', length))
        result = failure_set(why, STATUS_BUS_DBC, path, "", "the file has a NUL byte, it is not a text");
    else
        result = dbc_parse((const char *)bytes, path, out, why);
    free(bytes);
    return result;
}

void dbc_free(struct dbc *dbc)
{
    free(dbc);
}
