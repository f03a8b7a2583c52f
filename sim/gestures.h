/* The gestures that come with the program, as the text that a user's file would hold. */
#ifndef TROCAR_GESTURES_H
#define TROCAR_GESTURES_H

#include <stddef.h>

/* Text of the built-in gesture, NULL for a name that is not known. */
const char *gesture_builtin(const char *name);
const char *gesture_builtin_name(size_t index); /* NULL past the end */

#endif
