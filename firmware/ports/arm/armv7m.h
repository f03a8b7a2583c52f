/* Start-up of an Armv7-M processor (Cortex-M7): vector table, stacks, FPU, memory protection, faults (Armv7-M Architecture
 * Reference Manual, B1.5, B3.2.2 and B3.5). The loop runs on the process stack, handlers on one of their own.
 *
 * A port defines the functions below, and in its linker script what start.h names. */
#ifndef TROCAR_ARMV7M_H
#define TROCAR_ARMV7M_H

#include <stdbool.h>
#include <stdint.h>

/* What a region of memory may be used for. Code may be executed, nothing else. */
enum armv7m_access { ARMV7M_NOTHING, ARMV7M_CODE, ARMV7M_READ, ARMV7M_WRITE, ARMV7M_DEVICE };

/* A region of 2^log2_bytes bytes at a multiple of its size. The higher number wins where two overlap. */
void armv7m_protect(uint32_t number, const volatile void *address, uint32_t log2_bytes, enum armv7m_access access);
/* Both caches, empty at first. After the regions are set, which say what may be cached. */
void armv7m_caches_on(void);
/* From here on no other memory may be touched than that of the regions. */
void armv7m_protect_on(void);

struct armv7m_fault { /* the processor's registers of that name */
    uint32_t pc, cfsr, hfsr, mmfar, bfar;
    bool stack_overflow; /* pc could not be saved */
};

/* Of the port: after the variables are set. */
void port_start(void);
/* Of the port: what becomes of controller_main's value, and of a fault. */
_Noreturn void port_end(int code);
_Noreturn void port_fault(const struct armv7m_fault *fault);

#endif
