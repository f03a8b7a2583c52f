/* Erasing and programming one of the two flash banks of an STM32H743 (RM0433, "Embedded Flash memory"). A bank is 8 sectors of
 * 128 KiB; the smallest unit that can be programmed is a flash word of 32 bytes, once after each erasure (it carries its own
 * error-correcting code). Erased, it reads as ones.
 *
 * Nothing here waits: an operation is begun, and asked after. Meanwhile the processor may run from the other bank, not from this
 * one. The bank is unlocked for the length of an operation. A data cache over the bank is the caller's to invalidate. */
#ifndef TROCAR_STM32H7_FLASH_H
#define TROCAR_STM32H7_FLASH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { STM32H7_FLASH_SECTORS = 8, STM32H7_FLASH_SECTOR_BYTES = 128 << 10, STM32H7_FLASH_WORDS = 8 };

/* Of bank 1 at 0x52002004, of bank 2 at 0x52002104. */
struct stm32h7_flash {
    volatile uint32_t key;        /* KEYR */
    volatile uint32_t option_key; /* OPTKEYR; reserved in bank 2 */
    volatile uint32_t control;    /* CR */
    volatile uint32_t status;     /* SR */
    volatile uint32_t clear;      /* CCR */
};
_Static_assert(offsetof(struct stm32h7_flash, control) == 0x0C - 0x04, "CR1");
_Static_assert(offsetof(struct stm32h7_flash, status) == 0x10 - 0x04, "SR1");
_Static_assert(offsetof(struct stm32h7_flash, clear) == 0x14 - 0x04, "CCR1");

enum stm32h7_flash_state { STM32H7_FLASH_DONE, STM32H7_FLASH_BUSY, STM32H7_FLASH_FAILED };

/* Begin to erase a sector (0 .. 7), which takes up to 4 s. False: no such sector, an operation is under way, or the bank does not
 * unlock, which then only a reset of the chip cures. */
bool stm32h7_flash_erase(struct stm32h7_flash *bank, uint32_t sector);

/* Begin to program a flash word at `to`, a multiple of 32 bytes in this bank. False as above. */
bool stm32h7_flash_program(struct stm32h7_flash *bank, volatile uint32_t *to, const uint32_t word[STM32H7_FLASH_WORDS]);

/* How the operation fares. What has ended is locked again; FAILED is said once. */
enum stm32h7_flash_state stm32h7_flash_poll(struct stm32h7_flash *bank);

#endif
