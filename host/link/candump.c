#include "candump.h"

#include <ctype.h>
#include <inttypes.h>
#include <stdbool.h>
#include <string.h>

#include "progress.h"

static const uint32_t error_bit = 0x20000000; /* CAN_ERR_FLAG of SocketCAN */

size_t candump_format(char line[CANDUMP_LINE], const char *interface, const struct can_frame_t *frame, uint64_t time_us)
{
    const bool extended = frame->flags & (CAN_FLAG_EXTENDED | CAN_FLAG_ERROR);
    const uint32_t id = frame->id | (frame->flags & CAN_FLAG_ERROR ? error_bit : 0);
    int n = snprintf(line, CANDUMP_LINE, "(%010" PRIu64 ".%06" PRIu64 ") %.*s %0*" PRIX32 "#", time_us / 1000000,
                     time_us % 1000000, CANDUMP_INTERFACE - 1, interface, extended ? 8 : 3, id);
    if (frame->flags & CAN_FLAG_RTR) {
        n += frame->length ? sprintf(line + n, "R%u", frame->length) : sprintf(line + n, "R");
    } else {
        if (frame->flags & CAN_FLAG_FD)
            n += sprintf(line + n, "#0");
        for (unsigned i = 0; i < frame->length && i < sizeof frame->data; i++)
            n += sprintf(line + n, "%02X", frame->data[i]);
    }
    line[n++] = '\n';
    line[n] = '\0';
    return (size_t)n;
}

int candump_write(FILE *out, const char *interface, const struct can_frame_t *frame, uint64_t time_us,
                  struct failure *why)
{
    char line[CANDUMP_LINE];
    const size_t n = candump_format(line, interface, frame, time_us);
    if (fwrite(line, 1, n, out) != n)
        return failure_set(why, STATUS_FILE_WRITE, NULL, "", "the recording could not be written");
    return STATUS_OK;
}

/* Digits at *at as a number; false without any, or above `maximum`. Moves *at behind them. */
static bool decimal(const char **at, uint64_t maximum, uint64_t *value)
{
    const char *start = *at;
    for (*value = 0; isdigit((unsigned char)**at); (*at)++) {
        const uint64_t digit = (uint64_t)(**at - '0');
        if (digit > maximum || *value > (maximum - digit) / 10)
            return false;
        *value = *value * 10 + digit;
    }
    return *at > start;
}

static int hex_digit(char c)
{
    return isdigit((unsigned char)c) ? c - '0' : isxdigit((unsigned char)c) ? toupper((unsigned char)c) - 'A' + 10 : -1;
}

static const char *parse_time(const char **at, uint64_t *time_us)
{
    uint64_t seconds, micros;
    if (*(*at)++ != '(' || !decimal(at, UINT64_MAX / 1000000 - 1, &seconds) || *(*at)++ != '.')
        return "the line does not begin with (SECONDS.MICROSECONDS)";
    const char *start = *at;
    if (!decimal(at, 999999, &micros) || *at - start != 6 || *(*at)++ != ')')
        return "the time does not have six digits behind its point";
    if (*(*at)++ != ' ')
        return "a space is missing behind the time";
    *time_us = seconds * 1000000 + micros;
    return NULL;
}

static const char *parse_id(const char **at, struct can_frame_t *frame)
{
    int digits = 0;
    for (; hex_digit(**at) >= 0 && digits < 9; (*at)++, digits++)
        frame->id = frame->id << 4 | (uint32_t)hex_digit(**at);
    if (*(*at)++ != '#' || (digits != 3 && digits != 8))
        return "the identifier does not have 3 or 8 hexadecimal digits before its #";
    if (digits == 8) {
        frame->flags |= frame->id & error_bit ? CAN_FLAG_ERROR : CAN_FLAG_EXTENDED;
        frame->id &= ~error_bit;
    }
    return frame->id > (digits == 3 ? 0x7ffu : 0x1fffffffu) ? "the identifier is too large" : NULL;
}

static const char *parse_data(const char **at, struct can_frame_t *frame)
{
    if (**at == 'R') {
        uint64_t length = 0;
        (*at)++;
        if (isdigit((unsigned char)**at) && !decimal(at, 8, &length))
            return "a remote frame asks for more than eight bytes";
        frame->flags |= CAN_FLAG_RTR;
        frame->length = (uint8_t)length;
        return NULL;
    }
    unsigned room = 8;
    if (**at == '#') {
        if (hex_digit(*++*at) < 0)
            return "the flags of an FD frame are missing";
        (*at)++;
        frame->flags |= CAN_FLAG_FD;
        room = 64;
    }
    for (; hex_digit(**at) >= 0; *at += 2) {
        if (frame->length == room)
            return room == 8 ? "there are more than eight bytes" : "there are more than 64 bytes";
        if (hex_digit((*at)[1]) < 0)
            return "a byte has only one digit";
        frame->data[frame->length++] = (uint8_t)(hex_digit((*at)[0]) << 4 | hex_digit((*at)[1]));
    }
    static const uint8_t long_lengths[] = {12, 16, 20, 24, 32, 48, 64};
    if (frame->length > 8 && !memchr(long_lengths, frame->length, sizeof long_lengths))
        return "an FD frame cannot have this length";
    return NULL;
}

static const char *parse_line(const char *at, struct candump_record *record)
{
    const char *wrong = parse_time(&at, &record->time_us);
    if (wrong)
        return wrong;
    const size_t n = strcspn(at, " \n");
    if (n == 0 || n >= CANDUMP_INTERFACE || at[n] != ' ')
        return "the interface does not have 1 to 15 characters followed by a space";
    memcpy(record->interface, at, n);
    at += n + 1;
    wrong = parse_id(&at, &record->frame);
    if (!wrong)
        wrong = parse_data(&at, &record->frame);
    if (wrong)
        return wrong;
    if (at[0] == ' ' && (at[1] == 'R' || at[1] == 'T'))
        at += 2;
    at += *at == '\r';
    at += *at == '\n';
    return *at ? "there is something behind the frame" : NULL;
}

int candump_parse(const char *line, const char *file, long number, struct candump_record *record, struct failure *why)
{
    memset(record, 0, sizeof *record);
    const char *wrong = parse_line(line, record);
    return wrong ? failure_at(why, STATUS_BUS_LOG, file, number, "", "%s", wrong) : STATUS_OK;
}

int candump_read(FILE *in, const char *file, long *number, struct candump_record *record, struct failure *why)
{
    char line[CANDUMP_LINE + 1];
    for (;;) {
        if (interrupted())
            return failure_set(why, STATUS_INTERRUPTED, file, "", "reading the recording was interrupted");
        /* read by character, for fgets does not tell a NUL byte from the end of the text */
        size_t n = 0;
        int c;
        while ((c = getc(in)) != EOF && n < CANDUMP_LINE) {
            line[n++] = (char)c;
            if (c == '\n')
                break;
        }
        line[n] = '\0';
        if (c == EOF && ferror(in))
            return failure_at(why, STATUS_FILE_READ, file, *number + 1, "", "the recording cannot be read");
        if (n == 0)
            return 0;
        ++*number;
        if (memchr(line, '\0', n) || (line[n - 1] != '\n' && c != EOF))
            return failure_at(why, STATUS_BUS_LOG, file, *number, "", "the line is not text, or is longer than %d",
                              CANDUMP_LINE);
        if (line[0] == '\n')
            continue;
        const int status = candump_parse(line, file, *number, record, why);
        return status < 0 ? status : 1;
    }
}
