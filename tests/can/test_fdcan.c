/* The driver of ST's FDCAN controller on a model of its registers and message RAM. */
#include "fdcan_driver.h"

#include "driver_cases.h"

static void a_bit_takes_a_microsecond_and_is_sampled_where_canopen_wants_it(void **state)
{
    (void)state;
    struct driver d;
    static const uint32_t clocks[] = {80000000, 100000000, 25000000, 8000000, 125000000, 64000000};
    for (size_t i = 0; i < sizeof clocks / sizeof clocks[0]; i++) {
        driver_settings.clock_Hz = clocks[i];
        driver_open(&d, 2);
        uint32_t t = model.block[M_NBTP];
        assert_timing(clocks[i], (t >> 16 & 511) + 1, (t >> 8 & 255) + 1, (t & 127) + 1, (t >> 25) + 1);
        assert_int_equal(bus.violations, 0);
    }
    driver_settings.clock_Hz = 80000000;
}

static void what_cannot_be_is_refused(void **state)
{
    (void)state;
    struct driver d;
    struct fdcan_settings right = driver_settings;
    static const uint32_t clocks[] = {7000000, 33333333, 0, 1};
    model_power_on();
    for (size_t i = 0; i < sizeof clocks / sizeof clocks[0]; i++) {
        driver_settings.clock_Hz = clocks[i];
        assert_false(driver_start(&d, 2));
    }
    driver_settings = right;
    assert_false(driver_start(&d, FDCAN_FILTERS + 1));
    assert_true(driver_start(&d, 2));
}

static void only_its_own_part_of_the_message_ram_is_used(void **state)
{
    (void)state;
    struct driver d;
    struct can_frame_t got, f = frame_of(0x201, 8, 1);
    driver_open(&d, 2);
    for (unsigned i = 0; i < 200; i++) {
        assert_true(driver_transmit(&d, &f) && driver_urgent(&d, &f));
        hear(0x181, 8, (uint8_t)i);
        bus_run(500);
        assert_true(fdcan_waiting(&d) && driver_receive(&d, &got) && got.data[0] == (uint8_t)i);
        assert_false(fdcan_waiting(&d));
    }
    unsigned end = MODEL_OFFSET + sizeof(struct fdcan_memory) / 4;
    for (unsigned i = 0; i < MODEL_WORDS; i++)
        assert_true((i >= MODEL_OFFSET && i < end) || model.ram[i] == 0xA5A5A5A5);
    /* elements follow each other without a gap or an overlap */
    assert_int_equal(model.block[M_SIDFC] & 0xFFFC, 4 * MODEL_OFFSET);
    assert_int_equal(model.block[M_RXF0C] & 0xFFFC, 4 * (MODEL_OFFSET + FDCAN_FILTERS));
    assert_int_equal(model.block[M_TXBC] & 0xFFFC, 4 * (MODEL_OFFSET + FDCAN_FILTERS + 4 * FDCAN_RECEIVE));
    assert_int_equal(end, MODEL_OFFSET + FDCAN_FILTERS + 4 * (FDCAN_RECEIVE + model_dedicated() + model_fifo()));
}

static void an_urgent_frame_on_the_bus_is_followed_by_the_next_and_a_third_is_refused(void **state)
{
    (void)state;
    struct driver d;
    struct can_frame_t first = frame_of(0x201, 8, 1), second = frame_of(0x201, 8, 2), third = frame_of(0x201, 8, 3);
    driver_open(&d, 2);
    assert_true(driver_urgent(&d, &first));
    model.on_bus = 1; /* cannot be taken back now */
    assert_true(driver_urgent(&d, &second));
    model.on_bus = 3;
    assert_false(driver_urgent(&d, &third));
    model.on_bus = 0;
    assert_int_equal(d.errors.aborted, 0);
    bus_run(1000);
    assert_int_equal(bus.sent_count, 2);
    assert_int_equal(bus.sent[0].data[0], 1);
    assert_int_equal(bus.sent[1].data[0], 2);

    assert_true(driver_urgent(&d, &first));
    model.on_bus = 1;
    assert_true(driver_urgent(&d, &second));
    model.on_bus = 0;
    bus.spoilt = BUS_UNHEARD; /* it fails: once, and is not tried again */
    bus_run(100);
    bus.spoilt = BUS_GOOD;
    bus_run(1000);
    assert_int_equal(bus.sent_count, 3);
    assert_int_equal(bus.sent[2].data[0], 2);
    assert_int_equal(bus.violations, 0);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        DRIVER_CASES,
        cmocka_unit_test(a_bit_takes_a_microsecond_and_is_sampled_where_canopen_wants_it),
        cmocka_unit_test(what_cannot_be_is_refused),
        cmocka_unit_test(only_its_own_part_of_the_message_ram_is_used),
        cmocka_unit_test(an_urgent_frame_on_the_bus_is_followed_by_the_next_and_a_third_is_refused),
    };
    return cmocka_run_group_tests_name("FDCAN driver", tests, NULL, NULL);
}
