/* Two simulated buses and a bridge: everything passes, nothing twice, what comes back is dropped and counted; and the
 * monitor's counts beside a plain count of the same frames. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "bridge.h"
#include "bus.h"
#include "framebits.h"
#include "monitor.h"
#include "random.h"
#include "wire.h"
#include "wire_dbc.h"

struct side {
    struct bus *bus;
    int port;
    uint64_t heard;
    uint32_t sum; /* of what was heard, whatever the order */
};

static uint32_t sum_of(const struct can_frame_t *frame)
{
    uint32_t sum = frame->id * 2654435761u + frame->length;
    for (unsigned i = 0; i < frame->length; i++)
        sum = sum * 31 + frame->data[i];
    return sum;
}

static void hear(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct side *side = context;
    (void)time_us;
    side->heard++;
    side->sum += sum_of(frame);
}

static struct backend *end_of(struct bus *bus)
{
    struct backend *backend;
    struct failure why = {0};
    assert_int_equal(backend_soft(bus, NULL, &backend, &why), STATUS_OK);
    return backend;
}

static struct side side_of(struct bus *bus)
{
    return (struct side){.bus = bus};
}

static struct can_frame_t frame_of(uint32_t id, bool extended)
{
    struct can_frame_t frame = {
        .id = id, .length = (uint8_t)random_below(9), .flags = extended ? CAN_FLAG_EXTENDED : 0};
    for (unsigned i = 0; i < frame.length; i++)
        frame.data[i] = (uint8_t)random_bits();
    return frame;
}

static void settle(struct bridge *bridges, size_t count, struct bus **bus, size_t buses, uint64_t *now_us)
{
    struct failure why = {0};
    for (int round = 0; round < 20; round++) {
        *now_us += 500;
        for (size_t i = 0; i < buses; i++)
            bus_run(bus[i], *now_us);
        for (size_t i = 0; i < count; i++)
            assert_true(bridge_step(&bridges[i], 0, &why) >= 0);
    }
}

/* `bridges` bridges between two buses; both sides send on identifiers of their own. */
static void carry(size_t bridges)
{
    struct bus *bus[2] = {bus_create(1000000), bus_create(1000000)};
    struct side side[2] = {side_of(bus[0]), side_of(bus[1])};
    struct bridge *bridge = calloc(bridges, sizeof *bridge);
    struct backend *ends[4];
    uint64_t now_us = 0, sent[2] = {0, 0};
    uint32_t sum[2] = {0, 0};
    for (int i = 0; i < 2; i++) {
        side[i].port = bus_attach(bus[i], hear, &side[i]);
        assert_true(side[i].port >= 0);
    }
    for (size_t b = 0; b < bridges; b++) {
        for (size_t i = 0; i < 2; i++)
            ends[2 * b + i] = end_of(bus[i]);
        bridge_start(&bridge[b], ends[2 * b], ends[2 * b + 1]);
    }
    random_seed("bridge", 21);
    for (int round = 0; round < 300; round++) {
        for (unsigned i = 0; i < 2; i++)
            for (unsigned n = random_below(3); n > 0; n--) {
                /* odd identifiers are the first side's, even the other's; some 29-bit ones */
                const bool extended = random_below(4) == 0;
                const uint32_t id = (random_below(extended ? 200 : 2048) & ~1u) | i;
                const struct can_frame_t frame = frame_of(id, extended);
                assert_true(bus_send(bus[i], side[i].port, &frame));
                sent[i]++;
                sum[i] += sum_of(&frame);
            }
        settle(bridge, bridges, bus, 2, &now_us);
    }
    for (unsigned i = 0; i < 2; i++) {
        /* the other side heard each of them once from each bridge, and this side none of its own again */
        assert_int_equal(side[!i].heard, bridges * sent[i]);
        assert_int_equal(side[!i].sum, (uint32_t)(bridges * sum[i]));
        for (size_t b = 0; b < bridges; b++) {
            const struct bridge_way *way = &bridge[b].way[i];
            assert_int_equal(way->forwarded, sent[i]);
            assert_int_equal(way->no_room + way->refused, 0);
            /* with a second bridge each of the other side's frames comes back over it, and is dropped */
            assert_int_equal(way->looped, (bridges - 1) * sent[!i]);
            assert_int_equal(way->heard, way->forwarded + way->looped);
        }
    }
    print_message("# %zu bridges: %llu and %llu frames, %llu of them come back and dropped\n", bridges,
                  (unsigned long long)sent[0], (unsigned long long)sent[1],
                  (unsigned long long)(bridge[0].way[0].looped + bridge[0].way[1].looped));
    assert_true(sent[0] > 200 && sent[1] > 200);
    for (size_t i = 0; i < 2 * bridges; i++)
        backend_close(ends[i]);
    free(bridge);
    bus_free(bus[0]);
    bus_free(bus[1]);
}

