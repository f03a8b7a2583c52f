# An Arm Cortex-M7 without any library: QEMU's machine mps2-an500 (README.md). The FPU of this port is single precision, so
# an operation on doubles would not link. -fcallgraph-info: worst stack, for `make budgets`.
AN500 := firmware/ports/cortex_m7_an500/an500.ld
cortex_m7_an500_MORE := $(wildcard firmware/ports/arm/*.c)
$(eval $(call port,cortex_m7_an500,arm-none-eabi-gcc,-mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-sp-d16 -ffunction-sections -fdata-sections -fcallgraph-info=su,$(FREESTANDING) -fno-tree-loop-distribute-patterns,-nostdlib -static -T $(AN500) -Wl$(comma)--gc-sections -Wl$(comma)--fatal-warnings))
$(cortex_m7_an500_DIR)/controller.elf: $(AN500)
