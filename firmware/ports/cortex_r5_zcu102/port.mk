# An Arm Cortex-R5F without any library, on QEMU's machine xlnx-zcu102 (README.md), and the bridge, a program for the Cortex-A53
# beside it. The FPU is used as a single-precision one, so an operation on doubles would not link.
ZCU102 := firmware/ports/cortex_r5_zcu102
cortex_r5_zcu102_MORE := firmware/drivers/xilinx_can.c firmware/drivers/can_timing.c \
  firmware/ports/arm/start.c firmware/ports/arm/semihosting.c firmware/ports/arm/memory.c
$(eval $(call port,cortex_r5_zcu102,arm-none-eabi-gcc,-mcpu=cortex-r5 -mthumb -mfloat-abi=hard -mfpu=vfpv3xd -ffunction-sections -fdata-sections -fcallgraph-info=su,$(FREESTANDING) -fno-tree-loop-distribute-patterns,-nostdlib -static -T $(ZCU102)/zcu102.ld -Wl$(comma)--gc-sections -Wl$(comma)--fatal-warnings))
$(cortex_r5_zcu102_DIR)/controller.elf: $(ZCU102)/zcu102.ld

ZCU102_BRIDGE_SRC := $(wildcard $(ZCU102)/bridge/*.[cS]) firmware/drivers/xilinx_can.c firmware/drivers/can_timing.c \
  $(addprefix firmware/ports/arm/,semihosting.c streams.c memory.c)
ifneq ($(and $(shell command -v clang 2>/dev/null),$(shell command -v ld.lld 2>/dev/null)),)
PORTS += $(B)/firmware/cortex_r5_zcu102/bridge.elf
else
PORTS += without-zcu102-bridge
endif
.PHONY: without-zcu102-bridge
without-zcu102-bridge:
	@echo '  the bridge of cortex_r5_zcu102 is left out: clang and lld are not installed'
$(B)/firmware/cortex_r5_zcu102/bridge.elf: $(ZCU102_BRIDGE_SRC) $(wildcard $(ZCU102)/*.h firmware/drivers/*.h) $(ZCU102)/bridge/bridge.ld
	@mkdir -p $(@D)
	$(call say,LINK,$@)
	$(Q)clang --target=aarch64-none-elf -mcpu=cortex-a53 -mgeneral-regs-only -std=c11 -O2 -g $(WARN) -ffreestanding -fno-builtin \
	  -Ishared -Ifirmware -nostdlib -static -fuse-ld=lld -T $(ZCU102)/bridge/bridge.ld $(ZCU102_BRIDGE_SRC) -o $@
