/* The tests' random numbers: splitmix64, seeded by TROCAR_SEED or a fixed number, printed as a TAP comment. */
#ifndef TROCAR_TEST_RANDOM_H
#define TROCAR_TEST_RANDOM_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

static uint64_t random_state;

static inline void random_seed(const char *what, uint64_t fallback)
{
    const char *given = getenv("TROCAR_SEED");
    random_state = given ? strtoull(given, NULL, 0) : fallback;
    printf("# %s: seed %llu\n", what, (unsigned long long)random_state);
}

static inline uint64_t random_bits(void)
{
    uint64_t z = random_state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

static inline double random_unit(void) /* [0, 1) */
{
    return (double)(random_bits() >> 11) * 0x1p-53;
}

static inline double random_range(double low, double high)
{
    return low + (high - low) * random_unit();
}

static inline unsigned random_below(unsigned n)
{
    return (unsigned)(random_bits() % n);
}

#endif
