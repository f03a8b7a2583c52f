#include "dbc.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dbc_scan.h"
#include "progress.h"

static unsigned node(struct dbc_scanner *s, const char *what)
{
    char text[DBC_MAX_NAME + 1];
    dbc_name(s, text, what);
    for (size_t i = 0; !s->failed && i < s->dbc->node_count; i++)
        if (strcmp(s->dbc->node[i], text) == 0)
            return (unsigned)i;
    dbc_fail(s, "%s %s is not among the nodes of BU_", what, text);
    return 0;
}

static struct dbc_message *message(struct dbc_scanner *s)
{
    const uint32_t id = (uint32_t)dbc_integer(s, 0, 0x7ff, "the identifier");
    for (size_t i = 0; !s->failed && i < s->dbc->message_count; i++)
        if (s->dbc->message[i].id == id)
            return &s->dbc->message[i];
    dbc_fail(s, "no message has the identifier %" PRIu32, id);
    return NULL;
}

static struct dbc_signal *find_signal(struct dbc_message *m, const char *text)
{
    for (size_t i = 0; i < m->signal_count; i++)
        if (strcmp(m->signal[i].name, text) == 0)
            return &m->signal[i];
    return NULL;
}

static struct dbc_signal *signal_of(struct dbc_scanner *s, struct dbc_message *m)
{
    char text[DBC_MAX_NAME + 1];
    dbc_name(s, text, "signal");
    if (s->failed)
        return NULL;
    struct dbc_signal *signal = find_signal(m, text);
    if (!signal)
        dbc_fail(s, "message %s has no signal %s", m->name, text);
    return signal;
}

static bool meet(const struct dbc_signal *a, const struct dbc_signal *b)
{
    if (a->kind == DBC_PAGED && b->kind == DBC_PAGED && a->page != b->page)
        return false;
    return a->start < b->start + b->bits && b->start < a->start + a->bits;
}

static void check_signal(struct dbc_scanner *s, const struct dbc_message *m, const struct dbc_signal *signal)
{
    if (signal->start + signal->bits > 8 * m->length)
        dbc_fail(s, "signal %s ends at bit %u, beyond the %u bytes of %s", signal->name,
                 signal->start + signal->bits - 1, m->length, m->name);
    if (signal->factor == 0)
        dbc_fail(s, "the factor of signal %s is 0", signal->name);
    const double low = signal->is_signed ? -ldexp(1, (int)signal->bits - 1) : 0;
    const double high = ldexp(1, (int)signal->bits - (signal->is_signed ? 1 : 0)) - 1;
    const double a = low * signal->factor + signal->offset, b = high * signal->factor + signal->offset;
    const double half_step = fabs(signal->factor) / 2;
    if (signal->minimum > signal->maximum || signal->minimum < fmin(a, b) - half_step ||
        signal->maximum > fmax(a, b) + half_step)
        dbc_fail(s, "the range of signal %s is [%g|%g], but its bits hold [%g|%g]", signal->name, signal->minimum,
                 signal->maximum, fmin(a, b), fmax(a, b));
    for (size_t i = 0; i < m->signal_count; i++) {
        const struct dbc_signal *other = &m->signal[i];
        if (strcmp(other->name, signal->name) == 0)
            dbc_fail(s, "message %s has two signals %s", m->name, signal->name);
        if (meet(other, signal))
            dbc_fail(s, "signals %s and %s of %s overlap", other->name, signal->name, m->name);
        if (other->kind == DBC_SELECTOR && signal->kind == DBC_SELECTOR)
            dbc_fail(s, "message %s has two page selectors", m->name);
    }
}

/* The M or mN between the name and the colon. */
static void multiplexing(struct dbc_scanner *s, struct dbc_signal *signal)
{
    signal->kind = DBC_ALWAYS;
    if (dbc_accept(s, 'M')) {
        signal->kind = DBC_SELECTOR;
    } else if (dbc_accept(s, 'm')) {
        signal->kind = DBC_PAGED;
        signal->page = (unsigned)dbc_integer(s, 0, 255, "the page");
    }
}

