#include "slcan.h"

#include <string.h>

static const char digits[] = "0123456789ABCDEF";

static size_t put(char *line, size_t at, uint32_t value, unsigned count)
{
    while (count-- > 0)
        line[at++] = digits[value >> 4 * count & 15];
    return at;
}

size_t slcan_format(const struct can_frame_t *frame, char line[SLCAN_LINE])
{
    const bool extended = frame->flags & CAN_FLAG_EXTENDED, remote = frame->flags & CAN_FLAG_RTR;
    if (frame->flags & (CAN_FLAG_FD | CAN_FLAG_ERROR) || frame->length > 8)
        return 0;
    size_t n = 0;
    line[n++] = extended ? (remote ? 'R' : 'T') : (remote ? 'r' : 't');
    n = put(line, n, frame->id, extended ? 8 : 3);
    n = put(line, n, frame->length, 1);
    for (unsigned i = 0; i < frame->length && !remote; i++)
        n = put(line, n, frame->data[i], 2);
    line[n++] = '\r';
    line[n] = '\0';
    return n;
}

/* `count` digits from `at` on; false when one is none. */
static bool get(const char *line, size_t at, unsigned count, uint32_t *value)
{
    *value = 0;
    while (count-- > 0) {
        char c = line[at++];
        c = c >= 'a' && c <= 'f' ? (char)(c - 'a' + 'A') : c;
        const char *digit = c ? strchr(digits, c) : NULL;
        if (!digit)
            return false;
        *value = *value << 4 | (uint32_t)(digit - digits);
    }
    return true;
}

static enum slcan_meaning parse_frame(const char *line, size_t length, struct can_frame_t *frame)
{
    const bool extended = line[0] == 'T' || line[0] == 'R', remote = line[0] == 'r' || line[0] == 'R';
    const unsigned id_digits = extended ? 8 : 3;
    uint32_t id, bytes, byte;
    if (length < 1 + id_digits + 1 || !get(line, 1, id_digits, &id) || !get(line, 1 + id_digits, 1, &bytes) ||
        bytes > 8 || id > (extended ? 0x1fffffffu : 0x7ffu))
        return SLCAN_MALFORMED;
    const size_t start = 2 + id_digits, end = start + (remote ? 0 : 2 * bytes);
    if (length != end && (length != end + 4 || !get(line, end, 4, &byte))) /* with or without a time */
        return SLCAN_MALFORMED;
    *frame = (struct can_frame_t){.id = id,
                                  .length = (uint8_t)bytes,
                                  .flags = (uint8_t)((extended ? CAN_FLAG_EXTENDED : 0) | (remote ? CAN_FLAG_RTR : 0))};
    for (size_t at = start; at < end; at += 2) {
        if (!get(line, at, 2, &byte))
            return SLCAN_MALFORMED;
        frame->data[(at - start) / 2] = (uint8_t)byte;
    }
    return SLCAN_FRAME;
}

enum slcan_meaning slcan_parse(const char *line, size_t length, struct can_frame_t *frame)
{
    if (length == 0 || (length == 1 && (line[0] == 'z' || line[0] == 'Z')))
        return SLCAN_NOTHING;
    switch (line[0]) {
    case 't':
    case 'T':
    case 'r':
    case 'R':
        return parse_frame(line, length, frame);
    case 'S': /* commands, and the adapter's answers to V, v, N, F */
    case 's':
    case 'O':
    case 'L':
    case 'C':
    case 'V':
    case 'v':
    case 'N':
    case 'F':
    case 'M':
    case 'm':
    case 'X':
    case 'Z':
        return SLCAN_COMMAND;
    default:
        return SLCAN_MALFORMED;
    }
}

int slcan_rate(uint32_t bit_rate)
{
    static const uint32_t rates[] = {10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000};
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++)
        if (rates[i] == bit_rate)
            return (int)i;
    return -1;
}
