# An STM32H743 (Cortex-M7) without any library: compiled and checked, never executed (README.md). The FPU is used as a
# single-precision one, so an operation on doubles would not link.
STM32H743 := firmware/ports/stm32h743/stm32h743.ld
stm32h743_MORE := $(addprefix firmware/drivers/,fdcan.c can_timing.c stm32h7_flash.c) \
  $(addprefix firmware/ports/arm/,armv7m.c start.c memory.c)
$(eval $(call port,stm32h743,arm-none-eabi-gcc,-mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-sp-d16 -ffunction-sections -fdata-sections -fcallgraph-info=su,$(FREESTANDING) -fno-tree-loop-distribute-patterns,-nostdlib -static -T $(STM32H743) -Wl$(comma)--gc-sections -Wl$(comma)--fatal-warnings))
$(stm32h743_DIR)/controller.elf: $(STM32H743)
