#include "framebits.h"

enum { STUFFED_MAX = 54 + 64, TAIL = 13 };

struct bit_row {
    uint8_t bit[STUFFED_MAX];
    size_t count;
};

static void append(struct bit_row *row, uint32_t value, unsigned bits)
{
    while (bits > 0)
        row->bit[row->count++] = value >> --bits & 1;
}

uint16_t framebits_crc15(const uint8_t *bits, size_t count)
{
    uint16_t crc = 0;
    for (size_t i = 0; i < count; i++) {
        const unsigned carry = (crc >> 14 & 1u) ^ bits[i];
        crc = (uint16_t)((crc << 1 ^ (carry ? 0x4599u : 0u)) & 0x7fffu);
    }
    return crc;
}

static unsigned stuff_bits(const struct bit_row *row)
{
    unsigned stuffed = 0, run = 0;
    int last = -1;
    for (size_t i = 0; i < row->count; i++) {
        run = row->bit[i] == last ? run + 1 : 1;
        last = row->bit[i];
        if (run == 5) { /* the stuffed bit is the first of a new run */
            stuffed++;
            run = 1;
            last = !last;
        }
    }
    return stuffed;
}

unsigned framebits(const struct can_frame_t *frame)
{
    if (frame->flags & (CAN_FLAG_FD | CAN_FLAG_ERROR) || frame->length > 8)
        return 0;
    const bool remote = frame->flags & CAN_FLAG_RTR;
    struct bit_row row = {.count = 0};
    append(&row, 0, 1); /* SOF */
    if (frame->flags & CAN_FLAG_EXTENDED) {
        append(&row, frame->id >> 18 & 0x7ff, 11);
        append(&row, 3, 2); /* SRR, IDE */
        append(&row, frame->id & 0x3ffff, 18);
        append(&row, remote, 1);
        append(&row, 0, 2); /* r1, r0 */
    } else {
        append(&row, frame->id & 0x7ff, 11);
        append(&row, remote, 1);
        append(&row, 0, 2); /* IDE, r0 */
    }
    append(&row, frame->length, 4);
    for (unsigned i = 0; !remote && i < frame->length; i++)
        append(&row, frame->data[i], 8);
    append(&row, framebits_crc15(row.bit, row.count), 15);
    return (unsigned)row.count + stuff_bits(&row) + TAIL;
}

unsigned framebits_worst(unsigned length, bool extended)
{
    const unsigned stuffed = (extended ? 54 : 34) + 8 * length;
    return stuffed + TAIL + (stuffed - 1) / 4;
}
