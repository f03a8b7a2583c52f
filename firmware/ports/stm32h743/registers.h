/* Registers of the STM32H743 that this port uses besides those of its drivers (ST RM0433: RCC, PWR, FLASH, GPIO, general-purpose
 * timers TIM2, IWDG). Where they are, stm32h743.ld says. */
#ifndef TROCAR_STM32H743_REGISTERS_H
#define TROCAR_STM32H743_REGISTERS_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/registers.h"

struct stm32h743_rcc { /* reset and clock control */
    volatile uint32_t cr;
    volatile uint32_t reserved0[3];
    volatile uint32_t cfgr;
    volatile uint32_t reserved1;
    volatile uint32_t d1cfgr, d2cfgr, d3cfgr;
    volatile uint32_t reserved2;
    volatile uint32_t pllckselr, pllcfgr, pll1divr;
    volatile uint32_t reserved3[7];
    volatile uint32_t d2ccip1r;
    volatile uint32_t reserved4[35];
    volatile uint32_t ahb4enr;
    volatile uint32_t reserved5;
    volatile uint32_t apb1lenr, apb1henr;
};
_Static_assert(offsetof(struct stm32h743_rcc, cfgr) == 0x10, "RCC_CFGR");
_Static_assert(offsetof(struct stm32h743_rcc, d1cfgr) == 0x18, "RCC_D1CFGR");
_Static_assert(offsetof(struct stm32h743_rcc, pllckselr) == 0x28, "RCC_PLLCKSELR");
_Static_assert(offsetof(struct stm32h743_rcc, pll1divr) == 0x30, "RCC_PLL1DIVR");
_Static_assert(offsetof(struct stm32h743_rcc, d2ccip1r) == 0x50, "RCC_D2CCIP1R");
_Static_assert(offsetof(struct stm32h743_rcc, ahb4enr) == 0xE0, "RCC_AHB4ENR");
_Static_assert(offsetof(struct stm32h743_rcc, apb1lenr) == 0xE8, "RCC_APB1LENR");
_Static_assert(offsetof(struct stm32h743_rcc, apb1henr) == 0xEC, "RCC_APB1HENR");

enum {
    RCC_CR_HSEON = 1 << 16,
    RCC_CR_HSERDY = 1 << 17,
    RCC_CR_PLL1ON = 1 << 24,
    RCC_CR_PLL1RDY = 1 << 25,
    RCC_CFGR_SW_PLL1 = 3,
    RCC_CFGR_SWS = 7 << 3, /* the clock in use, as SW */
    RCC_HALF_AHB = 8,      /* D1CFGR.HPRE: the buses at half of the processor's clock */
    RCC_HALF_APB = 4,      /* DxPPREy: a peripheral bus at half of that */
    RCC_PLLSRC_HSE = 2,
    RCC_PLL1RGE_8_16 = 3 << 2, /* the PLL's reference is 8 to 16 MHz */
    RCC_PLL1_P_Q = 1 << 16 | 1 << 17,
    RCC_FDCANSEL = 3 << 28,
    RCC_FDCANSEL_PLL1Q = 1 << 28,
    RCC_GPIODEN = 1 << 3,
    RCC_TIM2EN = 1 << 0,
    RCC_FDCANEN = 1 << 8
};

struct stm32h743_pwr { /* power control */
    volatile uint32_t cr1, csr1, cr2, cr3, cpucr, reserved, d3cr;
};
_Static_assert(offsetof(struct stm32h743_pwr, cr3) == 0x0C, "PWR_CR3");
_Static_assert(offsetof(struct stm32h743_pwr, d3cr) == 0x18, "PWR_D3CR");

enum {
    PWR_CR3_LDO = 1 << 1, /* LDOEN alone: the chip's own regulator; may be written once */
    PWR_CR3_MASK = 7,
    PWR_D3CR_READY = 1 << 13, /* VOSRDY */
    PWR_D3CR_SCALE_1 = 3 << 14
};

enum { FLASH_ACR_200_MHz = 2 | 2 << 4 }; /* 2 wait states, WRHIGHFREQ 2: 185 to 210 MHz at scale 1 */

struct stm32h743_gpio {
    volatile uint32_t moder, otyper, ospeedr, pupdr, idr, odr, bsrr, lckr, afr[2];
};
_Static_assert(offsetof(struct stm32h743_gpio, afr) == 0x20, "GPIOx_AFRL");

struct stm32h743_timer {
    volatile uint32_t cr1;
    volatile uint32_t reserved0[4];
    volatile uint32_t egr;
    volatile uint32_t reserved1[3];
    volatile uint32_t cnt, psc, arr;
};
_Static_assert(offsetof(struct stm32h743_timer, egr) == 0x14, "TIMx_EGR");
_Static_assert(offsetof(struct stm32h743_timer, cnt) == 0x24, "TIMx_CNT");
_Static_assert(offsetof(struct stm32h743_timer, psc) == 0x28, "TIMx_PSC");
_Static_assert(offsetof(struct stm32h743_timer, arr) == 0x2C, "TIMx_ARR");

enum { TIM_CR1_ENABLE = 1, TIM_EGR_UPDATE = 1 };

struct stm32h743_watchdog { /* independent watchdog */
    volatile uint32_t kr, pr, rlr, sr, winr;
};
_Static_assert(offsetof(struct stm32h743_watchdog, sr) == 0x0C, "IWDG_SR");

enum { IWDG_START = 0xCCCC, IWDG_CHANGE = 0x5555, IWDG_REFRESH = 0xAAAA };

#endif
