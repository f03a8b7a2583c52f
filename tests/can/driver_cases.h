/* What every driver of a CAN controller must do, on the model of its registers. The test that includes this has defined before:
 * a struct driver with members errors (struct can_errors), off and passive; and
 *
 *   bool driver_start(d, filters)   1 Mbit/s; filters: 2 (0x181 and 0x000) or 0 (everything is received)
 *   driver_poll(d), driver_receive(d, frame), driver_transmit(d, frame), driver_urgent(d, frame)
 *   DRIVER_TRANSMIT, DRIVER_RECEIVE   frames that the FIFOs hold */
#ifndef TROCAR_DRIVER_CASES_H
#define TROCAR_DRIVER_CASES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "random.h"

static void driver_open(struct driver *d, unsigned filters)
{
    model_power_on();
    assert_true(driver_start(d, filters));
    bus_run(20);
}

static struct can_frame_t frame_of(uint32_t id, unsigned length, uint8_t first)
{
    struct can_frame_t f = {.id = id, .length = (uint8_t)length};
    for (unsigned i = 0; i < length; i++)
        f.data[i] = (uint8_t)(first + i);
    return f;
}

static void hear(uint32_t id, unsigned length, uint8_t first)
{
    struct can_frame_t f = frame_of(id, length, first);
    bus_hear(&f);
}

/* A bit of 1 us, sampled between 75 and 87.5 %. */
static void assert_timing(uint32_t clock_Hz, uint32_t prescaler, uint32_t before, uint32_t after, uint32_t jump)
{
    assert_int_equal(clock_Hz, 1000000 * prescaler * (1 + before + after));
    double sample = (double)(1 + before) / (1 + before + after);
    assert_true(sample >= 0.75 && sample <= 0.875);
    assert_true(jump >= 1 && jump <= after);
}

static void an_absent_controller_is_noticed(void **state)
{
    (void)state;
    struct driver d;
    model_power_on();
    bus.absent = true;
    assert_false(driver_start(&d, 2));
}

static void frames_go_out_and_come_in_as_the_manual_lays_them_out(void **state)
{
    (void)state;
    struct driver d;
    driver_open(&d, 0);
    random_seed("frames", 1);
    for (int i = 0; i < 2000; i++) {
        struct can_frame_t f = {.length = (uint8_t)random_below(9)}, got;
        bool extended = random_below(2);
        f.id = (uint32_t)random_bits() & (extended ? 0x1FFFFFFF : 0x7FF);
        f.flags = (uint8_t)((extended ? CAN_FLAG_EXTENDED : 0) | (random_below(4) == 0 ? CAN_FLAG_RTR : 0));
        for (unsigned k = 0; k < f.length; k++)
            f.data[k] = (uint8_t)random_bits();
        assert_true(i % 2 ? driver_urgent(&d, &f) : driver_transmit(&d, &f));
        bus_run(200);
        assert_int_equal(bus.sent_count, 1);
        assert_memory_equal(&bus.sent[0], &f, sizeof f);
        bus.sent_count = 0;
        bus_hear(&f);
        assert_true(driver_receive(&d, &got));
        assert_memory_equal(&got, &f, sizeof f);
        assert_false(driver_receive(&d, &got));
    }
    struct can_frame_t fd = {.id = 1, .length = 12, .flags = CAN_FLAG_FD};
    assert_false(driver_transmit(&d, &fd));
    assert_false(driver_urgent(&d, &fd));
    assert_int_equal(bus.violations, 0);
}

static void only_what_the_filters_name_is_received(void **state)
{
    (void)state;
    struct driver d;
    struct can_frame_t got;
    driver_open(&d, 2);
    for (uint32_t id = 0; id < 0x800; id++)
        for (unsigned kind = 0; kind < 4; kind++) {
            bool extended = kind & 1, remote = kind & 2;
            struct can_frame_t f = frame_of(extended ? id << 18 : id, 8, 0);
            f.flags = (uint8_t)((extended ? CAN_FLAG_EXTENDED : 0) | (remote ? CAN_FLAG_RTR : 0));
            bus_hear(&f);
            assert_int_equal(driver_receive(&d, &got), kind == 0 && (id == 0x181 || id == 0));
        }
}

