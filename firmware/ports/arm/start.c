#include "start.h"

/* Of the linker script: places, not values. */
extern uint32_t memory_stack[], memory_stack_top[], memory_data[], memory_data_end[], memory_bss[], memory_bss_end[];
extern const uint32_t memory_data_image[];

void start_variables(void)
{
    const uint32_t *from = memory_data_image;
    for (uint32_t *to = memory_data; to != memory_data_end; to++) /* bound: initialised variables */
        *to = *from++;
    for (uint32_t *to = memory_bss; to != memory_bss_end; to++) /* bound: variables that start as 0 */
        *to = 0;
}

uint32_t start_stack_bytes(void)
{
    return (uint32_t)((uintptr_t)memory_stack_top - (uintptr_t)memory_stack);
}

uint32_t start_stack_used(void)
{
    const volatile uint32_t *lowest = memory_stack;
    while (lowest != memory_stack_top && *lowest == START_PAINT) /* bound: words of the stack */
        lowest++;
    return (uint32_t)((uintptr_t)memory_stack_top - (uintptr_t)lowest);
}
