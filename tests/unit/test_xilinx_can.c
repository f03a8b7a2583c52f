/* The driver of the Zynq's CAN controller on a model of its registers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "random.h"
#include "xilinx_can_model.h"

#include "drivers/can_timing.c"
#include "drivers/xilinx_can.c"

static struct xilinx_can_registers *const registers = (struct xilinx_can_registers *)(void *)model.block;

static const struct xilinx_can_settings settings = {
    .clock_Hz = 100000000, .bit_rate = 1000000, .filters = 2, .filter = {{0x181, 0x7FF}, {0x000, 0x7FF}}};

static void open(struct xilinx_can *c)
{
    model_power_on();
    assert_true(xilinx_can_start(c, registers, &settings));
    model_run(12);
}

static struct can_frame_t frame_of(uint32_t id, unsigned length, uint8_t first)
{
    struct can_frame_t f = {.id = id, .length = (uint8_t)length};
    for (unsigned i = 0; i < length; i++)
        f.data[i] = (uint8_t)(first + i);
    return f;
}

/* UG1085, "Message Format", bit by bit. */
static struct model_message message_of(const struct can_frame_t *f)
{
    struct model_message m = {{0}};
    bool extended = f->flags & CAN_FLAG_EXTENDED, remote = f->flags & CAN_FLAG_RTR;
    for (unsigned bit = 0; bit < 11; bit++)
        m.word[0] |= (f->id >> (extended ? 18 + bit : bit) & 1) << (21 + bit);
    for (unsigned bit = 0; extended && bit < 18; bit++)
        m.word[0] |= (f->id >> bit & 1) << (1 + bit);
    m.word[0] |= (extended || remote ? 1u : 0) << 20 | (extended ? 1u : 0) << 19 | (extended && remote ? 1u : 0);
    m.word[1] = (uint32_t)f->length << 28;
    for (unsigned i = 0; i < f->length; i++)
        m.word[2 + i / 4] |= (uint32_t)f->data[i] << (8 * (3 - i % 4));
    return m;
}

static void hear(uint32_t id, unsigned length, uint8_t first)
{
    struct can_frame_t f = frame_of(id, length, first);
    model_hear(message_of(&f));
}

static void a_bit_takes_a_microsecond_and_is_sampled_where_canopen_wants_it(void **state)
{
    (void)state;
    struct xilinx_can c;
    static const uint32_t clocks[] = {100000000, 99000000, 80000000, 40000000, 24000000, 20000000, 8000000, 60000000};
    for (size_t i = 0; i < sizeof clocks / sizeof clocks[0]; i++) {
        struct xilinx_can_settings s = settings;
        s.clock_Hz = clocks[i];
        model_power_on();
        assert_true(xilinx_can_start(&c, registers, &s));
        uint32_t brp = model.block[2] + 1, ts1 = (model.block[3] & 15) + 1, ts2 = (model.block[3] >> 4 & 7) + 1;
        uint32_t sjw = (model.block[3] >> 7 & 3) + 1;
        assert_int_equal(clocks[i], 1000000 * brp * (1 + ts1 + ts2));
        double sample = (double)(1 + ts1) / (1 + ts1 + ts2);
        assert_true(sample >= 0.75 && sample <= 0.875);
        assert_true(sjw <= ts2);
        assert_int_equal(model.violations, 0);
        assert_int_equal(register_read(&registers->status) & 1, 0);
    }
}

static void what_cannot_be_is_refused(void **state)
{
    (void)state;
    struct xilinx_can c;
    struct xilinx_can_settings s = settings;
    model_power_on();
    s.clock_Hz = 7000000; /* 7 quanta */
    assert_false(xilinx_can_start(&c, registers, &s));
    s.clock_Hz = 33333333;
    assert_false(xilinx_can_start(&c, registers, &s));
    s = settings;
    s.bit_rate = 0;
    assert_false(xilinx_can_start(&c, registers, &s));
    s = settings;
    s.filters = 5;
    assert_false(xilinx_can_start(&c, registers, &s));
    model.absent = true;
    assert_false(xilinx_can_start(&c, registers, &settings));
}

