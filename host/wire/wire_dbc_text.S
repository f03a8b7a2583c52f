/* The protocol file as text in the program, so that an installed trocar decodes without the checkout. The path is relative to
 * the checkout's root, from where make runs. */
    .section .rodata
    .global wire_dbc_text
wire_dbc_text:
    .incbin "shared/wire.dbc"
    .byte 0
    .section .note.GNU-stack, "", %progbits
