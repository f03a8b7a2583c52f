/* Arm's semihosting: the debugger or emulator does a few calls of an operating system for the program ("Semihosting for
 * AArch32 and AArch64", Arm 100863), on any Arm processor. Without one attached, every call is a fault. */
#ifndef TROCAR_SEMIHOSTING_H
#define TROCAR_SEMIHOSTING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SEMIHOSTING_READ = 1, SEMIHOSTING_WRITE = 5 }; /* fopen's "rb" and "wb" */

/* A handle, or -1. */
int32_t semihosting_open(const char *path, uint32_t mode);
/* Bytes read; fewer than asked at the end of a file, or when a pipe has no more at the moment. 0: the end, or an error. */
size_t semihosting_read(int32_t handle, void *bytes, size_t length);
bool semihosting_write(int32_t handle, const void *bytes, size_t length);
/* The arguments as one line, spaces between. False: none, or too long. */
bool semihosting_command_line(char *line, size_t room);
/* Text for the person at the terminal; a number in decimal or as 8 hexadecimal digits. */
void semihosting_print(const char *text);
void semihosting_print_decimal(uint32_t number);
void semihosting_print_hexadecimal(uint32_t number);
/* A name, and the number as 8 hexadecimal digits. */
void semihosting_print_register(const char *name, uint32_t value);
/* End the emulation; `code` is the emulator's exit code. */
_Noreturn void semihosting_exit(int code);

#endif
