/* The simulated bus: time, arbitration, faults, bounds. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "bus.h"
#include "framebits.h"
#include "wire.h"

enum { LOG = 20000 };

struct log {
    size_t count;
    struct can_frame_t frame[LOG];
    uint64_t time_us[LOG];
};

static struct log heard; /* static: a megabyte */

static void record(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct log *log = context;
    assert_true(log->count < LOG);
    log->frame[log->count] = *frame;
    log->time_us[log->count++] = time_us;
}

static void nothing(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    (void)context;
    (void)frame;
    (void)time_us;
}

/* A bus with a sender (node 0), a second sender (node 1) and a recorder (node 2). */
static struct bus *fresh_bus(void)
{
    struct bus *bus = bus_create(1000000);
    assert_non_null(bus);
    heard.count = 0;
    assert_int_equal(bus_attach(bus, nothing, NULL), 0);
    assert_int_equal(bus_attach(bus, nothing, NULL), 1);
    assert_int_equal(bus_attach(bus, record, &heard), 2);
    return bus;
}

static struct can_frame_t numbered(uint32_t id, uint32_t number)
{
    struct can_frame_t frame = {.id = id, .length = 8};
    memcpy(frame.data, &number, sizeof number);
    return frame;
}

static uint32_t number_of(const struct can_frame_t *frame)
{
    uint32_t number;
    memcpy(&number, frame->data, sizeof number);
    return number;
}

static void a_frame_arrives_after_the_time_of_its_bits(void **state)
{
    (void)state;
    static const uint32_t rates[] = {1000000, 500000, 125000, 83333};
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        struct bus *bus = bus_create(rates[i]);
        heard.count = 0;
        bus_attach(bus, nothing, NULL);
        bus_attach(bus, record, &heard);
        const struct can_frame_t frame = numbered(0x123, 77);
        const uint64_t bits = framebits(&frame);
        const uint64_t end_us = (bits * 1000000 + rates[i] - 1) / rates[i];
        bus_run(bus, 50);
        assert_true(bus_send(bus, 0, &frame));
        bus_run(bus, 50 + bits * 1000000 / rates[i] - 1);
        assert_int_equal(heard.count, 0);
        bus_run(bus, 50 + end_us);
        assert_int_equal(heard.count, 1);
        assert_in_range(heard.time_us[0], 50 + end_us - 1, 50 + end_us);
        assert_int_equal(bus_statistics(bus)->bits, bits);
        assert_int_equal(bus_statistics(bus)->busy_us, heard.time_us[0] - 50);
        bus_free(bus);
    }
    assert_null(bus_create(0));
    assert_null(bus_create(2000000));
}

static void the_sender_does_not_hear_itself_and_the_listener_hears_all(void **state)
{
    (void)state;
    static struct log all;
    struct bus *bus = fresh_bus();
    all.count = 0;
    bus_listen(bus, record, &all);
    const struct can_frame_t a = numbered(0x100, 1), b = numbered(0x200, 2);
    bus_send(bus, 2, &a);
    bus_send(bus, 0, &b);
    bus_run(bus, 1000);
    assert_int_equal(heard.count, 1);
    assert_int_equal(number_of(&heard.frame[0]), 2);
    assert_int_equal(all.count, 2);
    bus_free(bus);
}

static void lower_identifiers_go_first_and_equal_ones_in_order(void **state)
{
    (void)state;
    struct bus *bus = fresh_bus();
    /* node 1 sends first, yet at equal identifiers node 0 goes first; within a node the order of sending stays */
    static const struct {
        int node;
        uint32_t id, number;
    } sent[] = {{1, 0x300, 5}, {1, 0x300, 6}, {0, 0x300, 3}, {1, 0x081, 1},
                {0, 0x300, 4}, {0, 0x7ff, 7}, {0, 0x080, 0}, {1, 0x200, 2}};
    for (size_t i = 0; i < 8; i++) {
        const struct can_frame_t frame = numbered(sent[i].id, sent[i].number);
        assert_true(bus_send(bus, sent[i].node, &frame));
    }
    bus_run(bus, 10000);
    assert_int_equal(heard.count, 8);
    for (uint32_t i = 0; i < 8; i++)
        assert_int_equal(number_of(&heard.frame[i]), i);
    bus_free(bus);
}

