/* What the start-up wants to know of this board: which memory there is, and that an emulator listens. */
#include "ports/arm/armv7m.h"
#include "ports/arm/semihosting.h"
#include "ports/arm/start.h"

/* Of an500.ld: places, not values. */
extern const uint32_t memory_guard[], memory_bank[];

void port_start(void)
{
    armv7m_protect(0, (const void *)0, 22, ARMV7M_CODE);
    armv7m_protect(1, memory_guard, 22, ARMV7M_WRITE);
    armv7m_protect(2, memory_bank, 24, ARMV7M_READ);
    armv7m_protect(3, memory_guard, 12, ARMV7M_NOTHING);
    armv7m_caches_on(); /* the emulator has none, but their registers */
    armv7m_protect_on();
}

_Noreturn void port_end(int code)
{
    semihosting_exit(code);
}

_Noreturn void port_fault(const struct armv7m_fault *f)
{
    semihosting_print("controller: fault");
    if (f->stack_overflow)
        semihosting_print(" stack=overflow");
    else
        semihosting_print_register(" pc=", f->pc);
    semihosting_print_register(" cfsr=", f->cfsr);
    semihosting_print_register(" hfsr=", f->hfsr);
    semihosting_print_register(" mmfar=", f->mmfar);
    semihosting_print_register(" bfar=", f->bfar);
    semihosting_print("\n");
    semihosting_exit(START_FAULT_EXIT);
}
