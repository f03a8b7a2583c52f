#include "mailbox.h"
#include "ports/arm/semihosting.h"
#include "ports/arm/start.h"

/* Of zcu102.ld: places, not values. */
extern uint32_t memory_guard[], memory_stack[], memory_rows[], zcu102_can0[];
extern const uint32_t memory_bank[];

/* Registers of coprocessor 15. */
#define READ(name, value)  __asm__ volatile("mrc " name : "=r"(value))
#define WRITE(name, value) __asm__ volatile("mcr " name ::"r"(value) : "memory")
#define SCTLR              "p15, 0, %0, c1, c0, 0"
#define DFSR               "p15, 0, %0, c5, c0, 0"
#define IFSR               "p15, 0, %0, c5, c0, 1"
#define DFAR               "p15, 0, %0, c6, c0, 0"
#define IFAR               "p15, 0, %0, c6, c0, 2"
#define DRBAR              "p15, 0, %0, c6, c1, 0"
#define DRSR               "p15, 0, %0, c6, c1, 2"
#define DRACR              "p15, 0, %0, c6, c1, 4"
#define RGNR               "p15, 0, %0, c6, c2, 0"
#define ICIALLU            "p15, 0, %0, c7, c5, 0"
#define DCIALL             "p15, 0, %0, c15, c5, 0" /* Cortex-R5: invalidate all data cache */

enum {
    SCTLR_PROTECTION = 1, /* and, with BR clear, nothing else may be touched */
    SCTLR_DATA_CACHE = 1 << 2,
    SCTLR_INSTRUCTION_CACHE = 1 << 12,
    ACCESS_NONE = 0 << 8,
    ACCESS_WRITE = 3 << 8,
    ACCESS_READ = 6 << 8,
    EXECUTE_NEVER = 1 << 12,
    CACHED = 1 << 3 | 1 << 1 | 1, /* normal memory, write-back, allocated on read and write */
    DEVICE = 1 << 2 | 1           /* shared */
};

/* A region of 2^log2_bytes bytes at a multiple of its size. The higher number wins where two overlap. */
static void protect(uint32_t number, const volatile void *address, uint32_t log2_bytes, uint32_t access)
{
    WRITE(RGNR, number);
    WRITE(DRBAR, (uint32_t)(uintptr_t)address);
    WRITE(DRSR, (log2_bytes - 1u) << 1 | 1u);
    WRITE(DRACR, access);
}

static void protect_memory(void)
{
    protect(0, (const void *)0, 17, ACCESS_READ | CACHED);
    protect(1, memory_guard, 17, ACCESS_WRITE | CACHED | EXECUTE_NEVER);
    protect(2, memory_rows, 22, ACCESS_WRITE | CACHED | EXECUTE_NEVER);
    protect(3, memory_bank, 24, ACCESS_READ | CACHED | EXECUTE_NEVER);
    protect(4, zcu102_can0, 12, ACCESS_WRITE | DEVICE | EXECUTE_NEVER);
    protect(5, (const void *)MAILBOX_ADDRESS, 12, ACCESS_WRITE | DEVICE | EXECUTE_NEVER);
    protect(6, memory_guard, 12, ACCESS_NONE | EXECUTE_NEVER);
    uint32_t control;
    WRITE(ICIALLU, 0);
    WRITE(DCIALL, 0);
    READ(SCTLR, control);
    __asm__ volatile("dsb" ::: "memory");
    WRITE(SCTLR, control | SCTLR_PROTECTION | SCTLR_DATA_CACHE | SCTLR_INSTRUCTION_CACHE);
    __asm__ volatile("isb" ::: "memory");
}

/* Reached on the loop's stack. */
_Noreturn void start(void);
_Noreturn void start(void)
{
    start_variables();
    protect_memory();
    semihosting_exit(controller_main());
}

_Noreturn void report_fault(uint32_t which, uint32_t place);
_Noreturn void report_fault(uint32_t which, uint32_t place)
{
    static const char *const names[] = {"undefined instruction", "supervisor call", "prefetch abort", "data abort",
                                        "interrupt"};
    uint32_t data_status, data_address, instruction_status, instruction_address;
    READ(DFSR, data_status);
    READ(DFAR, data_address);
    READ(IFSR, instruction_status);
    READ(IFAR, instruction_address);
    semihosting_print("controller: fault ");
    semihosting_print(names[which]);
    if (which == 3 &&
        data_address - (uint32_t)(uintptr_t)memory_guard < (uintptr_t)memory_stack - (uintptr_t)memory_guard)
        semihosting_print(" stack=overflow");
    semihosting_print_register(" pc=", place);
    semihosting_print_register(" dfsr=", data_status);
    semihosting_print_register(" dfar=", data_address);
    semihosting_print_register(" ifsr=", instruction_status);
    semihosting_print_register(" ifar=", instruction_address);
    semihosting_print("\n");
    semihosting_exit(START_FAULT_EXIT);
}
