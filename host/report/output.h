/* What stands at a path before a result is written there, so that -o never costs a user an input or a stranger's file. */
#ifndef TROCAR_OUTPUT_H
#define TROCAR_OUTPUT_H

#include <stdbool.h>
#include <stddef.h>

#include "failure.h"

/* First bytes of the file at `path`, up to `room`, and how many: FILE_OPEN when it is not there, not readable, or a folder;
 * FILE_READ. */
int file_head(const char *path, char *head, size_t room, size_t *length, struct failure *why);

/* FILE_WRITE when `output` is the file `input` (device and inode, so also by another name or a link). */
int output_is_not_input(const char *output, const char *input, struct failure *why);

/* FILE_WRITE when a regular file at `output` is neither empty nor begins with one of `marks` (NULL-terminated list): it is no
 * earlier result. `kind` for the message: "a bank". What is not a regular file is file_begin's to refuse. */
int output_may_replace(const char *output, const char *const *marks, const char *kind, struct failure *why);

#endif
