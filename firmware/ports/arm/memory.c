/* The functions of ports/blank/memory.h, by words where both ends are aligned alike: structs of the controller are. */
#include "ports/blank/memory.h"

#include <stdint.h>

/* The compiler may not assume anything about what such a word was. */
typedef uint32_t __attribute__((may_alias)) any_word;

void *memcpy(void *restrict to, const void *restrict from, size_t length)
{
    unsigned char *t = to;
    const unsigned char *f = from;
    if ((((uintptr_t)t | (uintptr_t)f) & 3u) == 0)
        for (; length >= 4; length -= 4, t += 4, f += 4) /* bound: length / 4 */
            *(any_word *)(void *)t = *(const any_word *)(const void *)f;
    while (length-- > 0) /* bound: length, or 3 */
        *t++ = *f++;
    return to;
}

void *memmove(void *to, const void *from, size_t length)
{
    unsigned char *t = to;
    const unsigned char *f = from;
    if ((uintptr_t)t - (uintptr_t)f >= length) /* `to` is not inside of what is read later */
        return memcpy(to, from, length);
    while (length-- > 0) /* bound: length */
        t[length] = f[length];
    return to;
}

void *memset(void *to, int byte, size_t length)
{
    unsigned char *t = to;
    if (((uintptr_t)t & 3u) == 0)
        for (; length >= 4; length -= 4, t += 4) /* bound: length / 4 */
            *(any_word *)(void *)t = 0x01010101u * (unsigned char)byte;
    while (length-- > 0) /* bound: length, or 3 */
        *t++ = (unsigned char)byte;
    return to;
}

int memcmp(const void *a, const void *b, size_t length)
{
    const unsigned char *x = a, *y = b;
    for (; length > 0 && *x == *y; length--, x++, y++) { /* bound: length */
    }
    return length == 0 ? 0 : *x < *y ? -1 : 1;
}
