/* What the start-up of the bare-metal Arm ports has in common. A port's linker script says where its memory is; armv7m.c or
 * the port's own code brings the processor from reset to start_variables and controller_main: stack painted, FPU on, variables set, memory
 * protected so that
 *
 *   code              may be read and executed
 *   variables, rows   read and written
 *   the bank          read
 *   below the stack   nothing (4 KiB): an overflow is a fault, and does not write into something else
 *   the rest          nothing but the devices that the port uses
 *
 * The loop and the handlers have stacks of their own, so an overflow can still be reported. A fault prints what and where it
 * was, and ends the program with START_FAULT_EXIT. A real board would drive its outputs to the safe state here and wait for
 * the watchdog. No interrupt is ever enabled. */
#ifndef TROCAR_START_H
#define TROCAR_START_H

#include <stdint.h>

#define START_PAINT 0xA5C3A5C3u /* a word of the loop's stack that was never in use */

enum { START_FAULT_EXIT = 10 };

/* What the reset ends in; its value is the exit code. Another part defines it. */
int controller_main(void);

/* Initialised variables from the image, the others to 0. */
void start_variables(void);

/* Most bytes of the loop's stack that were ever in use, and how many there are. */
uint32_t start_stack_used(void);
uint32_t start_stack_bytes(void);

#endif