static void a_full_transmit_fifo_refuses_and_keeps_the_order(void **state)
{
    (void)state;
    struct driver d;
    driver_open(&d, 2);
    struct can_frame_t urgent = frame_of(0x201, 8, 99);
    assert_true(driver_urgent(&d, &urgent));
    for (unsigned i = 0; i < DRIVER_TRANSMIT + 6; i++) {
        struct can_frame_t f = frame_of(0x700 + i, 8, (uint8_t)i);
        assert_int_equal(driver_transmit(&d, &f), i < DRIVER_TRANSMIT);
    }
    bus_run((DRIVER_TRANSMIT + 6) * 135);
    assert_int_equal(bus.sent_count, DRIVER_TRANSMIT + 1);
    assert_int_equal(bus.sent[0].id, 0x201);
    for (unsigned i = 0; i < DRIVER_TRANSMIT; i++)
        assert_int_equal(bus.sent[1 + i].id, 0x700 + i);
    for (unsigned i = 0; i < 5 * DRIVER_TRANSMIT; i++) { /* all the way round */
        struct can_frame_t f = frame_of(0x600 + i % 256, i % 9, (uint8_t)i);
        bus.sent_count = 0;
        assert_true(driver_transmit(&d, &f));
        bus_run(200);
        assert_int_equal(bus.sent_count, 1);
        assert_memory_equal(&bus.sent[0], &f, sizeof f);
    }
    assert_int_equal(bus.violations, 0);
}

static void a_receive_overflow_is_counted_and_what_fitted_is_read(void **state)
{
    (void)state;
    struct driver d;
    struct can_frame_t got;
    driver_open(&d, 2);
    for (unsigned round = 1; round <= 3; round++) {
        for (unsigned i = 0; i < DRIVER_RECEIVE + 6; i++)
            hear(0x181, 8, (uint8_t)i);
        assert_int_equal(bus.overflows, 6 * round);
        driver_poll(&d);
        driver_poll(&d);
        assert_int_equal(d.errors.receive_overflows, round);
        for (unsigned i = 0; i < DRIVER_RECEIVE; i++) {
            assert_true(driver_receive(&d, &got));
            assert_int_equal(got.data[0], i);
        }
        assert_false(driver_receive(&d, &got));
    }
    hear(0x181, 8, 200);
    assert_true(driver_receive(&d, &got));
    assert_int_equal(got.data[0], 200);
    assert_int_equal(bus.violations, 0);
}

static void error_passive_is_counted_at_each_entry_and_left_by_good_frames(void **state)
{
    (void)state;
    struct driver d;
    struct can_frame_t got;
    driver_open(&d, 2);
    for (unsigned round = 1; round <= 3; round++) {
        for (unsigned i = 0; i < 16; i++) {
            bus_mishear();
            driver_poll(&d);
        }
        driver_poll(&d); /* and stays so */
        assert_int_equal(d.receive_errors, 128);
        assert_true(d.passive);
        assert_int_equal(d.errors.error_passive, round);
        for (unsigned i = 0; i < 200; i++) { /* also those that the filters turn away count as good */
            hear(0x7FF, 8, 0);
            driver_poll(&d);
        }
        assert_int_equal(d.receive_errors, 0);
        assert_false(d.passive);
        assert_int_equal(d.errors.error_passive, round);
    }
    assert_int_equal(bus.passives, 3);
    assert_int_equal(d.errors.bus_off, 0);
    hear(0x181, 8, 1);
    assert_true(driver_receive(&d, &got));
}

/* Onto the bus with something wrong, until the controller goes off it. */
static void drive_off(struct driver *d)
{
    unsigned before = bus.bus_offs;
    bus.spoilt = BUS_SHORTED;
    for (unsigned i = 0; i < 10; i++) {
        struct can_frame_t f = frame_of(0x100 + i, 8, 0);
        assert_true(driver_transmit(d, &f));
    }
    while (bus.bus_offs == before)
        bus_run(50);
}

/* Until it is back, with nothing on the bus and nothing accepted meanwhile. */
static void wait_back(struct driver *d)
{
    uint64_t off_at = bus.bits;
    unsigned sent = bus.sent_count;
    struct can_frame_t refused = frame_of(0x2FF, 8, 0);
    bus.spoilt = BUS_GOOD;
    while (d->off) {
        assert_false(driver_transmit(d, &refused));
        assert_false(driver_urgent(d, &refused));
        assert_int_equal(bus.sent_count, sent);
        bus_run(10);
        driver_poll(d);
    }
    assert_true(bus.bits - off_at >= 128 * 11 && bus.bits - off_at <= 130 * 11 + 20);
}

