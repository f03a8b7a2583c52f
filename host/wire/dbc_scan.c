#include "dbc_scan.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

void dbc_fail(struct dbc_scanner *s, const char *cause, ...)
{
    if (s->failed)
        return;
    char text[sizeof s->why->cause];
    va_list arguments;
    va_start(arguments, cause);
    vsnprintf(text, sizeof text, cause, arguments);
    va_end(arguments);
    s->failed = true;
    failure_at(s->why, STATUS_BUS_DBC, s->file, s->line, "", "%s", text);
}

void dbc_skip_space(struct dbc_scanner *s)
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

size_t dbc_word_length(const char *at)
{
    size_t n = 0;
    if (isdigit((unsigned char)*at))
        return 0;
    while (is_word(at[n]))
        n++;
    return n;
}

bool dbc_accept_word(struct dbc_scanner *s, const char *word)
{
    if (s->failed)
        return false;
    const struct dbc_scanner start = *s;
    dbc_skip_space(s);
    const size_t n = strlen(word);
    if (dbc_word_length(s->at) == n && strncmp(s->at, word, n) == 0) {
        s->at += n;
        return true;
    }
    *s = start;
    return false;
}

bool dbc_accept(struct dbc_scanner *s, char c)
{
    if (s->failed)
        return false;
    const struct dbc_scanner start = *s;
    dbc_skip_space(s);
    if (*s->at == c) {
        s->at++;
        return true;
    }
    *s = start;
    return false;
}

void dbc_expect(struct dbc_scanner *s, char c)
{
    if (s->failed || dbc_accept(s, c))
        return;
    dbc_skip_space(s);
    const int seen = (unsigned char)*s->at;
    if (seen == '\0')
        dbc_fail(s, "'%c' is expected, but the file ends", c);
    else
        dbc_fail(s, "'%c' is expected before '%c'", c, isprint(seen) ? seen : '?');
}

void dbc_name(struct dbc_scanner *s, char out[DBC_MAX_NAME + 1], const char *what)
{
    out[0] = '\0';
    if (s->failed)
        return;
    dbc_skip_space(s);
    const size_t n = dbc_word_length(s->at);
    if (n == 0) {
        dbc_fail(s, "the name of a %s is expected", what);
    } else if (n > DBC_MAX_NAME) {
        dbc_fail(s, "the name of a %s has %zu characters, more than %d", what, n, DBC_MAX_NAME);
    } else {
        memcpy(out, s->at, n);
        out[n] = '\0';
        s->at += n;
    }
}

int64_t dbc_integer(struct dbc_scanner *s, int64_t minimum, int64_t maximum, const char *what)
{
    if (s->failed)
        return 0;
    dbc_skip_space(s);
    char *end;
    errno = 0;
    const long long value = strtoll(s->at, &end, 10);
    if (end == s->at)
        dbc_fail(s, "a whole number is expected as %s", what);
    else if (errno || value < minimum || value > maximum)
        dbc_fail(s, "%s is %.*s, not in %" PRId64 "..%" PRId64, what, (int)(end - s->at < 40 ? end - s->at : 40), s->at,
                 minimum, maximum);
    s->at = end;
    return s->failed ? 0 : value;
}

double dbc_real(struct dbc_scanner *s, const char *what)
{
    if (s->failed)
        return 0;
    dbc_skip_space(s);
    /* strtod would also take "inf", "nan" and hexadecimal, which DBC has not */
    const size_t n = strspn(s->at, "+-.0123456789eE");
    char *end;
    const double value = strtod(s->at, &end);
    if (n == 0 || end != s->at + n || !isfinite(value))
        dbc_fail(s, "a number is expected as %s", what);
    s->at += n;
    return s->failed ? 0 : value;
}

void dbc_string(struct dbc_scanner *s, char *out, size_t room, const char *what)
{
    dbc_expect(s, '"');
    out[0] = '\0';
    size_t n = 0;
    const long start = s->line;
    while (!s->failed && *s->at != '"') {
        if (*s->at == '\0') {
            s->line = start;
            dbc_fail(s, "the string of %s is not closed", what);
        } else if (n + 1 >= room) {
            dbc_fail(s, "the string of %s has more than %zu characters", what, room - 1);
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
