# The controller as a Linux process: same objects; bus and time in lockstep on standard input and output, or one of this machine.
$(eval $(call port,native,gcc,,-std=c11 -O2 -g -D_GNU_SOURCE $(WARN) -Ihost/link -Ihost/report,$(B)/libtrocar.a))
$(native_DIR)/controller.elf: $(B)/libtrocar.a
