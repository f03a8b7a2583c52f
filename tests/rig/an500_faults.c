/* Instead of the controller, on the port's own start-up code: one access that the memory protection must refuse. The
 * command line's first letter says which. Exit code 0: it was let through. */
#include "semihosting.h"
#include "start.h"

extern uint32_t an500_stack[], an500_bank[], an500_rows[];

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
    char line[16];
    if (!semihosting_command_line(line, sizeof line))
        return 2;
    switch (line[0]) {
    case 'c': /* write to code */
        *(volatile uint32_t *)((uintptr_t)&controller_main & ~(uintptr_t)3) = 0;
        break;
    case 'b': /* write to the bank */
        *(volatile uint32_t *)an500_bank = 0;
        break;
    case 'x': /* execute in RAM: bx lr, as it would be found there */
        an500_rows[0] = 0x47704770;
        __asm__ volatile("dsb\n isb" ::: "memory");
        ((void (*)(void))((uintptr_t)an500_rows | 1u))();
        break;
    case 's': /* more stack than there is */
        sink = descend(0);
        break;
    case 'p': /* a peripheral that nothing here has to do with */
        sink = *(volatile uint32_t *)0x40004000u;
        break;
    default: /* none: all the rest works */
        an500_rows[0] = 1;
        sink = an500_rows[0] + an500_bank[0] + start_stack_used();
    }
    return 0;
}
