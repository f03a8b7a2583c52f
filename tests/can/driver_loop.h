/* The controller's loop on the driver of a CAN controller, whose registers a model stands for, while the bus is spoiled: what the
 * driver went through comes out on the wire, in the counters of Health, and nothing late is ever sent. The test that includes
 * this has included what driver_cases.h wants. */
#ifndef TROCAR_DRIVER_LOOP_H
#define TROCAR_DRIVER_LOOP_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "hal.h"
#include "loop.h"
#include "tick_bench.h"

enum { STEP_us = 5, ANSWER_us = 195, NODE = 1 };

/* What the bus does from a tick on. */
struct phase {
    uint64_t tick;
    enum bus_state bus;
};

static struct {
    struct driver can;
    struct bench bench; /* the bank, and counts for a pose */
    size_t bank_length;
    const struct phase *phases;
    uint64_t end_us, answer_us, last_torque_us, handed_us;
    uint8_t handed[8];
    unsigned heard, torques, late, enabled, refused;
    uint32_t health[8][2]; /* of each page: bytes 1..4 and 5..6 */
    unsigned storm;        /* frames of a babbling device in each of the coming ticks */
    uint64_t storm_tick;
} s;

/* A frame that the controller has sent, as the others on the bus see it. */
static void listen(const struct can_frame_t *f)
{
    uint32_t id = f->id;
    const uint8_t *data = f->data;
    s.heard++;
    if (id == WIRE_SYNC_ID)
        s.answer_us = bus.bits + ANSWER_us;
    if (id == WIRE_TORQUES_ID + NODE) {
        struct wire_torques t;
        assert_true(wire_torques_unpack(&t, data, 8));
        s.torques++;
        s.enabled += t.enable;
        /* the one handed over last, within its tick */
        s.late += memcmp(data, s.handed, 8) != 0 || bus.bits - s.handed_us > LOOP_TICK_US;
    }
    if (id == WIRE_HEALTH_ID + NODE) {
        s.health[data[0] & 7][0] = data[1] | (uint32_t)data[2] << 8 | (uint32_t)data[3] << 16 | (uint32_t)data[4] << 24;
        s.health[data[0] & 7][1] = data[5] | (uint32_t)data[6] << 8;
    }
}

static void device(void)
{
    uint64_t tick = bus.bits / LOOP_TICK_US;
    if (s.answer_us && bus.bits >= s.answer_us) {
        struct can_frame_t f = {.id = WIRE_ENCODERS_ID + NODE, .length = 8};
        struct wire_encoders e = bench_counts(&s.bench, 0, 0, 0.11);
        e.sequence = s.bench.sequence++ & 15;
        wire_encoders_pack(f.data, &e);
        s.answer_us = 0;
        bus_hear(&f);
    }
    if (s.storm && tick >= s.storm_tick) {
        struct can_frame_t f = {.id = WIRE_NMT_ID, .length = 2, .data = {130, 0}}; /* nothing to a controller */
        for (unsigned i = 0; i < 70; i++)
            bus_hear(&f);
        s.storm--;
        s.storm_tick = tick + 1;
    }
    if (tick % 500 == 499 && bus.bits % LOOP_TICK_US < STEP_us) { /* the host, for as long as it is heard */
        struct can_frame_t f = {.id = WIRE_NMT_ID, .length = 2, .data = {1, NODE}};
        bus_hear(&f);
    }
}

uint64_t hal_time_us(void)
{
    return bus.bits;
}

uint64_t hal_wait_us(uint64_t time_us)
{
    while (bus.bits < time_us && !model_waiting()) {
        uint64_t tick = bus.bits / LOOP_TICK_US;
        while (s.phases->tick <= tick) {
            bus.spoilt = s.phases->bus;
            s.phases++;
        }
        unsigned before = bus.sent_count;
        uint64_t left = time_us - bus.bits;
        bus_run(left < STEP_us ? (unsigned)left : STEP_us);
        for (unsigned i = before; i < bus.sent_count; i++)
            listen(&bus.sent[i]);
        bus.sent_count = 0;
        device();
    }
    driver_poll(&s.can);
    return bus.bits;
}

bool hal_can_receive(struct can_frame_t *frame)
{
    return driver_receive(&s.can, frame);
}

bool hal_can_transmit(const struct can_frame_t *frame)
{
    bool torque = frame->id == WIRE_TORQUES_ID + NODE;
    if (torque) {
        memcpy(s.handed, frame->data, 8);
        s.handed_us = bus.bits;
    }
    bool good = torque ? driver_urgent(&s.can, frame) : driver_transmit(&s.can, frame);
    s.refused += !good;
    return good;
}

struct can_errors hal_can_errors(void)
{
    return s.can.errors;
}

const void *hal_bank(size_t *length)
{
    *length = s.bank_length;
    return s.bench.bytes;
}

