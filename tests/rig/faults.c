/* Instead of the controller, on a port's own start-up code: one access that the memory protection must refuse. The command
 * line's last letter says which. Exit code 0: it was let through. */
#include "ports/arm/semihosting.h"
#include "ports/arm/start.h"

extern uint32_t memory_stack[], memory_bank[], memory_rows[];

static volatile uint32_t sink;

/* A frame of 64 bytes and more at each level; what is done after the call keeps it from being a loop. */
static uint32_t descend(uint32_t level)
{
    volatile uint32_t frame[16];
    frame[level & 15u] = level;
    uint32_t below = level < 1000000 ? descend(level + 1) : 0;
    return below + frame[level & 15u];
}

int controller_main(void)
{
    static char line[512];
    char *last = line;
    if (!semihosting_command_line(line, sizeof line) || !*line)
        return 2;
    while (last[1])
        last++;
    switch (*last) {
    case 'c': /* write to code */
        *(volatile uint32_t *)((uintptr_t)&controller_main & ~(uintptr_t)3) = 0;
        break;
    case 'b': /* write to the bank */
        *(volatile uint32_t *)memory_bank = 0;
        break;
    case 'x': /* execute in RAM: bx lr, as it would be found there */
        memory_rows[0] = 0x47704770;
        __asm__ volatile("dsb\n isb" ::: "memory");
        ((void (*)(void))((uintptr_t)memory_rows | 1u))();
        break;
    case 's': /* more stack than there is */
        sink = descend(0);
        break;
    case 'p': /* a peripheral that nothing here has to do with */
        sink = *(volatile uint32_t *)0x40004000u;
        break;
    default: /* none: all the rest works */
        memory_rows[0] = 1;
        sink = memory_rows[0] + memory_bank[0] + start_stack_used();
    }
    return 0;
}
