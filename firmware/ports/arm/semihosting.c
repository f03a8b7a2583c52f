#include "semihosting.h"

enum {
    SYS_OPEN = 0x01,
    SYS_WRITE0 = 0x04,
    SYS_WRITE = 0x05,
    SYS_READ = 0x06,
    SYS_GET_CMDLINE = 0x15,
    SYS_EXIT_EXTENDED = 0x20,
    APPLICATION_EXIT = 0x20026
};

/* The instruction that calls, and the registers with the operation and its argument. */
#if defined __aarch64__
#define TRAP   "hlt 0xf000"
#define FIRST  "x0"
#define SECOND "x1"
#elif defined __ARM_ARCH_PROFILE && __ARM_ARCH_PROFILE == 'M'
#define TRAP   "bkpt 0xab"
#define FIRST  "r0"
#define SECOND "r1"
#else /* Thumb on the other profiles */
#define TRAP   "svc 0xab"
#define FIRST  "r0"
#define SECOND "r1"
#endif

/* All operations take one word, most often the address of a block of words, and return one. */
static uintptr_t call(uintptr_t operation, const volatile void *block)
{
    register uintptr_t first __asm__(FIRST) = operation;
    register const volatile void *second __asm__(SECOND) = block;
    __asm__ volatile(TRAP : "+r"(first) : "r"(second) : "memory");
    return first;
}

static uintptr_t word(const volatile void *pointer)
{
    return (uintptr_t)pointer;
}

int32_t semihosting_open(const char *path, uint32_t mode)
{
    uint32_t length = 0;
    while (path[length]) /* bound: the path's length */
        length++;
    uintptr_t block[3] = {word(path), mode, length};
    return (int32_t)call(SYS_OPEN, block);
}

size_t semihosting_read(int32_t handle, void *bytes, size_t length)
{
    uintptr_t block[3] = {(uintptr_t)handle, word(bytes), length};
    uintptr_t missing = call(SYS_READ, block);
    return missing > length ? 0 : length - missing;
}

bool semihosting_write(int32_t handle, const void *bytes, size_t length)
{
    uintptr_t block[3] = {(uintptr_t)handle, word(bytes), length};
    return call(SYS_WRITE, block) == 0;
}

bool semihosting_command_line(char *line, size_t room)
{
    uintptr_t block[2] = {word(line), room};
    return call(SYS_GET_CMDLINE, block) == 0;
}

void semihosting_print(const char *text)
{
    call(SYS_WRITE0, text);
}

void semihosting_print_decimal(uint32_t number)
{
    char digits[11], *first = &digits[10];
    *first = 0;
    do { /* bound: 10 digits */
        *--first = (char)('0' + number % 10);
        number /= 10;
    } while (number);
    semihosting_print(first);
}

void semihosting_print_hexadecimal(uint32_t number)
{
    char digits[9];
    for (int i = 0; i < 8; i++) /* bound: 8 */
        digits[i] = "0123456789abcdef"[number >> (28 - 4 * i) & 15u];
    digits[8] = 0;
    semihosting_print(digits);
}

void semihosting_print_register(const char *name, uint32_t value)
{
    semihosting_print(name);
    semihosting_print_hexadecimal(value);
}

_Noreturn void semihosting_exit(int code)
{
    uintptr_t block[2] = {APPLICATION_EXIT, (uintptr_t)code};
    for (;;) /* bound: none; the first call does not return */
        call(SYS_EXIT_EXTENDED, block);
}