static void every_frame_passes_once(void **state)
{
    (void)state;
    carry(1);
}

static void a_second_bridge_beside_it_makes_no_storm(void **state)
{
    (void)state;
    carry(2);
}

static void a_node_may_move_to_the_other_side(void **state)
{
    (void)state;
    struct bus *bus[2] = {bus_create(1000000), bus_create(1000000)};
    struct bridge *bridge = calloc(1, sizeof *bridge);
    struct backend *ends[2] = {end_of(bus[0]), end_of(bus[1])};
    const int ports[2] = {bus_attach(bus[0], NULL, NULL), bus_attach(bus[1], NULL, NULL)};
    uint64_t now_us = 0;
    random_seed("move", 22);
    bridge_start(bridge, ends[0], ends[1]);
    const struct can_frame_t frame = frame_of(0x181, false);
    assert_true(bus_send(bus[0], ports[0], &frame));
    settle(bridge, 1, bus, 2, &now_us);
    assert_true(bus_send(bus[1], ports[1], &frame));
    settle(bridge, 1, bus, 2, &now_us);
    assert_int_equal(bridge->way[1].looped, 1); /* too soon */
    now_us += BRIDGE_MOVE_US;
    settle(bridge, 1, bus, 2, &now_us);
    assert_true(bus_send(bus[1], ports[1], &frame));
    settle(bridge, 1, bus, 2, &now_us);
    assert_int_equal(bridge->way[1].forwarded, 1);
    backend_close(ends[0]);
    backend_close(ends[1]);
    free(bridge);
    bus_free(bus[0]);
    bus_free(bus[1]);
}

static void the_monitor_counts_what_a_plain_count_counts(void **state)
{
    (void)state;
    struct dbc *dbc;
    struct failure why = {0};
    static struct monitor monitor;
    static uint64_t count[2048];
    uint64_t bits = 0, frames = 0, reported_bits = 0;
    assert_int_equal(wire_dbc(&dbc, &why), STATUS_OK);
    monitor_start(&monitor, dbc, 500000, NULL);
    random_seed("monitor", 23);
    for (uint64_t second = 1; second <= 3; second++) {
        uint64_t before[2048];
        memcpy(before, count, sizeof before);
        for (int i = 0; i < 2000; i++) {
            static const uint32_t ids[] = {0x080, 0x181, 0x201, 0x281, 0x381, 0x501, 0x701, 0x123, 0x7F0};
            struct can_frame_t frame = frame_of(ids[random_below(9)], false);
            monitor_receive(&monitor, &frame, 1000000 * (second - 1) + 500u * (unsigned)(i + 1));
            count[frame.id]++;
            frames++;
            bits += framebits(&frame);
        }
        monitor_receive(&monitor, &(struct can_frame_t){.flags = CAN_FLAG_ERROR}, 1000000 * second);
        assert_true(monitor_window(&monitor));
        const double window_s = second == 1 ? 0.9995 : 1;
        assert_true(fabs(monitor.load - (double)(bits - reported_bits) / (5e5 * window_s)) < 1e-9);
        reported_bits = bits;
        for (size_t i = 0; i < monitor.id_count; i++) {
            const struct monitor_id *id = &monitor.id[i];
            assert_true(i == 0 || id->id > id[-1].id);
            assert_int_equal(id->count, count[id->id]);
            assert_true(fabs(id->per_second - (double)(count[id->id] - before[id->id]) / window_s) < 1e-6);
        }
        assert_false(monitor_window(&monitor)); /* no time has passed */
    }
    assert_int_equal(monitor.id_count, 9);
    assert_int_equal(monitor.frames, frames + 3);
    assert_int_equal(monitor.errors, 3);
    assert_int_equal(monitor.node_count, 1);
    /* identifiers beyond its room are counted, not forgotten */
    for (uint32_t id = 0; id < 2048; id++)
        monitor_receive(&monitor, &(struct can_frame_t){.id = id}, 4000000);
    assert_int_equal(monitor.id_count, MONITOR_IDS);
    uint64_t known = monitor.overflow + monitor.errors;
    for (size_t i = 0; i < monitor.id_count; i++)
        known += monitor.id[i].count;
    assert_int_equal(known, monitor.frames);
    dbc_free(dbc);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_frame_passes_once),
        cmocka_unit_test(a_second_bridge_beside_it_makes_no_storm),
        cmocka_unit_test(a_node_may_move_to_the_other_side),
        cmocka_unit_test(the_monitor_counts_what_a_plain_count_counts),
    };
    return cmocka_run_group_tests_name("bridge and monitor", tests, NULL, NULL);
}
