/* The STM32H743's flash driver on a model of a bank: its registers and what they do to a megabyte of flash words (RM0433,
 * "Embedded Flash memory"). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define SIMULATED_REGISTERS
#include "drivers/registers.h"
#include "drivers/stm32h7_flash.c"
#include "random.h"

enum { BANK_WORDS = 1 << 18, SECTOR_WORDS = BANK_WORDS / 8 };

static struct {
    uint32_t block[5];
    _Alignas(32) uint32_t memory[BANK_WORDS];
    bool programmed[BANK_WORDS / 8]; /* since the erasure */
    uint32_t control, status;
    unsigned key_step; /* 1: the first key was right; 3: locked until reset */
    unsigned gathered; /* words of the flash word being written */
    uint32_t gathering[8], at;
    unsigned busy_reads; /* how often the status reads as busy from now on */
    unsigned unlocked;   /* how often */
    bool protected_sector[8];
} model;

static void power_on(void)
{
    memset(&model, 0, sizeof model);
    memset(model.memory, 0xFF, sizeof model.memory);
    model.control = 1;
}

static void finish_program(void)
{
    uint32_t sector = model.at / SECTOR_WORDS;
    if (model.protected_sector[sector])
        model.status |= 1u << 17;
    else if (model.programmed[model.at / 8]) /* its error-correcting code would not fit */
        model.status |= 1u << 22;
    else
        memcpy(&model.memory[model.at], model.gathering, sizeof model.gathering);
    model.programmed[model.at / 8] = true;
    model.status |= 1u << 16;
    model.gathered = 0;
    model.busy_reads = 3;
}

static void start_erase(void)
{
    uint32_t sector = model.control >> 8 & 7;
    if (!(model.control & 4))
        model.status |= 1u << 18;
    else if (model.protected_sector[sector])
        model.status |= 1u << 17;
    else {
        memset(&model.memory[sector * SECTOR_WORDS], 0xFF, SECTOR_WORDS * 4);
        memset(&model.programmed[sector * SECTOR_WORDS / 8], 0, SECTOR_WORDS / 8);
        model.status |= 1u << 16;
    }
    model.busy_reads = 50;
}

uint32_t register_read(const volatile uint32_t *address)
{
    const uint32_t *a = (const uint32_t *)address;
    if (a >= model.memory && a < model.memory + BANK_WORDS)
        return *a;
    switch (a - model.block) {
    case 2:
        return model.control;
    case 3:
        if (model.busy_reads > 0) {
            model.busy_reads--;
            return 1u | 1u << 2;
        }
        return model.status | (model.gathered ? 2 : 0);
    default:
        abort();
    }
}

void register_write(volatile uint32_t *address, uint32_t value)
{
    uint32_t *a = (uint32_t *)address;
    if (a >= model.memory && a < model.memory + BANK_WORDS) {
        uint32_t at = (uint32_t)(a - model.memory);
        if ((model.control & 3) != 2 || (model.gathered && at != model.at + model.gathered) ||
            (!model.gathered && at % 8)) {
            model.status |= 1u << 18; /* PGSERR */
            return;
        }
        if (!model.gathered)
            model.at = at;
        model.gathering[model.gathered++] = value;
        if (model.gathered == 8)
            finish_program();
        return;
    }
    switch (a - model.block) {
    case 0:
        if (model.key_step == 0 && value == 0x45670123)
            model.key_step = 1;
        else if (model.key_step == 1 && value == 0xCDEF89AB && (model.control & 1)) {
            model.control &= ~1u;
            model.key_step = 0;
            model.unlocked++;
        } else
            model.key_step = 3;
        return;
    case 2:
        if (model.control & 1)
            return; /* locked: not written */
        model.control = value & ~(1u << 7);
        if (value >> 7 & 1)
            start_erase();
        return;
    case 4:
        model.status &= ~value;
        return;
    default:
        abort();
    }
}

static struct stm32h7_flash *const bank = (struct stm32h7_flash *)(void *)model.block;

