#include "framebits_fd.h"

#include <stdint.h>

enum { NOMINAL_HEAD = 17, NOMINAL_TAIL = 13, LONGEST = 22 + 8 * 64 };

static const uint8_t lengths[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

struct bit_row {
    uint8_t bit[LONGEST];
    unsigned count;
};

static void append(struct bit_row *row, uint32_t value, unsigned bits)
{
    while (bits > 0)
        row->bit[row->count++] = value >> --bits & 1;
}

/* The DLC whose length is at least `length`. */
static unsigned code_of(unsigned length)
{
    unsigned code = 0;
    while (code < 15 && lengths[code] < length)
        code++;
    return code;
}

/* Stuff count, CRC and fixed stuff bits. */
static unsigned check_bits(unsigned length)
{
    return length <= 16 ? 4 + 17 + 6 : 4 + 21 + 7;
}

bool framebits_fd(const struct can_frame_t *frame, struct framebits_fd *bits)
{
    const unsigned code = code_of(frame->length);
    if (frame->flags & (CAN_FLAG_RTR | CAN_FLAG_ERROR | CAN_FLAG_EXTENDED) || frame->length != lengths[code])
        return false;
    struct bit_row row = {.count = 0};
    append(&row, 0, 1); /* SOF */
    append(&row, frame->id & 0x7ff, 11);
    append(&row, 5, 5); /* RRS 0, IDE 0, FDF 1, res 0, BRS 1 */
    append(&row, 0, 1); /* ESI */
    append(&row, code, 4);
    for (unsigned i = 0; i < frame->length; i++)
        append(&row, frame->data[i], 8);
    *bits = (struct framebits_fd){NOMINAL_HEAD + NOMINAL_TAIL, row.count - NOMINAL_HEAD + check_bits(frame->length)};
    unsigned run = 0;
    int last = -1;
    for (unsigned i = 0; i + 1 < row.count; i++) {
        run = row.bit[i] == last ? run + 1 : 1;
        last = row.bit[i];
        if (run < 5)
            continue;
        (*(i < NOMINAL_HEAD ? &bits->nominal : &bits->data))++;
        run = 1;
        last = !last;
    }
    return true;
}

struct framebits_fd framebits_fd_worst(unsigned length)
{
    const unsigned bytes = lengths[code_of(length)];
    return (struct framebits_fd){NOMINAL_HEAD + 3 + NOMINAL_TAIL, 5 + 8 * bytes + 1 + 2 * bytes + check_bits(bytes)};
}

double framebits_fd_us(struct framebits_fd bits, double nominal_rate, double data_rate)
{
    return 1e6 * (bits.nominal / nominal_rate + bits.data / data_rate);
}
