#include "memory.h"

void *memcpy(void *restrict to, const void *restrict from, size_t length)
{
    unsigned char *t = to;
    const unsigned char *f = from;
    for (size_t i = 0; i < length; i++) /* bound: length */
        t[i] = f[i];
    return to;
}

void *memmove(void *to, const void *from, size_t length)
{
    unsigned char *t = to;
    const unsigned char *f = from;
    if (t < f)
        for (size_t i = 0; i < length; i++) /* bound: length */
            t[i] = f[i];
    else
        for (size_t i = length; i > 0; i--) /* bound: length */
            t[i - 1] = f[i - 1];
    return to;
}

void *memset(void *to, int byte, size_t length)
{
    unsigned char *t = to;
    for (size_t i = 0; i < length; i++) /* bound: length */
        t[i] = (unsigned char)byte;
    return to;
}

int memcmp(const void *a, const void *b, size_t length)
{
    const unsigned char *x = a, *y = b;
    for (size_t i = 0; i < length; i++) /* bound: length */
        if (x[i] != y[i])
            return x[i] < y[i] ? -1 : 1;
    return 0;
}