static enum stm32h7_flash_state wait(void)
{
    enum stm32h7_flash_state state;
    unsigned polls = 0;
    while ((state = stm32h7_flash_poll(bank)) == STM32H7_FLASH_BUSY)
        assert_true(++polls < 100);
    assert_true(polls > 0);
    assert_int_equal(model.control & 1, 1); /* locked again */
    return state;
}

static void what_is_programmed_is_there_and_nothing_else(void **state)
{
    (void)state;
    static uint32_t expected[BANK_WORDS];
    power_on();
    memset(expected, 0xFF, sizeof expected);
    random_seed("flash words", 1);
    for (int i = 0; i < 2000; i++) {
        uint32_t at = 8 * random_below(BANK_WORDS / 8), word[8];
        if (model.programmed[at / 8])
            continue;
        for (int k = 0; k < 8; k++)
            expected[at + k] = word[k] = (uint32_t)random_bits();
        assert_true(stm32h7_flash_program(bank, &model.memory[at], word));
        assert_int_equal(wait(), STM32H7_FLASH_DONE);
    }
    assert_memory_equal(model.memory, expected, sizeof expected);
    for (uint32_t sector = 1; sector < 8; sector += 2) {
        memset(&expected[sector * SECTOR_WORDS], 0xFF, SECTOR_WORDS * 4);
        assert_true(stm32h7_flash_erase(bank, sector));
        assert_int_equal(wait(), STM32H7_FLASH_DONE);
    }
    assert_memory_equal(model.memory, expected, sizeof expected);
}

static void a_second_operation_waits_for_the_first(void **state)
{
    (void)state;
    const uint32_t word[8] = {1, 2, 3, 4, 5, 6, 7, 8};
    power_on();
    assert_true(stm32h7_flash_erase(bank, 3));
    assert_false(stm32h7_flash_erase(bank, 4));
    assert_false(stm32h7_flash_program(bank, model.memory, word));
    assert_int_equal(stm32h7_flash_poll(bank), STM32H7_FLASH_BUSY);
    assert_int_equal(wait(), STM32H7_FLASH_DONE);
    assert_true(stm32h7_flash_program(bank, model.memory, word));
    assert_int_equal(wait(), STM32H7_FLASH_DONE);
    assert_memory_equal(model.memory, word, sizeof word);
}

static void what_cannot_be_done_is_said(void **state)
{
    (void)state;
    const uint32_t word[8] = {1, 2, 3, 4, 5, 6, 7, 8};
    power_on();
    assert_false(stm32h7_flash_erase(bank, 8));
    assert_false(stm32h7_flash_program(bank, model.memory + 4, word)); /* not a whole flash word */
    model.protected_sector[2] = true;
    assert_true(stm32h7_flash_erase(bank, 2));
    assert_int_equal(wait(), STM32H7_FLASH_FAILED);
    assert_true(stm32h7_flash_program(bank, model.memory + 2 * SECTOR_WORDS, word));
    assert_int_equal(wait(), STM32H7_FLASH_FAILED);
    assert_true(stm32h7_flash_program(bank, model.memory, word));
    assert_int_equal(wait(), STM32H7_FLASH_DONE);
    assert_true(stm32h7_flash_program(bank, model.memory, word)); /* not erased since */
    assert_int_equal(wait(), STM32H7_FLASH_FAILED);
    assert_int_equal(stm32h7_flash_poll(bank), STM32H7_FLASH_DONE); /* said once */
    model.key_step = 3;                                             /* somebody has written a wrong key */
    assert_false(stm32h7_flash_erase(bank, 0));
    assert_false(stm32h7_flash_program(bank, model.memory + 8, word));
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_programmed_is_there_and_nothing_else),
        cmocka_unit_test(a_second_operation_waits_for_the_first),
        cmocka_unit_test(what_cannot_be_done_is_said),
    };
    return cmocka_run_group_tests_name("STM32H7 flash driver", tests, NULL, NULL);
}
