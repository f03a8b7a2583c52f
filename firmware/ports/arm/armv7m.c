#include "armv7m.h"

#include "start.h"

/* Of the linker script: a place, not a value. */
extern uint32_t memory_handler_stack_top[];

/* Registers of the system control space. */
#define REGISTER(address) (*(volatile uint32_t *)(address))
#define CCR               REGISTER(0xE000ED14u)
#define CCSIDR            REGISTER(0xE000ED80u)
#define CSSELR            REGISTER(0xE000ED84u)
#define ICIALLU           REGISTER(0xE000EF50u)
#define DCISW             REGISTER(0xE000EF60u)
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
    NO_ACCESS = 0 << 24,
    READ_WRITE = 3 << 24,
    READ_ONLY = 6 << 24,
    EXECUTE_NEVER = 1 << 28,
    CACHED = 1 << 19 | 1 << 17 | 1 << 16, /* normal memory, write-back, allocated on read and write */
    DEVICE = 1 << 18 | 1 << 16,
    STACKING_FAILED = 1 << 4 | 1 << 12 /* in CFSR: no frame was written */
};

void armv7m_protect(uint32_t number, const volatile void *address, uint32_t log2_bytes, enum armv7m_access access)
{
    static const uint32_t attributes[] = {
        [ARMV7M_NOTHING] = NO_ACCESS | CACHED | EXECUTE_NEVER, [ARMV7M_CODE] = READ_ONLY | CACHED,
        [ARMV7M_READ] = READ_ONLY | CACHED | EXECUTE_NEVER,    [ARMV7M_WRITE] = READ_WRITE | CACHED | EXECUTE_NEVER,
        [ARMV7M_DEVICE] = READ_WRITE | DEVICE | EXECUTE_NEVER,
    };
    MPU_RNR = number;
    MPU_RBAR = (uint32_t)(uintptr_t)address;
    MPU_RASR = attributes[access] | (log2_bytes - 1u) << 1 | 1u;
}

/* Armv7-M Architecture Reference Manual, B2.2: what caches hold after power-on is undefined. */
void armv7m_caches_on(void)
{
    CSSELR = 0; /* the data cache of level 1 */
    __asm__ volatile("dsb" ::: "memory");
    uint32_t size = CCSIDR, sets = (size >> 13 & 0x7FFFu) + 1, ways = (size >> 3 & 0x3FFu) + 1;
    uint32_t line_bits = (size & 7u) + 4, way_shift = 32;
    for (uint32_t rest = ways - 1; rest; rest >>= 1) /* bound: 10 bits */
        way_shift--;
    for (uint32_t set = 0; set < sets; set++)     /* bound: 32768 */
        for (uint32_t way = 0; way < ways; way++) /* bound: 1024 */
            DCISW = set << line_bits | (way_shift < 32 ? way << way_shift : 0);
    ICIALLU = 0;
    __asm__ volatile("dsb\n isb" ::: "memory");
    CCR |= 1u << 16 | 1u << 17; /* data, instructions */
    __asm__ volatile("dsb\n isb" ::: "memory");
}

void armv7m_protect_on(void)
{
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
    port_start();
    port_end(controller_main());
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
    bool overflow = cfsr & STACKING_FAILED;
    port_fault(&(struct armv7m_fault){.pc = overflow ? 0 : frame[6],
                                      .cfsr = cfsr,
                                      .hfsr = HFSR,
                                      .mmfar = MMFAR,
                                      .bfar = BFAR,
                                      .stack_overflow = overflow});
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