static void bus_off_is_left_after_128_times_11_bits_and_nothing_old_is_sent(void **state)
{
    (void)state;
    struct driver d;
    struct can_frame_t got;
    driver_open(&d, 2);
    for (unsigned round = 1; round <= 3; round++) {
        drive_off(&d);
        driver_poll(&d);
        assert_int_equal(d.errors.bus_off, round);
        wait_back(&d);
        unsigned sent = bus.sent_count;
        struct can_frame_t fresh = frame_of(0x300 + round, 8, 0);
        assert_true(driver_transmit(&d, &fresh));
        bus_run(2000);
        assert_int_equal(bus.sent_count, sent + 1);
        assert_int_equal(bus.sent[sent].id, 0x300 + round);
        driver_poll(&d);
        assert_int_equal(d.transmit_errors + d.receive_errors, 0);
        assert_int_equal(d.errors.bus_off, round);
        hear(0x181, 8, 7); /* the filters are there again */
        hear(0x182, 8, 8);
        assert_true(driver_receive(&d, &got) && got.data[0] == 7);
        assert_false(driver_receive(&d, &got));
    }
    assert_int_equal(bus.violations, 0);
}

static void bus_off_that_a_transmission_finds_first_is_no_short_cut(void **state)
{
    (void)state;
    struct driver d;
    driver_open(&d, 2);
    struct can_frame_t f = frame_of(0x201, 8, 0);
    assert_true(driver_urgent(&d, &f));
    drive_off(&d);
    assert_false(driver_urgent(&d, &f));
    driver_poll(&d);
    assert_int_equal(d.errors.bus_off, 1);
    wait_back(&d);
    bus_run(1000);
    assert_int_equal(bus.sent_count, 0);
}

/* An urgent frame once a millisecond and others after it, through a time in which none gets through: all that is sent is of the
 * same millisecond. */
static void urgent_frames_through(enum bus_state spoilt)
{
    struct driver d;
    driver_open(&d, 2);
    for (unsigned ms = 1; ms <= 60; ms++) {
        bus.spoilt = ms >= 20 && ms < 40 ? spoilt : BUS_GOOD;
        struct can_frame_t f = frame_of(0x201, 8, (uint8_t)ms);
        struct can_frame_t other = frame_of(0x281, 8, (uint8_t)ms);
        unsigned handed = driver_urgent(&d, &f), before = bus.sent_count;
        for (unsigned i = 0; i < 3; i++)
            handed += driver_transmit(&d, &other);
        bus_run(1000);
        driver_poll(&d);
        if (bus.spoilt == BUS_GOOD)
            assert_int_equal(bus.sent_count, before + handed);
        for (unsigned i = before; i < bus.sent_count; i++)
            assert_int_equal(bus.sent[i].data[0], ms);
        if (ms < 20 || ms > 45)
            assert_int_equal(handed, 4);
    }
    assert_true(d.errors.aborted >= 5);
    assert_int_equal(d.errors.bus_off, 0);
    assert_int_equal(bus.violations, 0);
}

static void an_urgent_frame_that_waited_is_never_sent_late(void **state)
{
    (void)state;
    urgent_frames_through(BUS_BUSY);
    urgent_frames_through(BUS_UNHEARD); /* pulled cable */
}

#define DRIVER_CASES                                                                                                   \
    cmocka_unit_test(an_absent_controller_is_noticed),                                                                 \
        cmocka_unit_test(frames_go_out_and_come_in_as_the_manual_lays_them_out),                                       \
        cmocka_unit_test(only_what_the_filters_name_is_received),                                                      \
        cmocka_unit_test(a_full_transmit_fifo_refuses_and_keeps_the_order),                                            \
        cmocka_unit_test(a_receive_overflow_is_counted_and_what_fitted_is_read),                                       \
        cmocka_unit_test(error_passive_is_counted_at_each_entry_and_left_by_good_frames),                              \
        cmocka_unit_test(bus_off_is_left_after_128_times_11_bits_and_nothing_old_is_sent),                             \
        cmocka_unit_test(bus_off_that_a_transmission_finds_first_is_no_short_cut),                                     \
        cmocka_unit_test(an_urgent_frame_that_waited_is_never_sent_late)

#endif
