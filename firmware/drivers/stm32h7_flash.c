#include "stm32h7_flash.h"

#include "registers.h"

#define BIT(n) (1u << (n))
#define KEY_1  0x45670123u
#define KEY_2  0xCDEF89ABu

enum {
    CR_LOCK = BIT(0),
    CR_PROGRAM = BIT(1), /* PG */
    CR_ERASE = BIT(2),   /* SER: one sector */
    CR_BY_64 = 3 << 4,   /* PSIZE: 64 bits at a time, for a supply of 2.7 V and more */
    CR_START = BIT(7),
    CR_SECTOR_SHIFT = 8,                /* SNB */
    SR_BUSY = BIT(0) | BIT(1) | BIT(2), /* BSY, WBNE, QW: at work, words gathered, operations queued */
    SR_END = BIT(16),                   /* EOP */
    /* WRPERR, PGSERR, STRBERR, INCERR, OPERR, RDPERR, RDSERR */
    SR_ERRORS = BIT(17) | BIT(18) | BIT(19) | BIT(21) | BIT(22) | BIT(23) | BIT(24)
};

static bool unlock(struct stm32h7_flash *bank)
{
    if (register_read(&bank->status) & SR_BUSY)
        return false;
    if (register_read(&bank->control) & CR_LOCK) {
        register_write(&bank->key, KEY_1);
        register_write(&bank->key, KEY_2);
    }
    register_write(&bank->clear, SR_END | SR_ERRORS);
    return !(register_read(&bank->control) & CR_LOCK);
}

bool stm32h7_flash_erase(struct stm32h7_flash *bank, uint32_t sector)
{
    if (sector >= STM32H7_FLASH_SECTORS || !unlock(bank))
        return false;
    uint32_t control = CR_ERASE | CR_BY_64 | sector << CR_SECTOR_SHIFT;
    register_write(&bank->control, control);
    register_write(&bank->control, control | CR_START);
    return true;
}

bool stm32h7_flash_program(struct stm32h7_flash *bank, volatile uint32_t *to, const uint32_t word[STM32H7_FLASH_WORDS])
{
    if ((uintptr_t)to % (STM32H7_FLASH_WORDS * 4) != 0 || !unlock(bank))
        return false;
    register_write(&bank->control, CR_PROGRAM | CR_BY_64);
    for (uint32_t i = 0; i < STM32H7_FLASH_WORDS;
         i++) /* bound: STM32H7_FLASH_WORDS; the last one begins the operation */
        register_write(&to[i], word[i]);
    return true;
}

enum stm32h7_flash_state stm32h7_flash_poll(struct stm32h7_flash *bank)
{
    uint32_t status = register_read(&bank->status);
    if (status & SR_BUSY)
        return STM32H7_FLASH_BUSY;
    register_write(&bank->clear, SR_END | SR_ERRORS);
    register_write(&bank->control, CR_LOCK);
    return status & SR_ERRORS ? STM32H7_FLASH_FAILED : STM32H7_FLASH_DONE;
}
