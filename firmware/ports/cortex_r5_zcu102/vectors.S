// Exception vectors of a Cortex-R5F at address 0, and the way from reset to start(). In Arm state, as the processor starts.
    .syntax unified
    .arm
    .fpu vfpv3xd
    .section .vectors, "ax"
    .global vectors
vectors:
    b   reset
    b   undefined
    b   supervisor_call
    b   prefetch_abort
    b   data_abort
    b   .              // reserved
    b   interrupt
    b   interrupt

// Paint the loop's stack, which is not in use yet, and move onto it, in system mode.
reset:
    cpsid if, #31
    mrc p15, 0, r0, c1, c0, 0 // SCTLR.V: the vectors are here, not at 0xFFFF0000, however the chip was strapped
    bic r0, r0, #(1 << 13)
    mcr p15, 0, r0, c1, c0, 0
    mrc p15, 0, r0, c1, c0, 2 // CPACR: access to the FPU
    orr r0, r0, #(15 << 20)
    mcr p15, 0, r0, c1, c0, 2
    isb
    mov r0, #0x40000000
    vmsr fpexc, r0
    mov r0, #0         // to nearest, denormals kept
    vmsr fpscr, r0
    ldr r0, =memory_stack
    ldr r1, =memory_stack_top
    ldr r2, =0xA5C3A5C3
1:  str r2, [r0], #4
    cmp r0, r1
    blo 1b
    mov sp, r1
    ldr r0, =start
    bx  r0

// r0: which; r1: the address of the instruction. The banked stack pointers are set here, as none of these returns.
    .macro report which, behind
    ldr sp, =memory_handler_stack_top
    sub r1, lr, #\behind
    mov r0, #\which
    ldr r2, =report_fault
    bx  r2
    .endm
undefined:
    report 0, 4
supervisor_call:
    report 1, 4
prefetch_abort:
    report 2, 4
data_abort:
    report 3, 8
interrupt:
    report 4, 4
    .ltorg
