/* The only boundary to hardware. A port is an implementation of these functions plus its start-up code; see
 * ports/blank for the starting point of a new one. No function blocks but hal_wait_us.
 *
 * Joining with the parts that need them: local encoders and actuators, erasing and programming flash, the watchdog, and
 * entering the boot loader. */
#ifndef TROCAR_HAL_H
#define TROCAR_HAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "can_frame.h"

/* Microseconds since start; never goes back. */
uint64_t hal_time_us(void);

/* Idle until `time_us` or until a frame can be received, whichever is first. Returns hal_time_us(). */
uint64_t hal_wait_us(uint64_t time_us);

/* The oldest frame received, or false. */
bool hal_can_receive(struct can_frame_t *frame);

/* Hand a frame to the bus. False when no mailbox is free: the caller drops it and counts. A torque frame that still waits
 * in a mailbox is aborted when the next is handed over: it must not be sent late. */
bool hal_can_transmit(const struct can_frame_t *frame);

/* What the CAN controller has gone through since start. */
struct can_errors hal_can_errors(void);

/* Where the bank lies: 16-byte aligned, readable as long as the controller runs. NULL when there is none. */
const void *hal_bank(size_t *length);

/* RAM for rows of the bank (row_cache.h), aligned to 4. A plain bank needs none. */
void *hal_memory(size_t *bytes);

/* True while the controller should go on; a board never stops. */
bool hal_running(void);

#endif
