/* The chip and the board around it: clocks, pins, timer, watchdog.
 *
 *   crystal 8 MHz -> PLL1 (x 100) -> processor 400 MHz, buses 200 MHz, peripheral buses 100 MHz (timers 200 MHz)
 *                                -> FDCAN 80 MHz
 *   PD0, PD1: FDCAN1 receive, transmit (alternate function 9)
 *   TIM2: microseconds, 32 bits
 *   IWDG1: resets the chip when the loop does not come round within 10 ms; once started it cannot be stopped */
#ifndef TROCAR_STM32H743_BOARD_H
#define TROCAR_STM32H743_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "ports/arm/armv7m.h"

enum { BOARD_CRYSTAL_Hz = 8000000, BOARD_FDCAN_Hz = 80000000, BOARD_WATCHDOG_ms = 10 };

/* Clocks, pins and timer. False when the crystal or the PLL does not start: the bit rate would be wrong. */
bool board_start(void);

/* Microseconds since board_start, modulo 2^32. */
uint32_t board_time_us(void);

/* The first call starts the watchdog; the next must come within BOARD_WATCHDOG_ms. */
void board_watchdog(void);

/* For a debugger. */
extern volatile struct armv7m_fault board_last_fault;

#endif