static void frames_go_out_and_come_in_as_the_manual_lays_them_out(void **state)
{
    (void)state;
    struct xilinx_can c;
    struct xilinx_can_settings all = settings;
    all.filters = 0;
    model_power_on();
    assert_true(xilinx_can_start(&c, registers, &all));
    model_run(12);
    random_seed("frames", 1);
    for (int i = 0; i < 2000; i++) {
        struct can_frame_t f = {.length = (uint8_t)(random_bits() % 9)}, got;
        bool extended = random_bits() % 2;
        f.id = (uint32_t)random_bits() & (extended ? 0x1FFFFFFF : 0x7FF);
        f.flags = (uint8_t)((extended ? CAN_FLAG_EXTENDED : 0) | (random_bits() % 4 == 0 ? CAN_FLAG_RTR : 0));
        for (unsigned k = 0; k < f.length; k++)
            f.data[k] = (uint8_t)random_bits();
        struct model_message expected = message_of(&f);
        assert_true(i % 2 ? xilinx_can_transmit_urgent(&c, &f) : xilinx_can_transmit(&c, &f));
        model_run(200);
        assert_int_equal(model.sent_count, 1);
        assert_memory_equal(&model.sent[0], &expected, sizeof expected);
        model.sent_count = 0;
        model_hear(expected);
        assert_true(xilinx_can_receive(&c, &got));
        assert_memory_equal(&got, &f, sizeof f);
        assert_false(xilinx_can_receive(&c, &got));
    }
    struct can_frame_t fd = {.id = 1, .length = 12, .flags = CAN_FLAG_FD};
    assert_false(xilinx_can_transmit(&c, &fd));
    assert_int_equal(model.violations, 0);
}

static void only_what_the_filters_name_is_received(void **state)
{
    (void)state;
    struct xilinx_can c;
    struct can_frame_t f, got;
    open(&c);
    for (uint32_t id = 0; id < 0x800; id++)
        for (uint8_t flags = 0; flags < 16; flags++) {
            if (flags & (CAN_FLAG_FD | CAN_FLAG_ERROR))
                continue;
            f = (struct can_frame_t){.id = flags & CAN_FLAG_EXTENDED ? id << 18 : id, .length = 8, .flags = flags};
            model_hear(message_of(&f));
            bool expected = flags == 0 && (id == 0x181 || id == 0);
            assert_int_equal(xilinx_can_receive(&c, &got), expected);
        }
}

static void a_full_transmit_fifo_refuses_and_keeps_the_order(void **state)
{
    (void)state;
    struct xilinx_can c;
    open(&c);
    for (unsigned i = 0; i < 70; i++) {
        struct can_frame_t f = frame_of(0x700 + i, 8, (uint8_t)i);
        assert_int_equal(xilinx_can_transmit(&c, &f), i < XILINX_CAN_FIFO);
    }
    struct can_frame_t urgent = frame_of(0x201, 8, 99);
    assert_true(xilinx_can_transmit_urgent(&c, &urgent));
    model_run(70 * 135);
    assert_int_equal(model.sent_count, 65);
    assert_int_equal(model.sent[0].word[0] >> 21, 0x201);
    for (unsigned i = 0; i < 64; i++)
        assert_int_equal(model.sent[1 + i].word[0] >> 21, 0x700 + i);
    assert_int_equal(model.violations, 0);
}

static void a_receive_overflow_is_counted_and_what_fitted_is_read(void **state)
{
    (void)state;
    struct xilinx_can c;
    struct can_frame_t got;
    open(&c);
    for (unsigned round = 1; round <= 3; round++) {
        for (unsigned i = 0; i < 70; i++)
            hear(0x181, 8, (uint8_t)i);
        assert_int_equal(model.overflows, 6 * round);
        xilinx_can_poll(&c, 1000 * round);
        xilinx_can_poll(&c, 1000 * round + 1);
        assert_int_equal(c.errors.receive_overflows, round);
        for (unsigned i = 0; i < 64; i++) {
            assert_true(xilinx_can_receive(&c, &got));
            assert_int_equal(got.data[0], i);
        }
        assert_false(xilinx_can_receive(&c, &got));
    }
    hear(0x181, 8, 200);
    assert_true(xilinx_can_receive(&c, &got));
    assert_int_equal(got.data[0], 200);
    assert_int_equal(model.resets, 1);
}

static void error_passive_is_counted_at_each_entry_and_left_by_good_frames(void **state)
{
    (void)state;
    struct xilinx_can c;
    open(&c);
    uint64_t time_us = 0;
    for (unsigned round = 1; round <= 3; round++) {
        for (unsigned i = 0; i < 16; i++) {
            model_mishear();
            xilinx_can_poll(&c, ++time_us);
        }
        xilinx_can_poll(&c, ++time_us); /* and stays so */
        assert_int_equal(c.receive_errors, 128);
        assert_true(c.passive);
        assert_int_equal(c.errors.error_passive, round);
        for (unsigned i = 0; i < 200; i++) { /* also those that the filters turn away count as good */
            hear(0x7FF, 8, 0);
            xilinx_can_poll(&c, ++time_us);
        }
        assert_int_equal(c.receive_errors, 0);
        assert_false(c.passive);
        assert_int_equal(c.errors.error_passive, round);
    }
    assert_int_equal(model.passives, 3);
    assert_int_equal(c.errors.bus_off, 0);
    assert_int_equal(model.resets, 1); /* the one at the start */
}