void *hal_memory(size_t *bytes)
{
    *bytes = 0;
    return NULL;
}

bool hal_running(void)
{
    return bus.bits < s.end_us;
}

static void run(const struct phase *phases, unsigned ticks)
{
    uint64_t storm_tick = s.storm_tick;
    unsigned storm = s.storm;
    memset(&s, 0, sizeof s);
    s.storm = storm;
    s.storm_tick = storm_tick;
    s.bench.bytes = bank_fixture(NULL, &s.bank_length);
    assert_int_equal(bank_view_open(&s.bench.bank, s.bench.bytes, s.bank_length), STATUS_OK);
    model_power_on();
    assert_true(driver_start(&s.can, 2));
    bus_run(20);
    s.phases = phases;
    s.end_us = (uint64_t)ticks * LOOP_TICK_US;
    assert_int_equal(loop_run(NODE), STATUS_OK);
    free(s.bench.bytes);
    print_message(
        "# %u ticks: %u frames heard, %u torques (%u enabled), %u refused; aborted %u, error-passive %u, bus-off %u, "
        "overflows %u\n",
        ticks, s.heard, s.torques, s.enabled, s.refused, s.can.errors.aborted, s.can.errors.error_passive,
        s.can.errors.bus_off, s.can.errors.receive_overflows);
    assert_int_equal(bus.violations, 0);
    assert_int_equal(s.late, 0);
}

/* Page 6 of Health says what the driver counted. */
static void check_health(void)
{
    assert_int_equal(s.health[6][0] & 0xFFFF, s.can.errors.receive_overflows);
    assert_int_equal(s.health[6][0] >> 16, s.can.errors.error_passive);
    assert_int_equal(s.health[6][1], s.can.errors.bus_off);
}

static const struct phase good[] = {{UINT64_MAX, BUS_GOOD}};

static void on_a_good_bus_nothing_is_lost_and_nothing_counted(void **state)
{
    (void)state;
    s.storm = 0;
    run(good, 2000);
    check_health();
    assert_int_equal(s.torques, 2000);
    assert_true(s.enabled > 1000);
    assert_int_equal(s.refused + s.can.errors.aborted + s.can.errors.error_passive + s.can.errors.bus_off +
                         s.can.errors.receive_overflows,
                     0);
}

static void a_storm_of_frames_overflows_is_counted_and_ends(void **state)
{
    (void)state;
    s.storm = 5;
    s.storm_tick = 1000;
    run(good, 2000);
    assert_int_equal(s.can.errors.receive_overflows, 5);
    assert_true(bus.overflows >= 5 * 6);
    check_health();
    assert_int_equal(s.torques, 2000);
}

static void a_short_circuit_puts_it_off_the_bus_and_it_comes_back(void **state)
{
    (void)state;
    static const struct phase phases[] = {
        {1200, BUS_SHORTED}, {1250, BUS_GOOD}, {2200, BUS_SHORTED}, {2203, BUS_GOOD}, {UINT64_MAX, BUS_GOOD}};
    s.storm = 0;
    run(phases, 4000);
    assert_true(s.can.errors.bus_off >= 2);
    assert_int_equal(s.can.errors.bus_off, bus.bus_offs);
    check_health();
    assert_true(s.refused > 0);
    assert_true(s.torques > 3900 - 50 - 3 && s.torques < 4000 - 50);
    assert_true(s.enabled > 1500); /* the host started it again */
}

static void a_pulled_cable_makes_it_silent_and_it_comes_back(void **state)
{
    (void)state;
    static const struct phase phases[] = {
        {1200, BUS_UNHEARD}, {1700, BUS_GOOD}, {2700, BUS_BUSY}, {2703, BUS_GOOD}, {UINT64_MAX, BUS_GOOD}};
    s.storm = 0;
    run(phases, 4000);
    assert_true(s.can.errors.aborted > 50);
    assert_int_equal(s.can.errors.bus_off, 0); /* ISO 11898-1: no acknowledgement alone does not lead to bus-off */
    check_health();
    /* Health: what could not be sent in its tick */
    assert_true(s.health[3][0] >> 16 >= s.can.errors.aborted);
    assert_true(s.torques > 4000 - 503 - 10 && s.torques < 4000 - 503 + 10);
    assert_true(s.enabled > 2000); /* the host started it again, and three lost ticks did not end it */
}

#define DRIVER_LOOP_CASES                                                                                              \
    cmocka_unit_test(on_a_good_bus_nothing_is_lost_and_nothing_counted),                                               \
        cmocka_unit_test(a_storm_of_frames_overflows_is_counted_and_ends),                                             \
        cmocka_unit_test(a_short_circuit_puts_it_off_the_bus_and_it_comes_back),                                       \
        cmocka_unit_test(a_pulled_cable_makes_it_silent_and_it_comes_back)

#endif