/* ISO 11898-1: a data frame wins over a remote one, a standard identifier over an extended one with the same base. */
static void arbitration_follows_the_bits_of_the_identifier(void **state)
{
    (void)state;
    struct bus *bus = fresh_bus();
    const struct can_frame_t order[] = {
        {.id = 0x122, .length = 8},
        {.id = 0x123, .length = 8},
        {.id = 0x123, .flags = CAN_FLAG_RTR},
        {.id = 0x123u << 18 | 5, .flags = CAN_FLAG_EXTENDED},
        {.id = 0x123u << 18 | 5, .flags = CAN_FLAG_EXTENDED | CAN_FLAG_RTR},
        {.id = 0x123u << 18 | 6, .flags = CAN_FLAG_EXTENDED},
        {.id = 0x124, .length = 8},
    };
    const int count = sizeof order / sizeof order[0];
    for (int i = count - 1; i >= 0; i--)
        assert_true(bus_send(bus, i % 2, &order[i]));
    bus_run(bus, 10000);
    assert_int_equal(heard.count, count);
    for (int i = 0; i < count; i++) {
        assert_int_equal(heard.frame[i].id, order[i].id);
        assert_int_equal(heard.frame[i].flags, order[i].flags);
    }
    bus_free(bus);
}

static void a_frame_on_the_bus_is_not_interrupted(void **state)
{
    (void)state;
    struct bus *bus = fresh_bus();
    const struct can_frame_t low = numbered(0x700, 1), high = numbered(0x001, 2);
    bus_send(bus, 0, &low);
    bus_run(bus, 10);
    bus_send(bus, 1, &high);
    bus_run(bus, 1000);
    assert_int_equal(number_of(&heard.frame[0]), 1);
    assert_int_equal(number_of(&heard.frame[1]), 2);
    assert_int_equal(heard.time_us[0], framebits(&low));
    assert_int_equal(heard.time_us[1], framebits(&low) + framebits(&high));
    bus_free(bus);
}

/* A frame of eight bytes with as many stuff bits as a search finds. */
static struct can_frame_t long_frame(uint32_t id, uint64_t *seed)
{
    static const uint8_t runs[] = {0x00, 0xff, 0x0f, 0xf0, 0x1f, 0xe0, 0x87, 0x78, 0xc3, 0x3c, 0xe1, 0x1e};
    struct can_frame_t best = {.id = id, .length = 8}, frame = best;
    for (int round = 0; round < 3000; round++) {
        for (int i = 0; i < 8; i++) {
            *seed = *seed * UINT64_C(6364136223846793005) + 1;
            frame.data[i] = round % 3 && *seed >> 62 ? best.data[i] : runs[(*seed >> 33) % sizeof runs];
        }
        if (framebits(&frame) > framebits(&best))
            best = frame;
    }
    return best;
}

static void seven_full_frames_fit_into_a_millisecond(void **state)
{
    (void)state;
    assert_true(7 * framebits_worst(8, false) <= 1000);
    uint64_t seed = 5;
    struct bus *bus = fresh_bus();
    for (uint32_t i = 0; i < 7; i++) {
        const struct can_frame_t frame = long_frame(0x100 + i, &seed);
        assert_true(bus_send(bus, 0, &frame));
    }
    bus_run(bus, 1000);
    assert_int_equal(heard.count, 7);
    print_message("# seven frames of many stuff bits: %llu us\n", (unsigned long long)heard.time_us[6]);
    bus_free(bus);
}

/* A device that answers SYNC, a controller that answers encoders `compute_us` later. */
struct answering {
    struct bus *bus;
    int node;
    uint32_t trigger, answer;
    uint64_t seed, heard_us;
};

static void answer(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct answering *a = context;
    if (frame->id != a->trigger)
        return;
    a->heard_us = time_us;
    if (a->answer) {
        const struct can_frame_t reply = long_frame(a->answer, &a->seed);
        assert_true(bus_send(a->bus, a->node, &reply));
    }
}

