#include "start.h"

#include "semihosting.h"

/* Of an500.ld: places, not values. */
extern uint32_t an500_guard[], an500_stack[], an500_stack_top[], an500_handler_stack_top[];
extern uint32_t an500_data[], an500_data_end[], an500_bss[], an500_bss_end[];
extern const uint32_t an500_data_image[], an500_bank[];

#define PAINT 0xA5C3A5C3u

/* Registers of the system control space (Armv7-M Architecture Reference Manual, B3.2.2 and B3.5.4). */
#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SHCSR             REGISTER(0xE000ED24u) /* enables the memory, bus and usage fault handlers */
#define CFSR              REGISTER(0xE000ED28u)
#define HFSR              REGISTER(0xE000ED2Cu)
#define MMFAR             REGISTER(0xE000ED34u)
#define BFAR              REGISTER(0xE000ED38u)
#define CPACR             REGISTER(0xE000ED88u)
#define MPU_CTRL          REGISTER(0xE000ED94u)
#define MPU_RNR           REGISTER(0xE000ED98u)
#define MPU_RBAR          REGISTER(0xE000ED9Cu)
#define MPU_RASR          REGISTER(0xE000EDA0u)

enum {
    ACCESS_NONE = 0,
    ACCESS_WRITE = 3,
    ACCESS_READ = 6,
    EXECUTE_NEVER = 1 << 28,
    CACHED = 1 << 19 | 1 << 17 | 1 << 16, /* normal memory, write-back, allocated on read and write */
    STACKING_FAILED = 1 << 4 | 1 << 12    /* in CFSR: no frame was written */
};

/* A region of 2^log2_bytes bytes at a multiple of its size. The higher number wins where two overlap. */
static void protect(uint32_t number, const volatile void *address, uint32_t log2_bytes, uint32_t access, uint32_t more)
{
    MPU_RNR = number;
    MPU_RBAR = (uint32_t)(uintptr_t)address;
    MPU_RASR = more | CACHED | access << 24 | (log2_bytes - 1u) << 1 | 1u;
}

static void protect_memory(void)
{
    protect(0, (const void *)0, 22, ACCESS_READ, 0);
    protect(1, an500_guard, 22, ACCESS_WRITE, EXECUTE_NEVER);
    protect(2, an500_bank, 24, ACCESS_READ, EXECUTE_NEVER);
    protect(3, an500_guard, 12, ACCESS_NONE, EXECUTE_NEVER);
    MPU_CTRL = 1; /* on, and no other memory */
    SHCSR |= 7u << 16;
    __asm__ volatile("dsb\n isb" ::: "memory");
}

/* Reached on the process stack. */
__attribute__((used)) static _Noreturn void start(void)
{
    CPACR |= 15u << 20;
    __asm__ volatile("dsb\n isb" ::: "memory");
    const uint32_t *from = an500_data_image;
    for (uint32_t *to = an500_data; to != an500_data_end; to++) /* bound: initialised variables */
        *to = *from++;
    for (uint32_t *to = an500_bss; to != an500_bss_end; to++) /* bound: variables that start as 0 */
        *to = 0;
    protect_memory();
    semihosting_exit(controller_main());
}

/* Paint the loop's stack, which is not in use yet, and move onto it. */
__attribute__((naked, used)) void reset(void);
void reset(void)
{
    __asm__ volatile("ldr r0, =an500_stack\n"
                     "ldr r1, =an500_stack_top\n"
                     "ldr r2, =%c0\n"
                     "1: str r2, [r0], #4\n"
                     "cmp r0, r1\n"
                     "blo 1b\n"
                     "msr psp, r1\n"
                     "movs r0, #2\n"
                     "msr control, r0\n"
                     "isb\n"
                     "b %c1\n"
                     ".ltorg\n" ::"i"(PAINT),
                     "i"(start));
}

uint32_t start_stack_bytes(void)
{
    return (uint32_t)((uintptr_t)an500_stack_top - (uintptr_t)an500_stack);
}

uint32_t start_stack_used(void)
{
    const volatile uint32_t *lowest = an500_stack;
    while (lowest != an500_stack_top && *lowest == PAINT) /* bound: words of the stack */
        lowest++;
    return (uint32_t)((uintptr_t)an500_stack_top - (uintptr_t)lowest);
}

static void print_register(const char *name, uint32_t value)
{
    semihosting_print(name);
    semihosting_print_hexadecimal(value);
}

/* `frame`: r0-r3, r12, lr, pc, xpsr as the processor stacked them. */
__attribute__((used)) static _Noreturn void report_fault(const uint32_t *frame)
{
    uint32_t cfsr = CFSR;
    semihosting_print("controller: fault");
    if (cfsr & STACKING_FAILED)
        semihosting_print(" stack=overflow");
    else
        print_register(" pc=", frame[6]);
    print_register(" cfsr=", cfsr);
    print_register(" hfsr=", HFSR);
    print_register(" mmfar=", MMFAR);
    print_register(" bfar=", BFAR);
    semihosting_print("\n");
    semihosting_exit(START_FAULT_EXIT);
}

__attribute__((naked)) static void fault(void)
{
    __asm__ volatile("tst lr, #4\n" /* which stack was in use */
                     "ite eq\n"
                     "mrseq r0, msp\n"
                     "mrsne r0, psp\n"
                     "b %c0\n" ::"i"(report_fault));
}

typedef void handler(void);

/* Stack pointer, reset, and the system exceptions; no interrupt is ever enabled. */
__attribute__((section(".vectors"), used)) static handler *const vectors[16] = {
    (handler *)an500_handler_stack_top, /* not a function: the word that the processor loads into its stack pointer */
    reset,
    fault, /* NMI */
    fault, /* hard fault */
    fault, /* memory management */
    fault, /* bus */
    fault, /* usage */
    0,
    0,
    0,
    0,
    fault, /* SVCall */
    fault, /* debug monitor */
    0,
    fault, /* PendSV */
    fault, /* SysTick */
};
