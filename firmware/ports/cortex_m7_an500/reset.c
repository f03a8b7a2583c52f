#include "ports/arm/semihosting.h"
#include "ports/arm/start.h"

/* Of an500.ld: places, not values. */
extern uint32_t memory_guard[], memory_handler_stack_top[];
extern const uint32_t memory_bank[];

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
    protect(1, memory_guard, 22, ACCESS_WRITE, EXECUTE_NEVER);
    protect(2, memory_bank, 24, ACCESS_READ, EXECUTE_NEVER);
    protect(3, memory_guard, 12, ACCESS_NONE, EXECUTE_NEVER);
    MPU_CTRL = 1; /* on, and no other memory */
    SHCSR |= 7u << 16;
    __asm__ volatile("dsb\n isb" ::: "memory");
}

/* Reached on the process stack. */
__attribute__((used)) static _Noreturn void start(void)
{
    CPACR |= 15u << 20;
    __asm__ volatile("dsb\n isb" ::: "memory");
    start_variables();
    protect_memory();
    semihosting_exit(controller_main());
}

/* Paint the loop's stack, which is not in use yet, and move onto it. */
__attribute__((naked, used)) void reset(void);
void reset(void)
{
    __asm__ volatile("ldr r0, =memory_stack\n"
                     "ldr r1, =memory_stack_top\n"
                     "ldr r2, =%c0\n"
                     "1: str r2, [r0], #4\n"
                     "cmp r0, r1\n"
                     "blo 1b\n"
                     "msr psp, r1\n"
                     "movs r0, #2\n"
                     "msr control, r0\n"
                     "isb\n"
                     "b %c1\n"
                     ".ltorg\n" ::"i"(START_PAINT),
                     "i"(start));
}

/* `frame`: r0-r3, r12, lr, pc, xpsr as the processor stacked them. */
__attribute__((used)) static _Noreturn void report_fault(const uint32_t *frame)
{
    uint32_t cfsr = CFSR;
    semihosting_print("controller: fault");
    if (cfsr & STACKING_FAILED)
        semihosting_print(" stack=overflow");
    else
        start_print_register(" pc=", frame[6]);
    start_print_register(" cfsr=", cfsr);
    start_print_register(" hfsr=", HFSR);
    start_print_register(" mmfar=", MMFAR);
    start_print_register(" bfar=", BFAR);
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
    (handler *)memory_handler_stack_top, /* not a function: the word that the processor loads into its stack pointer */
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