static void read_signal(struct dbc_scanner *s, struct dbc_message *m)
{
    if (m->signal_count == DBC_MAX_SIGNALS) {
        dbc_fail(s, "message %s has more than %d signals", m->name, DBC_MAX_SIGNALS);
        return;
    }
    struct dbc_signal *signal = &m->signal[m->signal_count];
    dbc_name(s, signal->name, "signal");
    signal->line = s->line;
    multiplexing(s, signal);
    dbc_expect(s, ':');
    signal->start = (unsigned)dbc_integer(s, 0, 63, "the start bit");
    dbc_expect(s, '|');
    signal->bits = (unsigned)dbc_integer(s, 1, 32, "the number of bits");
    dbc_expect(s, '@');
    if (dbc_accept(s, '0'))
        dbc_fail(s, "signal %s has Motorola byte order (@0), only Intel (@1) is understood", signal->name);
    dbc_expect(s, '1');
    signal->is_signed = dbc_accept(s, '-');
    if (!signal->is_signed)
        dbc_expect(s, '+');
    dbc_expect(s, '(');
    signal->factor = dbc_real(s, "the factor");
    dbc_expect(s, ',');
    signal->offset = dbc_real(s, "the offset");
    dbc_expect(s, ')');
    dbc_expect(s, '[');
    signal->minimum = dbc_real(s, "the minimum");
    dbc_expect(s, '|');
    signal->maximum = dbc_real(s, "the maximum");
    dbc_expect(s, ']');
    dbc_string(s, signal->unit, sizeof signal->unit, "a unit");
    do
        signal->receivers |= 1u << node(s, "receiver");
    while (dbc_accept(s, ','));
    if (!s->failed)
        check_signal(s, m, signal);
    if (!s->failed)
        m->signal_count++;
}

/* What can be judged only when all signals of a message are known. */
static void check_pages(struct dbc_scanner *s, const struct dbc_message *m)
{
    const long end = s->line;
    const struct dbc_signal *selector = NULL;
    for (size_t i = 0; i < m->signal_count; i++)
        if (m->signal[i].kind == DBC_SELECTOR)
            selector = &m->signal[i];
    if (selector)
        s->line = selector->line;
    if (selector && selector->is_signed)
        dbc_fail(s, "the page selector %s of %s is signed", selector->name, m->name);
    for (size_t i = 0; i < m->signal_count; i++) {
        const struct dbc_signal *signal = &m->signal[i];
        if (signal->kind != DBC_PAGED)
            continue;
        s->line = signal->line;
        if (!selector)
            dbc_fail(s, "signal %s of %s is on a page, but no signal selects one", signal->name, m->name);
        else if (selector->bits < 32 && signal->page >> selector->bits)
            dbc_fail(s, "signal %s of %s is on page %u, which the %u bits of %s cannot hold", signal->name, m->name,
                     signal->page, selector->bits, selector->name);
    }
    s->line = end;
}

static void read_message(struct dbc_scanner *s)
{
    if (s->dbc->message_count == DBC_MAX_MESSAGES) {
        dbc_fail(s, "there are more than %d messages", DBC_MAX_MESSAGES);
        return;
    }
    struct dbc_message *m = &s->dbc->message[s->dbc->message_count];
    m->id = (uint32_t)dbc_integer(s, 0, 0x7ff, "the identifier");
    m->line = s->line;
    dbc_name(s, m->name, "message");
    dbc_expect(s, ':');
    m->length = (unsigned)dbc_integer(s, 0, 8, "the length");
    m->sender = node(s, "sender");
    for (size_t i = 0; !s->failed && i < s->dbc->message_count; i++) {
        if (s->dbc->message[i].id == m->id)
            dbc_fail(s, "%s and %s have the same identifier %" PRIu32, s->dbc->message[i].name, m->name, m->id);
        else if (strcmp(s->dbc->message[i].name, m->name) == 0)
            dbc_fail(s, "two messages have the name %s", m->name);
    }
    if (s->failed)
        return;
    s->dbc->message_count++;
    while (dbc_accept_word(s, "SG_"))
        read_signal(s, m);
    check_pages(s, m);
}

