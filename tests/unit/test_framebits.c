/* The length of a frame on the bus against hand-made values and a second construction by strings. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "framebits.h"

static uint64_t seed = 424242;

static uint32_t random32(void)
{
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(seed >> 32);
}

static void the_crc_has_the_published_check_value(void **state)
{
    (void)state;
    /* "123456789" -> 0x059E: CRC-15/CAN in the catalogue of parametrised CRC algorithms (reveng) */
    uint8_t bits[72];
    for (unsigned i = 0; i < 72; i++)
        bits[i] = "123456789"[i / 8] >> (7 - i % 8) & 1;
    assert_int_equal(framebits_crc15(bits, 72), 0x059e);
}

static void worst_cases_are_those_of_the_literature(void **state)
{
    (void)state;
    /* Davis et al. 2007: 55 + 10 n with 11-bit identifiers, 80 + 10 n with 29 */
    for (unsigned n = 0; n <= 8; n++) {
        assert_int_equal(framebits_worst(n, false), 55 + 10 * n);
        assert_int_equal(framebits_worst(n, true), 80 + 10 * n);
    }
}

static void frames_counted_by_hand_agree(void **state)
{
    (void)state;
    /* identifier 0 without data: SOF to DLC are 19 zeros, and so is the CRC, for zeros leave it 0: 34 zeros. A one comes
     * behind every fifth: 6 of them (30 zeros, 4 left). 34 + 6 + 13 */
    struct can_frame_t frame = {.id = 0};
    assert_int_equal(framebits(&frame), 53);
    /* no run of five up to the CRC: SOF 0, id 101 0101 0101, RTR IDE r0 000, DLC 0001, data 0x55 = 0101 0101:
     * 0 10101010101 000 0001 01010101 has a run of 6 zeros (000 and 000): 1 bit; the CRC decides the rest, so only the
     * bounds are known by hand */
    frame = (struct can_frame_t){.id = 0x555, .length = 1, .data = {0x55}};
    assert_in_range(framebits(&frame), 42 + 13 + 1, framebits_worst(1, false));
    /* a remote frame that asks for 8 bytes carries none */
    frame = (struct can_frame_t){.id = 0x555, .length = 8, .flags = CAN_FLAG_RTR};
    assert_in_range(framebits(&frame), 47, 55);
    frame = (struct can_frame_t){.length = 9};
    assert_int_equal(framebits(&frame), 0);
    frame = (struct can_frame_t){.flags = CAN_FLAG_FD};
    assert_int_equal(framebits(&frame), 0);
}

static void text_bits(char *text, uint32_t value, int bits)
{
    char *end = text + strlen(text);
    for (int i = bits - 1; i >= 0; i--)
        *end++ = value >> i & 1 ? '1' : '0';
    *end = '\0';
}

/* The same in another way: the frame as text, its CRC as the remainder of a long division by x^15 + x^14 + x^10 + x^8 +
 * x^7 + x^4 + x^3 + 1, the stuff bits written into a second text. */
static unsigned bits_by_text(const struct can_frame_t *frame)
{
    char text[200] = "0";
    const unsigned remote = frame->flags & CAN_FLAG_RTR ? 1 : 0;
    if (frame->flags & CAN_FLAG_EXTENDED) {
        text_bits(text, frame->id >> 18, 11);
        strcat(text, "11");
        text_bits(text, frame->id, 18);
        text_bits(text, remote, 1);
        strcat(text, "00");
    } else {
        text_bits(text, frame->id, 11);
        text_bits(text, remote, 1);
        strcat(text, "00");
    }
    text_bits(text, frame->length, 4);
    for (unsigned i = 0; i < frame->length && !remote; i++)
        text_bits(text, frame->data[i], 8);
    static const char divisor[] = "1100010110011001";
    char work[220];
    snprintf(work, sizeof work, "%s000000000000000", text);
    const size_t n = strlen(text);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; work[i] == '1' && k < 16; k++)
            if (k > 0)
                work[i + k] = work[i + k] == divisor[k] ? '0' : '1';
    strcat(text, work + n);
    char stuffed[260] = "";
    size_t out = 0;
    for (const char *at = text; *at; at++) {
        stuffed[out++] = *at;
        if (out >= 5 && memcmp(stuffed + out - 5, *at == '1' ? "11111" : "00000", 5) == 0)
            stuffed[out++] = *at == '1' ? '0' : '1';
    }
    return (unsigned)out + 13;
}

static void random_frames_agree_with_a_second_construction(void **state)
{
    (void)state;
    print_message("# seed %llu\n", (unsigned long long)seed);
    unsigned longest = 0;
    for (int round = 0; round < 200000; round++) {
        struct can_frame_t frame = {.length = (uint8_t)(random32() % 9)};
        frame.flags = (uint8_t)(random32() % 4 == 0 ? CAN_FLAG_EXTENDED : 0) | (random32() % 8 == 0 ? CAN_FLAG_RTR : 0);
        frame.id = random32() & (frame.flags & CAN_FLAG_EXTENDED ? 0x1fffffff : 0x7ff);
        static const uint8_t runs[] = {0x00, 0xff, 0x0f, 0xf0, 0x1f, 0xe0, 0x87, 0x78, 0xc3, 0x3c};
        for (int i = 0; i < 8; i++) /* half of them with long runs, which random bytes seldom have */
            frame.data[i] = round % 2 ? (uint8_t)random32() : runs[random32() % sizeof runs];
        const unsigned bits = framebits(&frame);
        assert_int_equal(bits, bits_by_text(&frame));
        const bool remote = frame.flags & CAN_FLAG_RTR;
        assert_in_range(bits, (frame.flags & CAN_FLAG_EXTENDED ? 67 : 47) + (remote ? 0 : 8 * frame.length),
                        framebits_worst(remote ? 0 : frame.length, frame.flags & CAN_FLAG_EXTENDED));
        if (bits > longest && !(frame.flags & CAN_FLAG_EXTENDED))
            longest = bits;
    }
    print_message("# longest standard frame seen: %u bits of at most %u\n", longest, framebits_worst(8, false));
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_crc_has_the_published_check_value),
        cmocka_unit_test(worst_cases_are_those_of_the_literature),
        cmocka_unit_test(frames_counted_by_hand_agree),
        cmocka_unit_test(random_frames_agree_with_a_second_construction),
    };
    return cmocka_run_group_tests_name("framebits", tests, NULL, NULL);
}
