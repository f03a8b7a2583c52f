/* A bounded cursor over a file in memory: text tokens with line numbers, binary numbers of either byte order. Every
 * function stays within [0, length); every error names the file and the line (text) or the byte (binary).
 *
 * `bytes` must be followed by one NUL (file_load does so), so that strtod and strtoll stop there. */
#ifndef TROCAR_MESH_SCAN_H
#define TROCAR_MESH_SCAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "failure.h"

struct scan {
    const char *path;
    const unsigned char *bytes;
    size_t length, at;
    long line;    /* 1-based; counted while skipping */
    bool binary;  /* errors name the byte instead of the line */
    bool swap;    /* binary numbers are of the other byte order than this machine's */
    char comment; /* text from here to the end of a line is skipped; 0: none */
    struct failure *why;
};

struct scan scan_start(const char *path, const unsigned char *bytes, size_t length, struct failure *why);

int scan_fail(struct scan *s, enum status status, const char *cause, ...) __attribute__((format(printf, 3, 4)));
int scan_fail_remedy(struct scan *s, enum status status, const char *remedy, const char *cause, ...)
    __attribute__((format(printf, 4, 5)));

/* Skip white space and comments; false at the end. */
bool scan_skip(struct scan *s);
/* Skip blanks, not the line's end; true if something stands before it. */
bool scan_more_on_line(struct scan *s);
/* To the first byte of the next line. */
void scan_next_line(struct scan *s);
/* The next token (no white space in it), not consumed; length 0 at the end. */
size_t scan_peek(struct scan *s, const char **token);
/* Consume the next token if it is `word`. */
bool scan_accept(struct scan *s, const char *word);
/* Consume the next token, copied (cut to fit), or fail. */
int scan_word(struct scan *s, char *word, size_t room, const char *what);
/* A finite number; `what` names it in the error. */
int scan_double(struct scan *s, double *value, const char *what);
int scan_integer(struct scan *s, int64_t lowest, int64_t highest, int64_t *value, const char *what);
/* A count of things of which each needs at least `bytes_each` more bytes in this file: what is allocated for it is
 * bounded by the file's length. */
int scan_count(struct scan *s, size_t bytes_each, size_t *count, const char *what);
int scan_fits(struct scan *s, uint64_t count, size_t bytes_each, const char *what);

/* Binary numbers at the cursor. */
int scan_bytes(struct scan *s, void *to, size_t size, const char *what);
int scan_i32(struct scan *s, int32_t *value, const char *what);
int scan_u64(struct scan *s, uint64_t *value, const char *what);
int scan_f32(struct scan *s, double *value, const char *what); /* finite */
int scan_f64(struct scan *s, double *value, const char *what); /* finite */

/* Reverse the bytes of a 2-, 4- or 8-byte number in place. */
void swap_bytes(void *number, size_t size);

#endif
