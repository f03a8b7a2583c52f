/* How a driver reaches the 32-bit registers of its device: by these two functions and no other way. On a target they are
 * one load or store each. A test that defines SIMULATED_REGISTERS before it includes a driver brings its own, which
 * behave as the device does. */
#ifndef TROCAR_REGISTERS_H
#define TROCAR_REGISTERS_H

#include <stdint.h>

#ifdef SIMULATED_REGISTERS
uint32_t register_read(const volatile uint32_t *address);
void register_write(volatile uint32_t *address, uint32_t value);
#else
static inline uint32_t register_read(const volatile uint32_t *address)
{
    return *address;
}

static inline void register_write(volatile uint32_t *address, uint32_t value)
{
    *address = value;
}
#endif

#endif