static void bus_off_is_left_after_128_times_11_bits_and_nothing_old_is_sent(void **state)
{
    (void)state;
    struct xilinx_can c;
    open(&c);
    uint64_t start = model.bits;
    for (unsigned round = 1; round <= 3; round++) {
        model.spoilt = BUS_SHORTED;
        for (unsigned i = 0; i < 10; i++) {
            struct can_frame_t f = frame_of(0x100 + i, 8, 0);
            assert_true(xilinx_can_transmit(&c, &f));
        }
        while (model.bus_offs < round)
            model_run(50);
        xilinx_can_poll(&c, model.bits - start);
        assert_int_equal(c.errors.bus_off, round);
        uint64_t off_at = model.bits;
        model.spoilt = BUS_GOOD;
        unsigned sent = model.sent_count;
        struct can_frame_t refused = frame_of(0x2FF, 8, 0), fresh = frame_of(0x300 + round, 8, 0);
        while (c.off) {
            assert_false(xilinx_can_transmit(&c, &refused));
            assert_false(xilinx_can_transmit_urgent(&c, &refused));
            assert_int_equal(model.sent_count, sent);
            model_run(10);
            xilinx_can_poll(&c, model.bits - start);
        }
        assert_true(model.bits - off_at >= 128 * 11 && model.bits - off_at <= 128 * 11 + 20);
        assert_true(xilinx_can_transmit(&c, &fresh));
        model_run(2000);
        assert_int_equal(model.sent_count, sent + 1);
        assert_int_equal(model.sent[sent].word[0] >> 21, 0x300 + round);
        xilinx_can_poll(&c, model.bits - start);
        assert_int_equal(c.transmit_errors + c.receive_errors, 0);
        assert_int_equal(c.errors.bus_off, round);
        hear(0x181, 8, 7); /* the filters are there again */
        hear(0x182, 8, 8);
        struct can_frame_t got;
        assert_true(xilinx_can_receive(&c, &got) && got.data[0] == 7);
        assert_false(xilinx_can_receive(&c, &got));
    }
    assert_int_equal(model.violations, 0);
}

static void an_urgent_frame_that_waited_is_never_sent_late(void **state)
{
    (void)state;
    struct xilinx_can c;
    open(&c);
    struct can_frame_t old = frame_of(0x201, 8, 1), fresh = frame_of(0x201, 8, 2);
    model.spoilt = BUS_BUSY; /* no error: the fresh one replaces it */
    assert_true(xilinx_can_transmit_urgent(&c, &old));
    model_run(1000);
    xilinx_can_poll(&c, 1000);
    assert_true(xilinx_can_transmit_urgent(&c, &fresh));
    assert_int_equal(c.errors.aborted, 1);
    model.spoilt = BUS_GOOD;
    model_run(1000);
    assert_int_equal(model.sent_count, 1);
    assert_int_equal(model.sent[0].word[2] >> 24, 2);

    model.spoilt = BUS_UNHEARD; /* pulled cable */
    assert_true(xilinx_can_transmit_urgent(&c, &old));
    model_run(1000);
    xilinx_can_poll(&c, 3000);
    assert_false(xilinx_can_transmit_urgent(&c, &fresh));
    assert_int_equal(c.errors.aborted, 2);
    unsigned attempts = model.attempts;
    model.spoilt = BUS_GOOD;
    model_run(2000);
    assert_int_equal(model.sent_count, 1);
    assert_int_equal(model.attempts, attempts); /* silent */
    xilinx_can_poll(&c, 3000 + 128 * 11 - 1);
    assert_false(xilinx_can_transmit_urgent(&c, &fresh));
    xilinx_can_poll(&c, 3000 + 128 * 11);
    assert_true(xilinx_can_transmit_urgent(&c, &fresh));
    model_run(1000);
    assert_int_equal(model.sent_count, 2);
    assert_int_equal(model.sent[1].word[2] >> 24, 2);
    assert_int_equal(model.violations, 0);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bit_takes_a_microsecond_and_is_sampled_where_canopen_wants_it),
        cmocka_unit_test(what_cannot_be_is_refused),
        cmocka_unit_test(frames_go_out_and_come_in_as_the_manual_lays_them_out),
        cmocka_unit_test(only_what_the_filters_name_is_received),
        cmocka_unit_test(a_full_transmit_fifo_refuses_and_keeps_the_order),
        cmocka_unit_test(a_receive_overflow_is_counted_and_what_fitted_is_read),
        cmocka_unit_test(error_passive_is_counted_at_each_entry_and_left_by_good_frames),
        cmocka_unit_test(bus_off_is_left_after_128_times_11_bits_and_nothing_old_is_sent),
        cmocka_unit_test(an_urgent_frame_that_waited_is_never_sent_late),
    };
    return cmocka_run_group_tests_name("Xilinx CAN driver", tests, NULL, NULL);
}
