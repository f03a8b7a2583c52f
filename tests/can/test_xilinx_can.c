/* The driver of the Zynq's CAN controller on a model of its registers. */
#include "xilinx_can_driver.h"

#include "driver_cases.h"

static void a_bit_takes_a_microsecond_and_is_sampled_where_canopen_wants_it(void **state)
{
    (void)state;
    struct driver d;
    static const uint32_t clocks[] = {100000000, 99000000, 80000000, 40000000, 24000000, 20000000, 8000000, 60000000};
    for (size_t i = 0; i < sizeof clocks / sizeof clocks[0]; i++) {
        driver_settings.clock_Hz = clocks[i];
        driver_open(&d, 2);
        uint32_t btr = model.block[M_BTR];
        assert_timing(clocks[i], model.block[M_BRPR] + 1, (btr & 15) + 1, (btr >> 4 & 7) + 1, (btr >> 7 & 3) + 1);
        assert_int_equal(bus.violations, 0);
    }
    driver_settings.clock_Hz = 100000000;
}

static void what_cannot_be_is_refused(void **state)
{
    (void)state;
    struct driver d;
    struct xilinx_can_settings right = driver_settings;
    static const uint32_t clocks[] = {7000000, 33333333, 0, 1};
    model_power_on();
    for (size_t i = 0; i < sizeof clocks / sizeof clocks[0]; i++) {
        driver_settings.clock_Hz = clocks[i];
        assert_false(driver_start(&d, 2));
    }
    driver_settings = right;
    driver_settings.bit_rate = 0;
    assert_false(driver_start(&d, 2));
    driver_settings = right;
    assert_false(driver_start(&d, XILINX_CAN_FILTERS + 1));
    assert_true(driver_start(&d, 2));
}

static void nothing_but_the_start_resets_a_controller_that_meets_no_errors(void **state)
{
    (void)state;
    struct driver d;
    struct can_frame_t got, f = frame_of(0x201, 8, 0);
    driver_open(&d, 2);
    for (unsigned ms = 0; ms < 1000; ms++) {
        assert_true(driver_transmit(&d, &f) && driver_urgent(&d, &f));
        hear(0x181, 8, (uint8_t)ms);
        bus_run(1000);
        driver_poll(&d);
        assert_true(driver_receive(&d, &got) && got.data[0] == (uint8_t)ms);
    }
    assert_int_equal(model.resets, 1);
    assert_int_equal(bus.sent_count, 2000);
}

static void an_urgent_frame_overtakes_what_waits(void **state)
{
    (void)state;
    struct driver d;
    struct can_frame_t f = frame_of(0x080, 8, 0), urgent = frame_of(0x201, 8, 1);
    driver_open(&d, 2);
    assert_true(driver_transmit(&d, &f) && driver_transmit(&d, &f) && driver_urgent(&d, &urgent));
    bus_run(1000);
    assert_int_equal(bus.sent_count, 3);
    assert_int_equal(bus.sent[0].id, 0x201);
}

/* A reset has made the controller forget its errors: a node that disturbs the bus must not go on doing so. */
static void a_frame_taken_back_for_errors_is_followed_by_the_silence_of_a_bus_off(void **state)
{
    (void)state;
    struct driver d;
    struct can_frame_t f = frame_of(0x201, 8, 0);
    driver_open(&d, 2);
    bus.spoilt = BUS_UNHEARD;
    assert_true(driver_urgent(&d, &f));
    bus_run(1000);
    driver_poll(&d);
    assert_false(driver_urgent(&d, &f));
    assert_int_equal(d.errors.aborted, 1);
    driver_poll(&d);
    unsigned attempts = bus.attempts;
    wait_back(&d);
    assert_int_equal(bus.attempts, attempts);
    assert_int_equal(d.errors.bus_off, 0);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        DRIVER_CASES,
        cmocka_unit_test(a_bit_takes_a_microsecond_and_is_sampled_where_canopen_wants_it),
        cmocka_unit_test(what_cannot_be_is_refused),
        cmocka_unit_test(nothing_but_the_start_resets_a_controller_that_meets_no_errors),
        cmocka_unit_test(an_urgent_frame_overtakes_what_waits),
        cmocka_unit_test(a_frame_taken_back_for_errors_is_followed_by_the_silence_of_a_bus_off),
    };
    return cmocka_run_group_tests_name("Xilinx CAN driver", tests, NULL, NULL);
}
