/* Checksums of the bank and of the bus. Bounded by the length given; no tables in RAM. */
#ifndef TROCAR_CRC_H
#define TROCAR_CRC_H

#include <stddef.h>
#include <stdint.h>

/* CRC-32 (ISO-HDLC: reflected 0x04C11DB7, initial and final value 0xFFFFFFFF), the one of zlib. Start with crc = 0 and
 * feed the result back to continue. crc32("123456789") = 0xCBF43926. */
uint32_t crc32_update(uint32_t crc, const void *bytes, size_t length);

/* CRC-8 AUTOSAR (0x2F, initial and final value 0xFF): Hamming distance 4 up to 119 bits, so that in a frame of eight
 * bytes every error of up to three bits is seen (Koopman's table for 0x97). crc8("123456789") = 0xDF. */
uint8_t crc8(const void *bytes, size_t length);

/* The same over the identifier's low and high byte, then `length` <= 62 bytes: a frame that arrives under another's
 * identifier is seen as well, and with eight bytes of data in all (72 bits) the distance is still 4. */
uint8_t crc8_frame(uint32_t id, const void *bytes, size_t length);

#endif
