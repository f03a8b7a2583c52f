/* Reading a DBC text token by token. Every function does nothing once the scanner has failed, so that a caller checks once,
 * at the end of what it reads; the first failure stays (STATUS_BUS_DBC with file and line). */
#ifndef TROCAR_DBC_SCAN_H
#define TROCAR_DBC_SCAN_H

#include "dbc.h"

struct dbc_scanner {
    const char *at, *file;
    long line;
    bool failed;
    struct dbc *dbc; /* what the parser has read so far; not used here */
    struct failure *why;
};

void dbc_fail(struct dbc_scanner *s, const char *cause, ...) __attribute__((format(printf, 2, 3)));

void dbc_skip_space(struct dbc_scanner *s);
/* Length of the word (letters, digits, '_', not a digit first) at `at`; 0 for none. */
size_t dbc_word_length(const char *at);

/* Take what stands next if it is this word or character; otherwise the cursor stays, line breaks included, so that an
 * error found later is reported on the line of what was read last. */
bool dbc_accept_word(struct dbc_scanner *s, const char *word);
bool dbc_accept(struct dbc_scanner *s, char c);

void dbc_expect(struct dbc_scanner *s, char c);
/* `what` names the thing in messages. */
void dbc_name(struct dbc_scanner *s, char out[DBC_MAX_NAME + 1], const char *what);
int64_t dbc_integer(struct dbc_scanner *s, int64_t minimum, int64_t maximum, const char *what);
double dbc_real(struct dbc_scanner *s, const char *what);
/* A string in quotes; it may run over lines, as DBC allows. */
void dbc_string(struct dbc_scanner *s, char *out, size_t room, const char *what);

#endif
