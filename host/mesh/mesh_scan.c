#include "mesh_scan.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct scan scan_start(const char *path, const unsigned char *bytes, size_t length, struct failure *why)
{
    return (struct scan){.path = path, .bytes = bytes, .length = length, .line = 1, .why = why};
}

static int fail(struct scan *s, enum status status, const char *remedy, const char *cause, va_list arguments)
{
    char text[sizeof s->why->cause], place[sizeof s->why->place];
    vsnprintf(text, sizeof text, cause, arguments);
    if (!s->binary)
        return failure_at(s->why, status, s->path, s->line, remedy, "%s", text);
    snprintf(place, sizeof place, "%.260s: byte %zu", s->path, s->at);
    return failure_set(s->why, status, place, remedy, "%s", text);
}

int scan_fail(struct scan *s, enum status status, const char *cause, ...)
{
    va_list arguments;
    va_start(arguments, cause);
    int result = fail(s, status, NULL, cause, arguments);
    va_end(arguments);
    return result;
}

int scan_fail_remedy(struct scan *s, enum status status, const char *remedy, const char *cause, ...)
{
    va_list arguments;
    va_start(arguments, cause);
    int result = fail(s, status, remedy, cause, arguments);
    va_end(arguments);
    return result;
}

static bool is_blank(unsigned char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

static bool ends_token(unsigned char c)
{
    return is_blank(c) || c == '\n' || c == 0;
}

bool scan_more_on_line(struct scan *s)
{
    while (s->at < s->length && is_blank(s->bytes[s->at]))
        s->at++;
    if (s->at < s->length && s->comment && s->bytes[s->at] == (unsigned char)s->comment)
        while (s->at < s->length && s->bytes[s->at] != '\n')
            s->at++;
    return s->at < s->length && s->bytes[s->at] != '\n';
}

void scan_next_line(struct scan *s)
{
    while (s->at < s->length && s->bytes[s->at] != '\n')
        s->at++;
    if (s->at < s->length) {
        s->at++;
        s->line++;
    }
}

bool scan_skip(struct scan *s)
{
    while (!scan_more_on_line(s)) {
        if (s->at >= s->length)
            return false;
        s->at++;
        s->line++;
    }
    return true;
}

size_t scan_peek(struct scan *s, const char **token)
{
    *token = "";
    if (!scan_skip(s))
        return 0;
    size_t end = s->at;
    while (end < s->length && !ends_token(s->bytes[end]))
        end++;
    if (end == s->at) /* a NUL in a text file: a token of its own, so that every loop advances */
        end++;
    *token = (const char *)s->bytes + s->at;
    return end - s->at;
}

bool scan_accept(struct scan *s, const char *word)
{
    const char *token;
    size_t n = scan_peek(s, &token);
    if (n != strlen(word) || memcmp(token, word, n) != 0)
        return false;
    s->at += n;
    return true;
}

int scan_word(struct scan *s, char *word, size_t room, const char *what)
{
    const char *token;
    size_t n = scan_peek(s, &token);
    if (n == 0)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the file ends where %s should follow", what);
    size_t kept = n < room - 1 ? n : room - 1;
    memcpy(word, token, kept);
    word[kept] = 0;
    s->at += n;
    return STATUS_OK;
}

static int not_a_number(struct scan *s, const char *what)
{
    const char *token;
    size_t n = scan_peek(s, &token);
    if (n == 0)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the file ends where %s should follow", what);
    return scan_fail(s, STATUS_MESH_SYNTAX, "\"%.*s\" stands where %s should", (int)(n < 30 ? n : 30), token, what);
}

/* A part of a file (XML) ends before the byte that stops the number. */
static bool ends_number(const struct scan *s, size_t n, char next)
{
    return n > 0 && s->at + n <= s->length &&
           (s->at + n == s->length || ends_token((unsigned char)next) || next == ',');
}

int scan_double(struct scan *s, double *value, const char *what)
{
    if (!scan_skip(s))
        return not_a_number(s, what);
    const char *start = (const char *)s->bytes + s->at;
    char *end;
    double x = strtod(start, &end);
    size_t n = (size_t)(end - start);
    if (!ends_number(s, n, *end) || memchr(start, 'x', n))
        return not_a_number(s, what);
    if (!isfinite(x))
        return scan_fail(s, STATUS_MESH_NONFINITE, "%s is %.*s", what, (int)(n < 30 ? n : 30), start);
    s->at += n;
    *value = x;
    return STATUS_OK;
}

int scan_integer(struct scan *s, int64_t lowest, int64_t highest, int64_t *value, const char *what)
{
    if (!scan_skip(s))
        return not_a_number(s, what);
    const char *start = (const char *)s->bytes + s->at;
    char *end;
    errno = 0;
    long long x = strtoll(start, &end, 10);
    size_t n = (size_t)(end - start);
    if (!ends_number(s, n, *end))
        return not_a_number(s, what);
    if (errno == ERANGE || x < lowest || x > highest)
        return scan_fail(s, STATUS_MESH_SYNTAX, "%s is %.*s, out of its range", what, (int)(n < 30 ? n : 30), start);
    s->at += n;
    *value = x;
    return STATUS_OK;
}

int scan_fits(struct scan *s, uint64_t count, size_t bytes_each, const char *what)
{
    size_t left = s->length - s->at;
    if (count > left / bytes_each + 1) /* + 1: the last line may lack its end */
        return scan_fail(s, STATUS_MESH_SYNTAX, "the file announces %llu %s, but only %zu bytes follow",
                         (unsigned long long)count, what, left);
    return STATUS_OK;
}

int scan_count(struct scan *s, size_t bytes_each, size_t *count, const char *what)
{
    int64_t n;
    char text[80];
    snprintf(text, sizeof text, "the number of %s", what);
    int status = scan_integer(s, 0, UINT32_MAX - 1, &n, text);
    if (status == STATUS_OK)
        status = scan_fits(s, (uint64_t)n, bytes_each, what);
    *count = status ? 0 : (size_t)n;
    return status;
}

int scan_bytes(struct scan *s, void *to, size_t size, const char *what)
{
    if (size > s->length - s->at)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the file ends inside %s", what);
    memcpy(to, s->bytes + s->at, size);
    s->at += size;
    return STATUS_OK;
}

void swap_bytes(void *number, size_t size)
{
    unsigned char *b = number;
    for (size_t i = 0; i < size / 2; i++) {
        unsigned char t = b[i];
        b[i] = b[size - 1 - i];
        b[size - 1 - i] = t;
    }
}

static int number(struct scan *s, void *to, size_t size, const char *what)
{
    int status = scan_bytes(s, to, size, what);
    if (status == STATUS_OK && s->swap)
        swap_bytes(to, size);
    return status;
}

int scan_i32(struct scan *s, int32_t *value, const char *what)
{
    return number(s, value, sizeof *value, what);
}

int scan_u64(struct scan *s, uint64_t *value, const char *what)
{
    return number(s, value, sizeof *value, what);
}

static int keep_finite(struct scan *s, double value, size_t size, const char *what)
{
    if (isfinite(value))
        return STATUS_OK;
    s->at -= size;
    return scan_fail(s, STATUS_MESH_NONFINITE, "%s is not finite", what);
}

int scan_f32(struct scan *s, double *value, const char *what)
{
    float x;
    int status = number(s, &x, sizeof x, what);
    if (status)
        return status;
    *value = (double)x;
    return keep_finite(s, *value, sizeof x, what);
}

int scan_f64(struct scan *s, double *value, const char *what)
{
    int status = number(s, value, sizeof *value, what);
    return status ? status : keep_finite(s, *value, sizeof *value, what);
}
