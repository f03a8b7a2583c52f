#include "board.h"

#include "registers.h"

/* Of stm32h743.ld: places, not values. */
extern const uint32_t memory_code[], memory_bank[], memory_guard[], memory_rows[];
extern struct stm32h743_rcc stm32h743_rcc;
extern struct stm32h743_pwr stm32h743_pwr;
extern struct stm32h743_gpio stm32h743_gpiod;
extern struct stm32h743_timer stm32h743_tim2;
extern struct stm32h743_watchdog stm32h743_iwdg1;
extern volatile uint32_t stm32h743_flash_access[];

enum {
    START_READS = 1000000, /* a crystal starts within 2 ms; at 64 MHz a read takes at least 0.1 us */
    PLL_M = 1,
    PLL_N = 100, /* 800 MHz */
    PLL_P = 2,   /* 400 MHz */
    PLL_Q = 10,  /* 80 MHz */
    TIMER_Hz = 200000000,
    SLOW_CLOCK_Hz = 32000, /* of the watchdog, 17 to 47 kHz */
    CAN_FUNCTION = 9
};
_Static_assert(BOARD_CRYSTAL_Hz / PLL_M * PLL_N / PLL_Q == BOARD_FDCAN_Hz, "the PLL's output for FDCAN");

volatile struct armv7m_fault board_last_fault;

static void change(volatile uint32_t *address, uint32_t clear, uint32_t set)
{
    register_write(address, (register_read(address) & ~clear) | set);
}

static bool wait_for(const volatile uint32_t *address, uint32_t mask, uint32_t value)
{
    for (uint32_t i = 0; i < START_READS; i++) /* bound: START_READS */
        if ((register_read(address) & mask) == value)
            return true;
    return false;
}

static bool start_clocks(void)
{
    struct stm32h743_rcc *rcc = &stm32h743_rcc;
    struct stm32h743_pwr *pwr = &stm32h743_pwr;
    change(&pwr->cr3, PWR_CR3_MASK, PWR_CR3_LDO);
    change(&pwr->d3cr, PWR_D3CR_SCALE_1, PWR_D3CR_SCALE_1);
    if (!wait_for(&pwr->d3cr, PWR_D3CR_READY, PWR_D3CR_READY))
        return false;
    change(&rcc->cr, 0, RCC_CR_HSEON);
    if (!wait_for(&rcc->cr, RCC_CR_HSERDY, RCC_CR_HSERDY))
        return false;
    change(&rcc->pllckselr, 3 | 63 << 4, RCC_PLLSRC_HSE | PLL_M << 4);
    change(&rcc->pllcfgr, 15, RCC_PLL1RGE_8_16 | RCC_PLL1_P_Q);
    register_write(&rcc->pll1divr, (PLL_Q - 1) << 16 | (PLL_P - 1) << 9 | (PLL_N - 1));
    change(&rcc->cr, 0, RCC_CR_PLL1ON);
    if (!wait_for(&rcc->cr, RCC_CR_PLL1RDY, RCC_CR_PLL1RDY))
        return false;
    /* dividers and wait states for the fast clock before it comes */
    register_write(&rcc->d1cfgr, RCC_HALF_AHB | RCC_HALF_APB << 4);
    register_write(&rcc->d2cfgr, RCC_HALF_APB << 4 | RCC_HALF_APB << 8);
    register_write(&rcc->d3cfgr, RCC_HALF_APB << 4);
    register_write(stm32h743_flash_access, FLASH_ACR_200_MHz);
    if (!wait_for(stm32h743_flash_access, 63, FLASH_ACR_200_MHz))
        return false;
    change(&rcc->cfgr, 7, RCC_CFGR_SW_PLL1);
    return wait_for(&rcc->cfgr, RCC_CFGR_SWS, RCC_CFGR_SW_PLL1 << 3);
}

static void start_peripherals(void)
{
    struct stm32h743_rcc *rcc = &stm32h743_rcc;
    change(&rcc->d2ccip1r, RCC_FDCANSEL, RCC_FDCANSEL_PLL1Q);
    change(&rcc->ahb4enr, 0, RCC_GPIODEN);
    change(&rcc->apb1lenr, 0, RCC_TIM2EN);
    change(&rcc->apb1henr, 0, RCC_FDCANEN);
    (void)register_read(&rcc->apb1henr); /* RM0433: two cycles between enabling and the first access */

    struct stm32h743_gpio *pins = &stm32h743_gpiod; /* PD0 and PD1 */
    change(&pins->afr[0], 0xFF, CAN_FUNCTION | CAN_FUNCTION << 4);
    change(&pins->ospeedr, 15, 10); /* high speed */
    change(&pins->moder, 15, 10);   /* alternate function */

    struct stm32h743_timer *timer = &stm32h743_tim2;
    register_write(&timer->psc, TIMER_Hz / 1000000 - 1);
    register_write(&timer->arr, 0xFFFFFFFFu);
    register_write(&timer->egr, TIM_EGR_UPDATE); /* take the prescaler over */
    register_write(&timer->cr1, TIM_CR1_ENABLE);
}

bool board_start(void)
{
    if (!start_clocks())
        return false;
    start_peripherals();
    return true;
}

uint32_t board_time_us(void)
{
    return register_read(&stm32h743_tim2.cnt);
}

void board_watchdog(void)
{
    static bool started;
    struct stm32h743_watchdog *w = &stm32h743_iwdg1;
    if (!started) {
        started = true;
        register_write(&w->kr, IWDG_START);
        register_write(&w->kr, IWDG_CHANGE);
        register_write(&w->pr, 0); /* by 4 */
        register_write(&w->rlr, BOARD_WATCHDOG_ms * (SLOW_CLOCK_Hz / 1000) / 4);
    }
    register_write(&w->kr, IWDG_REFRESH);
}

void port_start(void)
{
    armv7m_protect(0, memory_code, 20, ARMV7M_CODE);
    armv7m_protect(1, memory_bank, 20, ARMV7M_READ);
    armv7m_protect(2, memory_guard, 17, ARMV7M_WRITE);
    armv7m_protect(3, memory_rows, 19, ARMV7M_WRITE);
    armv7m_protect(4, (const void *)0x40000000u, 16, ARMV7M_DEVICE); /* TIM2, FDCAN and its message RAM */
    armv7m_protect(5, (const void *)0x58000000u, 18, ARMV7M_DEVICE); /* clocks, power, pins, watchdog */
    armv7m_protect(6, stm32h743_flash_access, 12, ARMV7M_DEVICE);
    armv7m_protect(7, memory_guard, 12, ARMV7M_NOTHING);
    armv7m_caches_on();
    armv7m_protect_on();
}

/* Nothing more is sent; where the loop ran before, the watchdog resets the chip. */
_Noreturn void port_end(int code)
{
    (void)code;
    for (;;) /* bound: none; until a reset */
        __asm__ volatile("wfi");
}

_Noreturn void port_fault(const struct armv7m_fault *fault)
{
    board_last_fault = *fault;
    port_end(0);
}
