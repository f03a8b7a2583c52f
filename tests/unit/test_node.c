/* The controller as a node: what it sends when, and that nothing it receives can upset it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "crc.h"
#include "random.h"
#include "tick_bench.h"

static void boots_with_a_heartbeat_and_zero_torque_until_started(void **state)
{
    (void)state;
    struct bench b;
    struct can_frame_t frame;
    bench_open(&b, NULL);
    assert_int_equal(b.boot.id, 0x701);
    assert_int_equal(b.boot.length, 1);
    assert_int_equal(b.boot.data[0], 0);
    assert_false(node_transmit(&b.node, &frame));
    for (int i = 0; i < 200; i++) {
        bench_tick(&b, 0.1, 0, 0.1);
        assert_int_equal(b.torques.enable, 0);
        assert_int_equal(b.torques.alpha | b.torques.beta | b.torques.insertion, 0);
    }
    bench_command(&b, 1);
    bench_tick(&b, 0.1, 0, 0.1);
    assert_int_equal(b.torques.enable, 1);
    bench_close(&b);
}

static void a_tick_sends_sync_first_then_torque_and_at_most_two_more(void **state)
{
    (void)state;
    struct bench b;
    bench_open(&b, NULL);
    bench_start(&b, 0, 0, 0.112);
    unsigned seen[2048] = {0};
    for (int i = 0; i < 1000; i++) {
        struct can_frame_t frame;
        unsigned after = 0;
        node_begin_tick(&b.node);
        assert_true(node_transmit(&b.node, &frame));
        assert_int_equal(frame.id, WIRE_SYNC_ID);
        assert_false(node_transmit(&b.node, &frame));
        bench_send_sample(&b, bench_counts(&b, 0, 0, 0.112 + 0.015 * i / 1000));
        node_finish_tick(&b.node);
        while (node_transmit(&b.node, &frame)) {
            assert_true(frame.id < 2048);
            if (after == 0) {
                assert_int_equal(frame.id, WIRE_TORQUES_ID + 1);
                assert_int_equal(frame.data[7], crc8_frame(frame.id, frame.data, 7));
            }
            seen[frame.id]++;
            after++;
        }
        assert_true(after <= 1 + TELEMETRY_FRAMES);
    }
    assert_int_equal(seen[WIRE_TORQUES_ID + 1], 1000);
    assert_int_equal(seen[WIRE_HEARTBEAT_ID + 1], 10);
    /* in 1000 ticks; a contact and no contact give at least a frame for each set, and none more than a turn has */
    const struct telemetry_pace *pace = &telemetry_paces[0];
    assert_int_equal(seen[WIRE_HEALTH_ID + 1], 1000 / pace->health);
    assert_int_equal(seen[WIRE_FORCE_POSE_ID + 1], 2 * 1000 / pace->pose);
    assert_in_range(seen[WIRE_CONTACT_ID + 1], 1000 / pace->set, 1000 / pace->contact);
    assert_int_equal(b.node.queue_overflows, 0);
    bench_close(&b);
}

static void unsent_frames_are_dropped_and_counted_never_sent_late(void **state)
{
    (void)state;
    struct bench b;
    struct can_frame_t frame;
    bench_open(&b, NULL);
    bench_tick(&b, 0, 0, 0.1);
    node_finish_tick(&b.node); /* torque and telemetry stay in the queue */
    uint32_t waiting = b.node.queue_count;
    assert_true(waiting >= 2);
    node_begin_tick(&b.node);
    assert_int_equal(b.node.queue_overflows, waiting);
    assert_true(node_transmit(&b.node, &frame));
    assert_int_equal(frame.id, WIRE_SYNC_ID);
    assert_false(node_transmit(&b.node, &frame));
    bench_close(&b);
}

static void any_frame_at_all_is_survived_with_bounded_torque(void **state)
{
    (void)state;
    struct bench b;
    bench_open(&b, NULL);
    bench_start(&b, 0, 0, 0.118);
    random_seed("garbage", 10);
    for (int tick = 0; tick < 20000; tick++) {
        struct can_frame_t frame;
        node_begin_tick(&b.node);
        while (node_transmit(&b.node, &frame)) {
        }
        for (unsigned k = random_below(6); k-- > 0;) {
            static const uint32_t ids[] = {0x000, 0x080, 0x081, 0x181, 0x181, 0x181, 0x201, 0x581, 0x7FF};
            frame.id = random_below(2) ? ids[random_below(sizeof ids / sizeof ids[0])] : random_below(1u << 29);
            frame.length = (uint8_t)(random_below(3) ? 8 : random_below(65));
            frame.flags = (uint8_t)(random_below(8) ? 0 : random_below(16));
            for (int i = 0; i < 64; i++)
                frame.data[i] = (uint8_t)random_bits();
            node_receive(&b.node, &frame);
        }
        bench_finish(&b);
        assert_true(fabs(b.torques.alpha * 1e-4) <= b.bank.tools[0].axis[0].effort_limit + 1e-4);
        assert_true(fabs(b.torques.insertion * 1e-3) <= b.bank.tools[0].axis[2].effort_limit + 1e-3);
    }
    const struct safety *s = &b.node.controller.instrument[0].safety;
    printf("# ignored %u malformed %u implausible %u duplicates %u out of sequence %u missed %u\n",
           b.node.frames_ignored, b.node.frames_malformed, s->implausible, s->duplicates, s->out_of_sequence,
           s->missed);
    assert_true(b.node.frames_ignored && b.node.frames_malformed && s->implausible && s->out_of_sequence);
    bench_close(&b);
}

static void of_several_samples_in_a_tick_the_newest_counts(void **state)
{
    (void)state;
    struct bench b;
    bench_open(&b, NULL);
    bench_start(&b, 0, 0, 0.1);
    uint8_t next = b.sequence & 15;
    node_begin_tick(&b.node);
    for (int k = 1; k >= 0; k--) { /* newer first, then the late one */
        struct can_frame_t frame = bench_frame(0x181, 8);
        struct wire_encoders m = bench_counts(&b, 0, 0, k ? 0.1002 : 0.1001);
        m.sequence = (uint8_t)(next + k) & 15;
        wire_encoders_pack(frame.data, &m);
        node_receive(&b.node, &frame);
    }
    bench_finish(&b);
    assert_true(fabs(b.node.controller.instrument[0].kinematics.joint[2] - 0.1002) < 2.3e-5);
    assert_int_equal(b.node.controller.instrument[0].safety.out_of_sequence, 1);
    bench_close(&b);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boots_with_a_heartbeat_and_zero_torque_until_started),
        cmocka_unit_test(a_tick_sends_sync_first_then_torque_and_at_most_two_more),
        cmocka_unit_test(unsent_frames_are_dropped_and_counted_never_sent_late),
        cmocka_unit_test(any_frame_at_all_is_survived_with_bounded_torque),
        cmocka_unit_test(of_several_samples_in_a_tick_the_newest_counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
