# Compiles and links with nothing around it: no C library, no start-up code of the compiler's.
$(eval $(call port,blank,gcc,,$(FREESTANDING) -fno-tree-loop-distribute-patterns,-nostdlib -static -no-pie -Wl$(comma)-e$(comma)blank_main))
