/* From reset to controller_main, and what happens when the processor refuses an access.
 *
 * Reset: stack painted, FPU on, variables set, memory protected (Armv7-M Architecture Reference Manual, B3.5):
 *
 *   code      read, execute
 *   RAM       read, write; its lowest 4 KiB, below the loop's stack, nothing
 *   bank      read
 *   the rest  nothing but the processor's own registers
 *
 * The loop runs on the process stack; handlers have one of their own, so an overflow can still be reported. A fault
 * prints the place and the fault registers, and ends the program with START_FAULT_EXIT. A real board would drive its outputs
 * to the safe state here and wait for the watchdog. */
#ifndef TROCAR_AN500_START_H
#define TROCAR_AN500_START_H

#include <stdint.h>

enum { START_FAULT_EXIT = 10 };

/* What the reset ends in; its value is the exit code. Another part defines it. */
int controller_main(void);

/* Most bytes of the loop's stack that were ever in use, and how many there are. */
uint32_t start_stack_used(void);
uint32_t start_stack_bytes(void);

#endif
