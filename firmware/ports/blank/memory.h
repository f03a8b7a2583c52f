/* The four functions that a C compiler may call in freestanding code by itself, for copies and clears of structs (GCC
 * manual, "Language Standards Supported by GCC"). A port without a C library needs them; a port with one leaves this file
 * out. Compile with -fno-tree-loop-distribute-patterns, or the compiler turns the loops into calls of themselves. */
#ifndef TROCAR_MEMORY_H
#define TROCAR_MEMORY_H

#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t length);
void *memmove(void *to, const void *from, size_t length);
void *memset(void *to, int byte, size_t length);
int memcmp(const void *a, const void *b, size_t length);

#endif
