/* CRC-32 against zlib, both CRCs against the check values of their definitions and against a bit-by-bit division. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>
#include <zlib.h>

#include "crc.h"
#include "random.h"

static void check_values(void **state)
{
    (void)state;
    assert_int_equal(crc32_update(0, "123456789", 9), 0xCBF43926);
    assert_int_equal(crc8("123456789", 9), 0xDF);
    assert_int_equal(crc8_frame(0x3231, "3456789", 7), 0xDF);
    assert_int_equal(crc32_update(0, "", 0), 0);
}

static void crc32_is_zlibs_also_in_pieces(void **state)
{
    (void)state;
    random_seed("crc32", 1);
    static unsigned char bytes[5000];
    for (int round = 0; round < 300; round++) {
        size_t length = random_below(sizeof bytes + 1), cut = random_below((unsigned)length + 1);
        for (size_t k = 0; k < length; k++)
            bytes[k] = (unsigned char)random_bits();
        uint32_t whole = crc32_update(0, bytes, length);
        assert_int_equal(whole, crc32(0, bytes, (uInt)length));
        assert_int_equal(crc32_update(crc32_update(0, bytes, cut), bytes + cut, length - cut), whole);
    }
}

/* Remainder of the message (first byte complemented by the initial value) times x^8 by x^8+x^5+x^3+x^2+x+1. */
static uint8_t divided(const uint8_t *bytes, size_t length)
{
    unsigned remainder = 0;
    for (size_t bit = 0; bit < 8 * (length + 1); bit++) {
        size_t k = bit / 8;
        unsigned value = k < length ? bytes[k] : 0;
        if (k == 0)
            value ^= 0xFF;
        remainder = remainder << 1 | (value >> (7 - bit % 8) & 1);
        if (remainder & 0x100)
            remainder ^= 0x12F;
    }
    return (uint8_t)(remainder ^ 0xFF);
}

static void crc8_is_the_remainder_of_a_division(void **state)
{
    (void)state;
    random_seed("crc8", 2);
    for (int round = 0; round < 2000; round++) {
        uint8_t bytes[64];
        size_t length = 1 + random_below(sizeof bytes);
        for (size_t k = 0; k < length; k++)
            bytes[k] = (uint8_t)random_bits();
        assert_int_equal(crc8(bytes, length), divided(bytes, length));
    }
}

/* The claim of crc.h for a torque frame, its identifier's 16 bits, seven bytes and the CRC: by linearity it is enough that
 * no pattern of up to three flipped bits has the CRC of no flip. */
static void crc8_sees_every_error_of_up_to_three_bits_in_a_frame(void **state)
{
    (void)state;
    enum { BITS = 80 };
    const uint8_t zero[7] = {0};
    uint8_t clean = crc8_frame(0, zero, 7);
    for (int a = 0; a < BITS; a++)
        for (int b = a; b < BITS; b++)
            for (int c = b; c < BITS; c++) {
                uint8_t frame[10] = {0}; /* identifier, data, CRC */
                int bit[3] = {a, b, c};
                frame[9] = clean;
                for (int k = 0; k < 3; k++) /* equal positions: fewer flips */
                    if (k == 0 || bit[k] != bit[k - 1])
                        frame[bit[k] / 8] ^= (uint8_t)(1 << bit[k] % 8);
                uint32_t id = frame[0] | (uint32_t)frame[1] << 8;
                assert_int_not_equal(crc8_frame(id, frame + 2, 7), frame[9]);
            }
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(check_values),
        cmocka_unit_test(crc32_is_zlibs_also_in_pieces),
        cmocka_unit_test(crc8_is_the_remainder_of_a_division),
        cmocka_unit_test(crc8_sees_every_error_of_up_to_three_bits_in_a_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
