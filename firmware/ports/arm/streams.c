#include "streams.h"

#include "semihosting.h"

enum { COMMAND_LINE = 512, BATCH = 64 };

static int32_t in, out;
static struct lockstep_record read_ahead[BATCH], written[BATCH];
static size_t read_first, read_bytes; /* records taken; bytes that are there */
static size_t written_count;

int streams_open(void)
{
    static char line[COMMAND_LINE];
    char *second = line;
    bool good = semihosting_command_line(line, sizeof line);
    while (*second && *second != ' ') /* bound: COMMAND_LINE */
        second++;
    if (!good || !*second || !second[1]) {
        semihosting_print("usage: -semihosting-config enable=on,target=native,arg=IN,arg=OUT\n");
        return 2;
    }
    *second++ = 0;
    char *end = second;
    while (*end && *end != ' ') /* bound: COMMAND_LINE */
        end++;
    *end = 0;
    in = semihosting_open(line, SEMIHOSTING_READ);
    out = semihosting_open(second, SEMIHOSTING_WRITE);
    if (in < 0 || out < 0) {
        semihosting_print(in < 0 ? "controller: the input cannot be opened\n"
                                 : "controller: the output cannot be opened\n");
        return 3;
    }
    return 0;
}

bool streams_flush(void)
{
    bool good = written_count == 0 || semihosting_write(out, written, written_count * sizeof written[0]);
    written_count = 0;
    return good;
}

bool streams_write(struct lockstep_record record)
{
    if (written_count == BATCH && !streams_flush())
        return false;
    written[written_count++] = record;
    return true;
}

const struct lockstep_record *streams_next(void)
{
    unsigned char *bytes = (unsigned char *)read_ahead;
    if (read_bytes / sizeof read_ahead[0] == read_first) { /* what is left is a record that has come in part */
        size_t taken = read_first * sizeof read_ahead[0];
        read_bytes -= taken;
        for (size_t i = 0; i < read_bytes; i++) /* bound: LOCKSTEP_RECORD - 1 */
            bytes[i] = bytes[taken + i];
        read_first = 0;
    }
    while (read_bytes < sizeof read_ahead[0]) { /* bound: LOCKSTEP_RECORD, as each read brings a byte */
        size_t got = semihosting_read(in, bytes + read_bytes, sizeof read_ahead - read_bytes);
        if (got == 0)
            return 0;
        read_bytes += got;
    }
    return &read_ahead[read_first++];
}
