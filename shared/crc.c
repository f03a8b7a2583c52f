#include "crc.h"

/* Half-byte tables: 64 bytes of flash instead of 1 KiB; two look-ups per byte. */
static const uint32_t crc32_nibble[16] = {
    0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4, 0x4db26158, 0x5005713c,
    0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c, 0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c,
};

uint32_t crc32_update(uint32_t crc, const void *bytes, size_t length)
{
    const uint8_t *p = bytes;
    crc = ~crc;
    for (size_t i = 0; i < length; i++) { /* bound: length */
        crc ^= p[i];
        crc = (crc >> 4) ^ crc32_nibble[crc & 15];
        crc = (crc >> 4) ^ crc32_nibble[crc & 15];
    }
    return ~crc;
}

static uint8_t crc8_update(uint8_t crc, const void *bytes, size_t length)
{
    const uint8_t *p = bytes;
    for (size_t i = 0; i < length; i++) { /* bound: length */
        crc ^= p[i];
        for (int bit = 0; bit < 8; bit++) /* bound: 8 */
            crc = (uint8_t)((crc & 0x80) ? (crc << 1) ^ 0x2F : crc << 1);
    }
    return crc;
}

uint8_t crc8(const void *bytes, size_t length)
{
    return (uint8_t)~crc8_update(0xFF, bytes, length);
}

uint8_t crc8_frame(uint32_t id, const void *bytes, size_t length)
{
    const uint8_t head[2] = {(uint8_t)id, (uint8_t)(id >> 8)};
    return (uint8_t)~crc8_update(crc8_update(0xFF, head, sizeof head), bytes, length);
}
