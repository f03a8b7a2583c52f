// Processor A53 number 0 at exception level 3, as a boot loader finds it: a stack, then the bridge.
    .section .start, "ax"
    .global bridge_start
bridge_start:
    ldr x0, =bridge_stack_top
    mov sp, x0
    bl  bridge_main
1:  wfi
    b   1b

// long bridge_power_on(long processor, long entry): start an R5 through PSCI's CPU_ON, which QEMU itself answers. SCR_EL3 says
// non-secure and lower levels in AArch32, or it would start the R5 in AArch64.
    .text
    .global bridge_power_on
bridge_power_on:
    mov x2, x1
    mov x1, x0
    mov x0, #1
    msr scr_el3, x0
    isb
    ldr x0, =0x84000003
    mov x3, #0
    smc #0
    ret