static void a_tick_with_telemetry_fits_a_kilohertz(void **state)
{
    (void)state;
    struct bus *bus = bus_create(1000000);
    struct answering device = {.bus = bus, .trigger = WIRE_SYNC_ID, .answer = WIRE_ENCODERS_ID + 1, .seed = 1};
    struct answering controller = {.bus = bus, .trigger = WIRE_ENCODERS_ID + 1, .seed = 2};
    struct answering motors = {.bus = bus, .trigger = WIRE_TORQUES_ID + 1, .seed = 3};
    controller.node = bus_attach(bus, answer, &controller);
    device.node = bus_attach(bus, answer, &device);
    bus_attach(bus, answer, &motors);
    uint64_t slowest_us = 0, seed = 4;
    for (uint64_t tick = 0; tick < 200; tick++) {
        const uint64_t start_us = 1000 * tick;
        const struct can_frame_t sync = {.id = WIRE_SYNC_ID, .length = 1, .data = {(uint8_t)tick}};
        assert_true(bus_send(bus, controller.node, &sync));
        bus_run(bus, start_us + 200); /* SYNC 65 + encoders 135 */
        assert_in_range(controller.heard_us, start_us, start_us + 200);
        bus_run(bus, start_us + 500); /* the controller computes for 300 us */
        const struct can_frame_t torques = long_frame(WIRE_TORQUES_ID + 1, &seed);
        assert_true(bus_send(bus, controller.node, &torques));
        for (uint32_t i = 0; i < 2; i++) {
            const struct can_frame_t contact = long_frame(WIRE_CONTACT_ID + 1, &seed);
            assert_true(bus_send(bus, controller.node, &contact));
        }
        bus_run(bus, start_us + 1000);
        assert_in_range(motors.heard_us, start_us, start_us + 635);
        if (motors.heard_us - start_us > slowest_us)
            slowest_us = motors.heard_us - start_us;
    }
    const double load = (double)bus_statistics(bus)->busy_us / 200000;
    print_message("# torque frame at most %llu us into the tick, load %.1f %%\n", (unsigned long long)slowest_us,
                  100 * load);
    assert_true(load < 0.70);
    bus_free(bus);
}

/* Send 10000 numbered frames one by one under the faults; returns how often each number arrived, as sent. */
static void run_faulty(const struct bus_faults *faults, unsigned arrived[10000], struct bus_statistics *statistics)
{
    struct bus *bus = fresh_bus();
    bus_inject(bus, faults);
    for (uint32_t i = 0; i < 10000; i++) {
        const struct can_frame_t frame = numbered(0x181, i);
        bus_send(bus, 0, &frame);
        bus_run(bus, 200 * (i + 1));
    }
    bus_run(bus, 200 * 10000 + 100000);
    memset(arrived, 0, 10000 * sizeof *arrived);
    for (size_t i = 0; i < heard.count; i++) {
        const uint32_t number = number_of(&heard.frame[i]);
        const struct can_frame_t sent = numbered(0x181, number);
        if (number < 10000 && heard.frame[i].id == 0x181 && memcmp(heard.frame[i].data, sent.data, 8) == 0)
            arrived[number]++;
    }
    *statistics = *bus_statistics(bus);
    bus_free(bus);
}

/* 10000 trials with probability 0.1: 1000 +- 30; six standard deviations are never seen by chance (2e-9). */
static void assert_about_a_tenth(uint64_t count)
{
    assert_in_range(count, 1000 - 180, 1000 + 180);
}

static void dropped_frames_are_those_counted(void **state)
{
    (void)state;
    static unsigned arrived[10000];
    struct bus_statistics s;
    run_faulty(&(struct bus_faults){.drop = 0.1, .id_to = 0x7ff, .seed = 11}, arrived, &s);
    size_t missing = 0;
    for (size_t i = 0; i < 10000; i++)
        missing += arrived[i] == 0;
    assert_int_equal(missing, s.dropped);
    assert_about_a_tenth(s.dropped);
    assert_int_equal(s.frames, 10000); /* the bus carried them all the same */
    assert_int_equal(s.duplicated + s.delayed + s.corrupted + s.reordered, 0);
}