static void read_nodes(struct dbc_scanner *s)
{
    dbc_expect(s, ':');
    if (s->dbc->node_count)
        dbc_fail(s, "BU_ is given twice");
    for (;;) {
        dbc_skip_space(s);
        const size_t n = dbc_word_length(s->at);
        /* the next section also starts with a word, but none of its keywords can name a node: they end in '_' */
        if (s->failed || n == 0 || s->at[n - 1] == '_')
            return;
        if (s->dbc->node_count == DBC_MAX_NODES) {
            dbc_fail(s, "there are more than %d nodes", DBC_MAX_NODES);
            return;
        }
        dbc_name(s, s->dbc->node[s->dbc->node_count], "node");
        for (size_t i = 0; !s->failed && i < s->dbc->node_count; i++)
            if (strcmp(s->dbc->node[i], s->dbc->node[s->dbc->node_count]) == 0)
                dbc_fail(s, "node %s is listed twice", s->dbc->node[i]);
        s->dbc->node_count++;
    }
}

static void read_comment(struct dbc_scanner *s)
{
    char text[DBC_MAX_COMMENT + 1];
    char *into = s->dbc->comment;
    if (dbc_accept_word(s, "BO_")) {
        struct dbc_message *m = message(s);
        into = m ? m->comment : text;
    } else if (dbc_accept_word(s, "SG_")) {
        struct dbc_message *m = message(s);
        if (m)
            signal_of(s, m);
        into = text;
    }
    dbc_string(s, into, sizeof text, "a comment");
    dbc_expect(s, ';');
}

static void read_values(struct dbc_scanner *s)
{
    struct dbc_message *m = message(s);
    struct dbc_signal *signal = m ? signal_of(s, m) : NULL;
    while (!s->failed && !dbc_accept(s, ';')) {
        if (signal->value_count == DBC_MAX_VALUES) {
            dbc_fail(s, "signal %s has more than %d named values", signal->name, DBC_MAX_VALUES);
            return;
        }
        struct dbc_value *value = &signal->value[signal->value_count++];
        value->raw = dbc_integer(s, INT32_MIN, UINT32_MAX, "a value");
        dbc_string(s, value->name, sizeof value->name, "a value");
    }
}

static void read_symbols(struct dbc_scanner *s)
{
    dbc_expect(s, ':');
    for (;;) {
        dbc_skip_space(s);
        const size_t n = dbc_word_length(s->at);
        if (s->failed || n == 0 || (n == 3 && strncmp(s->at, "BS_", 3) == 0))
            return;
        s->at += n;
    }
}

static void read_section(struct dbc_scanner *s)
{
    char text[DBC_MAX_COMMENT + 1];
    if (dbc_accept_word(s, "VERSION")) {
        dbc_string(s, text, sizeof text, "the version");
    } else if (dbc_accept_word(s, "NS_")) {
        read_symbols(s);
    } else if (dbc_accept_word(s, "BS_")) {
        dbc_expect(s, ':');
    } else if (dbc_accept_word(s, "BU_")) {
        read_nodes(s);
    } else if (dbc_accept_word(s, "BO_")) {
        read_message(s);
    } else if (dbc_accept_word(s, "CM_")) {
        read_comment(s);
    } else if (dbc_accept_word(s, "VAL_")) {
        read_values(s);
    } else if (dbc_accept_word(s, "SG_")) {
        dbc_fail(s, "a signal stands outside a message");
    } else {
        const int n = (int)strcspn(s->at, " \t\r\n:;");
        dbc_fail(s, "'%.*s' is not a keyword of the subset that is understood", n < 32 ? n : 32, s->at);
    }
}

int dbc_parse(const char *text, const char *file, struct dbc **out, struct failure *why)
{
    *out = NULL;
    struct dbc *dbc = calloc(1, sizeof *dbc);
    if (!dbc)
        return failure_set(why, STATUS_MEMORY, file, "", "no memory for the protocol");
    struct dbc_scanner s = {.at = text, .file = file, .line = 1, .dbc = dbc, .why = why};
    for (dbc_skip_space(&s); !s.failed && *s.at; dbc_skip_space(&s))
        read_section(&s);
    if (!s.failed && dbc->message_count == 0)
        dbc_fail(&s, "there is no message");
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