static void duplicated_frames_arrive_twice(void **state)
{
    (void)state;
    static unsigned arrived[10000];
    struct bus_statistics s;
    run_faulty(&(struct bus_faults){.duplicate = 0.1, .id_to = 0x7ff, .seed = 12}, arrived, &s);
    size_t twice = 0;
    for (size_t i = 0; i < 10000; i++) {
        assert_in_range(arrived[i], 1, 2);
        twice += arrived[i] == 2;
    }
    assert_int_equal(twice, s.duplicated);
    assert_about_a_tenth(s.duplicated);
    assert_int_equal(s.frames, 10000 + s.duplicated);
}

static void corrupted_frames_differ_in_one_to_three_bits(void **state)
{
    (void)state;
    static unsigned arrived[10000];
    struct bus_statistics s;
    run_faulty(&(struct bus_faults){.corrupt = 0.1, .id_to = 0x7ff, .seed = 13}, arrived, &s);
    assert_int_equal(heard.count, 10000); /* one by one, so the i-th heard is the i-th sent */
    uint64_t damaged = 0, flips[4] = {0};
    for (uint32_t i = 0; i < 10000; i++) {
        const struct can_frame_t sent = numbered(0x181, i);
        int bits = __builtin_popcount(sent.id ^ heard.frame[i].id);
        for (int k = 0; k < 8; k++)
            bits += __builtin_popcount((unsigned)(sent.data[k] ^ heard.frame[i].data[k]));
        assert_in_range(bits, 0, 3);
        assert_true(heard.frame[i].id <= 0x7ff);
        damaged += bits > 0;
        flips[bits]++;
    }
    assert_int_equal(damaged, s.corrupted);
    assert_about_a_tenth(s.corrupted);
    assert_true(flips[1] && flips[2] && flips[3]);
}

static void delayed_frames_come_later_by_the_delay(void **state)
{
    (void)state;
    static unsigned arrived[10000];
    struct bus_statistics s;
    run_faulty(&(struct bus_faults){.delay = 0.1, .delay_us = 5000, .id_to = 0x7ff, .seed = 14}, arrived, &s);
    uint64_t late = 0;
    for (size_t i = 0; i < heard.count; i++) {
        const uint64_t number = number_of(&heard.frame[i]);
        const uint64_t due_us = 200 * number + framebits(&heard.frame[i]);
        assert_true(heard.time_us[i] == due_us || heard.time_us[i] == due_us + 5000);
        late += heard.time_us[i] != due_us;
    }
    assert_int_equal(heard.count, 10000);
    assert_int_equal(late, s.delayed);
    assert_about_a_tenth(s.delayed);
}

static void reordered_frames_come_behind_their_successor(void **state)
{
    (void)state;
    static unsigned arrived[10000];
    struct bus_statistics s;
    run_faulty(&(struct bus_faults){.reorder = 0.1, .id_to = 0x7ff, .seed = 15}, arrived, &s);
    /* a frame was overtaken when a later number was heard before it */
    uint64_t overtaken = 0;
    uint32_t largest = 0;
    for (size_t i = 0; i < heard.count; i++) {
        const uint32_t number = number_of(&heard.frame[i]);
        overtaken += number < largest;
        if (number > largest)
            largest = number;
    }
    assert_int_equal(heard.count, 10000);
    assert_in_range(s.reordered - overtaken, 0, 1); /* the very last has no successor */
    assert_about_a_tenth(s.reordered);
}

static void faults_keep_to_their_identifiers(void **state)
{
    (void)state;
    static unsigned arrived[10000];
    struct bus_statistics s;
    run_faulty(&(struct bus_faults){.drop = 1, .corrupt = 1, .id_from = 0x182, .id_to = 0x7ff, .seed = 16}, arrived,
               &s);
    for (size_t i = 0; i < 10000; i++)
        assert_int_equal(arrived[i], 1);
    assert_int_equal(s.dropped + s.corrupted, 0);
}

static void the_same_seed_gives_the_same_run(void **state)
{
    (void)state;
    static unsigned arrived[10000];
    static struct log first;
    const struct bus_faults faults = {.drop = 0.1,
                                      .duplicate = 0.1,
                                      .delay = 0.1,
                                      .corrupt = 0.1,
                                      .reorder = 0.1,
                                      .delay_us = 700,
                                      .id_to = 0x7ff,
                                      .seed = 17};
    struct bus_statistics a, b;
    run_faulty(&faults, arrived, &a);
    first = heard;
    run_faulty(&faults, arrived, &b);
    assert_int_equal(first.count, heard.count);
    assert_memory_equal(first.frame, heard.frame, heard.count * sizeof heard.frame[0]);
    assert_memory_equal(first.time_us, heard.time_us, heard.count * sizeof heard.time_us[0]);
    assert_memory_equal(&a, &b, sizeof a);
    /* more of one kind does not change which frames suffer another */
    run_faulty(&(struct bus_faults){.drop = 0.1, .id_to = 0x7ff, .seed = 17}, arrived, &b);
    assert_int_equal(a.dropped, b.dropped);
}

static void full_queues_refuse_and_count(void **state)
{
    (void)state;
    struct bus *bus = fresh_bus();
    const struct can_frame_t frame = numbered(0x100, 1);
    for (int i = 0; i < BUS_QUEUE; i++)
        assert_true(bus_send(bus, 0, &frame));
    assert_false(bus_send(bus, 0, &frame));
    assert_int_equal(bus_statistics(bus)->overflowed, 1);
    assert_true(bus_send(bus, 1, &frame)); /* a babbling node does not fill the others' queues */
    bus_run(bus, 1000000);
    assert_int_equal(heard.count, BUS_QUEUE + 1);
    const struct can_frame_t wrong[] = {{.length = 9},
                                        {.flags = CAN_FLAG_FD},
                                        {.flags = CAN_FLAG_ERROR},
                                        {.id = 0x800},
                                        {.id = 0x20000000, .flags = CAN_FLAG_EXTENDED}};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        assert_false(bus_send(bus, 0, &wrong[i]));
    assert_false(bus_send(bus, -1, &frame));
    assert_false(bus_send(bus, 3, &frame));
    for (int i = 3; i < BUS_MAX_NODES; i++)
        assert_int_equal(bus_attach(bus, nothing, NULL), i);
    assert_int_equal(bus_attach(bus, nothing, NULL), -1);
    bus_free(bus);
    bus_free(NULL);
}

/* More held frames than there is room for: nothing is lost, the rest is merely not delayed. */
static void a_flood_of_delays_stays_within_its_bound(void **state)
{
    (void)state;
    static unsigned arrived[10000];
    struct bus_statistics s;
    run_faulty(&(struct bus_faults){.delay = 1, .delay_us = 2050000, .id_to = 0x7ff, .seed = 18}, arrived, &s);
    assert_int_equal(s.delayed, BUS_QUEUE);
    for (size_t i = BUS_QUEUE; i < 10000; i++)
        assert_int_equal(arrived[i], 1);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    print_message("# seeds of the faults: 11..18\n");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_frame_arrives_after_the_time_of_its_bits),
        cmocka_unit_test(the_sender_does_not_hear_itself_and_the_listener_hears_all),
        cmocka_unit_test(lower_identifiers_go_first_and_equal_ones_in_order),
        cmocka_unit_test(arbitration_follows_the_bits_of_the_identifier),
        cmocka_unit_test(a_frame_on_the_bus_is_not_interrupted),
        cmocka_unit_test(seven_full_frames_fit_into_a_millisecond),
        cmocka_unit_test(a_tick_with_telemetry_fits_a_kilohertz),
        cmocka_unit_test(dropped_frames_are_those_counted),
        cmocka_unit_test(duplicated_frames_arrive_twice),
        cmocka_unit_test(corrupted_frames_differ_in_one_to_three_bits),
        cmocka_unit_test(delayed_frames_come_later_by_the_delay),
        cmocka_unit_test(reordered_frames_come_behind_their_successor),
        cmocka_unit_test(faults_keep_to_their_identifiers),
        cmocka_unit_test(the_same_seed_gives_the_same_run),
        cmocka_unit_test(full_queues_refuse_and_count),
        cmocka_unit_test(a_flood_of_delays_stays_within_its_bound),
    };
    return cmocka_run_group_tests_name("bus", tests, NULL, NULL);
}
