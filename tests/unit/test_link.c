/* What the host makes of frames that are lost, repeated, late or garbage: never a set that was not sent. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "crc.h"
#include "link.h"
#include "status.h"
#include "wire.h"

static uint64_t seed = 31337;

static uint32_t random32(void)
{
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(seed >> 32);
}

static bool chance(double probability)
{
    return random32() < probability * 4294967296.0;
}

/* Everything about contact `slot` of set `number` follows from these two, so that what is heard can be judged. The
 * triangle of slot 0 is the set's number. */
static uint32_t hash(uint32_t number, uint32_t slot, uint32_t what)
{
    uint64_t z = ((uint64_t)number << 16 | slot << 8 | what) * UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 29) * UINT64_C(0xbf58476d1ce4e5b9);
    return (uint32_t)(z >> 32);
}

static unsigned count_of(uint32_t number)
{
    static const unsigned common[] = {1, 1, 1, 2, 3, 7, 10, 16};
    return common[hash(number, 99, 0) % 8];
}

static struct can_frame_t contact_frame(uint32_t number, unsigned slot, unsigned part)
{
    const struct wire_contact m = {
        .part = (uint8_t)part,
        .slot = (uint8_t)slot,
        .set = (uint8_t)number,
        .triangle = slot == 0 ? number : hash(number, slot, 1) & 0x1ffff,
        .weight1 = (uint16_t)(hash(number, slot, 2) & 0x7fff),
        .weight2 = (uint16_t)(hash(number, slot, 3) & 0x7fff),
        .count = (uint8_t)count_of(number),
        .displacement_x = (int32_t)(hash(number, slot, 4) & 0x3ffff) - 0x20000,
        .displacement_y = (int32_t)(hash(number, slot, 5) & 0x3ffff) - 0x20000,
        .displacement_z = (int32_t)(hash(number, slot, 6) & 0x3ffff) - 0x20000,
    };
    struct can_frame_t frame = {.id = WIRE_CONTACT_ID + 1, .length = WIRE_CONTACT_LENGTH};
    wire_contact_pack(frame.data, &m);
    return frame;
}

/* The set that the link holds is the one its first triangle names, in every number. */
static void assert_is_a_set_that_was_sent(const struct link *link, uint32_t newest)
{
    const uint32_t number = link->contact[0].triangle;
    assert_true(number <= newest && link->contact_count == count_of(number));
    for (uint32_t slot = 0; slot < link->contact_count; slot++) {
        const struct link_contact *c = &link->contact[slot];
        if (slot > 0)
            assert_int_equal(c->triangle, hash(number, slot, 1) & 0x1ffff);
        /* the scales are floats: half an ulp, 6e-8, of the value */
        for (uint32_t k = 0; k < 2; k++)
            assert_true(fabs(c->weights[k] * 65535 - (hash(number, slot, 2 + k) & 0x7fff)) < 6e-8 * 32768);
        for (uint32_t k = 0; k < 3; k++)
            assert_true(fabs(c->displacement_m[k] * 1e6 - ((double)(hash(number, slot, 4 + k) & 0x3ffff) - 0x20000)) <
                        6e-8 * 131072);
    }
}

/* A channel that loses, repeats and delays frames (and so reorders them). */
enum { CHANNEL = 4096 };
struct channel {
    size_t count;
    struct can_frame_t frame[CHANNEL];
    uint64_t due_us[CHANNEL];
    double drop, duplicate, late;
    uint64_t latest_us; /* bound of the delay */
    uint64_t silent_until_us;
};

static void channel_send(struct channel *c, const struct can_frame_t *frame, uint64_t now_us)
{
    for (int copies = chance(c->duplicate) ? 2 : 1; copies > 0; copies--) {
        if (chance(c->drop) || now_us < c->silent_until_us)
            continue;
        assert_true(c->count < CHANNEL);
        c->due_us[c->count] = now_us + (chance(c->late) ? random32() % c->latest_us : 0);
        c->frame[c->count++] = *frame;
    }
}

/* Hand over all frames that are due, earliest first. */
static void channel_deliver(struct channel *c, struct link *link, uint64_t now_us, uint32_t newest)
{
    for (;;) {
        size_t first = c->count;
        for (size_t i = 0; i < c->count; i++)
            if (c->due_us[i] <= now_us && (first == c->count || c->due_us[i] < c->due_us[first]))
                first = i;
        if (first == c->count)
            return;
        const struct can_frame_t frame = c->frame[first];
        const uint64_t due_us = c->due_us[first], sets = link->contact_sets;
        c->count--;
        memmove(&c->frame[first], &c->frame[first + 1], (c->count - first) * sizeof c->frame[0]);
        memmove(&c->due_us[first], &c->due_us[first + 1], (c->count - first) * sizeof c->due_us[0]);
        link_receive(link, &frame, due_us);
        if (link->contact_sets != sets)
            assert_is_a_set_that_was_sent(link, newest);
    }
}

/* As a controller alone on its bus does (telemetry.h): a frame every 2 ms; a new set when the last is done, at most every
 * 16 ms. */
static uint64_t run_channel(struct channel *c, struct link *link, uint32_t sets, bool pauses)
{
    uint64_t now_us = 1000000;
    link_start(link, 1);
    for (uint32_t number = 0; number < sets; number++) {
        if (pauses && chance(0.01)) /* nothing for up to three turns of the set number */
            c->silent_until_us = now_us + random32() % 1600000;
        const uint64_t next_us = now_us + 16000;
        for (unsigned i = 0; i < 2 * count_of(number); i++, now_us += 2000) {
            const struct can_frame_t frame = contact_frame(number, i / 2, i % 2);
            channel_send(c, &frame, now_us);
            channel_deliver(c, link, now_us, number);
        }
        now_us = now_us > next_us ? now_us : next_us;
    }
    channel_deliver(c, link, now_us + 100000, sets - 1);
    return link->contact_sets;
}

static void a_clean_channel_delivers_every_set(void **state)
{
    (void)state;
    static struct channel c;
    struct link link;
    memset(&c, 0, sizeof c);
    assert_int_equal(run_channel(&c, &link, 5000, false), 5000);
    assert_int_equal(link.malformed + link.foreign + link.late + link.incomplete_sets, 0);
    assert_int_equal(link.contact[0].triangle, 4999);
}

static void repeated_and_reordered_frames_lose_no_set(void **state)
{
    (void)state;
    static struct channel c;
    struct link link;
    print_message("# seed %llu\n", (unsigned long long)seed);
    memset(&c, 0, sizeof c);
    c.duplicate = 0.3;
    assert_int_equal(run_channel(&c, &link, 5000, false), 5000);
    assert_true(link.late > 0);
    assert_int_equal(link.incomplete_sets + link.malformed, 0);
    /* within a set any order will do: 16 contacts, backwards */
    link_start(&link, 1);
    uint32_t number = 0;
    while (count_of(number) != 16)
        number++;
    for (int i = 31; i >= 0; i--) {
        const struct can_frame_t frame = contact_frame(number, (unsigned)i / 2, (unsigned)i % 2);
        link_receive(&link, &frame, 1000);
    }
    assert_int_equal(link.contact_sets, 1);
    assert_is_a_set_that_was_sent(&link, number);
}

static void a_bad_channel_never_mixes_two_sets(void **state)
{
    (void)state;
    static struct channel c;
    struct link link;
    print_message("# seed %llu\n", (unsigned long long)seed);
    for (int round = 0; round < 30; round++) {
        memset(&c, 0, sizeof c);
        c.drop = 0.02 * (round % 20);
        c.duplicate = 0.2;
        c.late = 0.1 * (round % 5);
        c.latest_us = 99000; /* link.h promises this up to 100 ms */
        const uint64_t sets = run_channel(&c, &link, 2000, round % 2);
        assert_true(sets > 0 && sets <= 2000);
        assert_int_equal(link.malformed, 0);
    }
}

static void an_incomplete_set_is_not_finished_by_one_of_the_same_number(void **state)
{
    (void)state;
    struct link link;
    link_start(&link, 1);
    uint32_t number = 0;
    while (count_of(number) != 1 || count_of(number + 32) != 1)
        number++;
    const struct can_frame_t first = contact_frame(number, 0, 0), second = contact_frame(number + 32, 0, 1);
    link_receive(&link, &first, 1000000);
    link_receive(&link, &second,
                 1000000 + 412000); /* the first 100 ms late: the soonest that the number can come again */
    assert_int_equal(link.contact_sets, 0);
    assert_int_equal(link.incomplete_sets, 1);
}

static void frames_that_contradict_each_other_throw_the_set_away(void **state)
{
    (void)state;
    struct link link;
    link_start(&link, 1);
    uint32_t number = 0;
    while (count_of(number) != 2)
        number++;
    struct can_frame_t other = contact_frame(number, 0, 0);
    other.data[2] ^= 1; /* the triangle */
    const struct can_frame_t frames[] = {contact_frame(number, 0, 0), other, contact_frame(number, 0, 1),
                                         contact_frame(number, 1, 0), contact_frame(number, 1, 1)};
    for (size_t i = 0; i < 5; i++)
        link_receive(&link, &frames[i], 1000 + i);
    assert_int_equal(link.contact_sets, 0);
    assert_int_equal(link.malformed, 1);
    assert_int_equal(link.incomplete_sets, 1);
    assert_int_equal(link.late, 3);
}

static void frames_that_disagree_about_the_count_throw_the_set_away(void **state)
{
    (void)state;
    struct link link;
    link_start(&link, 1);
    struct can_frame_t frame = {.id = WIRE_CONTACT_ID + 1, .length = WIRE_CONTACT_LENGTH};
    const struct wire_contact parts[] = {{.part = 0, .slot = 0, .count = 3},
                                         {.part = 1, .slot = 0},
                                         {.part = 0, .slot = 1, .count = 2},
                                         {.part = 1, .slot = 1}};
    for (size_t i = 0; i < 4; i++) {
        wire_contact_pack(frame.data, &parts[i]);
        link_receive(&link, &frame, 1000 + i);
    }
    assert_int_equal(link.contact_sets, 0);
    assert_int_equal(link.malformed, 1);
}

static void a_late_frame_does_not_end_the_set_under_way(void **state)
{
    (void)state;
    struct link link;
    link_start(&link, 1);
    uint32_t number = 16; /* some way from the turn of the set number, and across it */
    while (count_of(number) != 2)
        number++;
    for (uint32_t behind = 1; behind <= 15; behind++) {
        link_start(&link, 1);
        for (unsigned i = 0; i < 4; i++) {
            const struct can_frame_t frame = contact_frame(number, i / 2, i % 2);
            const struct can_frame_t late = contact_frame(number - behind, 0, i % 2);
            link_receive(&link, &frame, 1000 + i);
            link_receive(&link, &late, 1000 + i);
        }
        assert_int_equal(link.contact_sets, 1);
        assert_int_equal(link.late, 4);
        assert_is_a_set_that_was_sent(&link, number);
    }
}

static void count_zero_says_that_contact_was_lost(void **state)
{
    (void)state;
    struct link link;
    link_start(&link, 1);
    for (unsigned part = 0; part < 2; part++)
        for (unsigned slot = 0; slot < count_of(0); slot++) {
            const struct can_frame_t frame = contact_frame(0, slot, part);
            link_receive(&link, &frame, 1000);
        }
    assert_int_equal(link.contact_count, count_of(0));
    const struct wire_contact lost = {.set = 1};
    struct can_frame_t frame = {.id = WIRE_CONTACT_ID + 1, .length = WIRE_CONTACT_LENGTH};
    wire_contact_pack(frame.data, &lost);
    link_receive(&link, &frame, 2000);
    assert_int_equal(link.contact_count, 0);
    assert_int_equal(link.contact_sets, 2);
    assert_int_equal(link.contact_time_us, 2000);
}

static void impossible_contacts_are_counted_and_ignored(void **state)
{
    (void)state;
    struct link link;
    link_start(&link, 1);
    const struct wire_contact bad[] = {
        {.count = 17, .slot = 3},                         /* more than there can be */
        {.count = 2, .slot = 2},                          /* a slot beyond the count */
        {.count = 0, .slot = 1},                          /* lost, but not in slot 0 */
        {.count = 1, .weight1 = 40000, .weight2 = 40000}, /* weights that sum to more than 1 */
    };
    struct can_frame_t frame = {.id = WIRE_CONTACT_ID + 1, .length = WIRE_CONTACT_LENGTH};
    for (size_t i = 0; i < 4; i++) {
        wire_contact_pack(frame.data, &bad[i]);
        link_receive(&link, &frame, 1000);
    }
    frame.length = 7;
    link_receive(&link, &frame, 1000);
    assert_int_equal(link.malformed, 5);
    assert_int_equal(link.contact_sets, 0);
}

static void tip_and_force_come_in_pairs(void **state)
{
    (void)state;
    struct link link;
    link_start(&link, 1);
    for (uint32_t i = 0; i < 1000; i++) {
        const bool lose = i % 10 == 3, swap = i % 2;
        for (unsigned k = 0; k < 2; k++) {
            const struct wire_force_pose m = {.part = (uint8_t)(k ^ swap),
                                              .set = (uint8_t)(i & 7),
                                              .tip_x = (int32_t)i,
                                              .tip_y = -(int32_t)i,
                                              .tip_z = 500000,
                                              .force_x = (int16_t)i,
                                              .force_y = -1000,
                                              .force_z = 2000,
                                              .contacts = 3,
                                              .state = 2};
            struct can_frame_t frame = {.id = WIRE_FORCE_POSE_ID + 1, .length = WIRE_FORCE_POSE_LENGTH};
            wire_force_pose_pack(frame.data, &m);
            if (!(lose && k == 0))
                link_receive(&link, &frame, 10000 * i + k);
        }
        const double expected = lose ? i - 1 : i; /* tip and force are of the same pair, always */
        assert_true(fabs(link.tip_m[0] - 2e-6 * expected) < 1e-10 && fabs(link.force_N[0] - 1e-3 * expected) < 1e-7);
    }
    assert_int_equal(link.pose_sets, 900);
    assert_int_equal(link.incomplete_sets, 100);
    assert_int_equal(link.state, 2);
    assert_int_equal(link.contacts_reported, 3);
    assert_true(fabs(link.tip_m[2] - 1) < 1e-7 && fabs(link.force_N[1] + 1) < 1e-7);
}

static void health_emergency_and_heartbeat_are_kept(void **state)
{
    (void)state;
    struct link link;
    link_start(&link, 5);
    struct can_frame_t frame = {.id = WIRE_HEALTH_ID + 5, .length = WIRE_HEALTH_LENGTH};
    struct wire_health m = {.state = 1,
                            .missed = 101,
                            .implausible = 102,
                            .out_of_sequence = 103,
                            .duplicates = 104,
                            .overruns = 105,
                            .safe_entries = 106,
                            .clamps = 107,
                            .rate_limits = 108,
                            .passivity_interventions = 109,
                            .malformed = 110,
                            .queue_overflows = 111,
                            .reason = -700,
                            .tick = 123456789,
                            .energy = 118,
                            .walks_cut = 112,
                            .solver_cuts = 113,
                            .nonfinite = 114,
                            .receive_overflows = 115,
                            .error_passive = 116,
                            .bus_off = 117,
                            .contacts_held = 118,
                            .contacts_waiting = 119,
                            .rows_dropped = 120,
                            .row_work = 121,
                            .worst_tick = 122,
                            .state_hash = 123,
                            .hash_tick = 124};
    for (m.page = 0; m.page < 10; m.page++) {
        wire_health_pack(frame.data, &m);
        link_receive(&link, &frame, 1000u + m.page);
    }
    unsigned names = 0;
    for (; link_health_name(names); names++)
        assert_int_equal(link.health[names], strcmp(link_health_name(names), "tick") == 0           ? 123456789
                                             : strcmp(link_health_name(names), "energy_100uJ") == 0 ? 118
                                                                                                    : 101 + names);
    assert_int_equal(names, 26);
    assert_int_equal(link.reason, -700);
    assert_int_equal(link.health_time_us, 1009);

    const struct wire_emergency e = {
        .error_code = 0x1000, .error_register = 1, .state = 3, .reason = STATUS_LOOP_STALE};
    frame = (struct can_frame_t){.id = WIRE_EMERGENCY_ID + 5, .length = WIRE_EMERGENCY_LENGTH};
    wire_emergency_pack(frame.data, &e);
    link_receive(&link, &frame, 2000);
    assert_int_equal(link.state, 3);
    assert_int_equal(link.reason, STATUS_LOOP_STALE);

    frame = (struct can_frame_t){.id = 0x705, .length = 1, .data = {4}};
    link_receive(&link, &frame, 3000);
    assert_int_equal(link.heartbeat_time_us, 3000);
    assert_int_equal(link.nmt_state, 4);
    frame.data[0] = 6; /* no such state */
    link_receive(&link, &frame, 4000);
    assert_int_equal(link.heartbeat_time_us, 3000);
    assert_int_equal(link.malformed, 1);
}

static void frames_of_others_are_told_apart(void **state)
{
    (void)state;
    struct link link;
    link_start(&link, 1);
    const struct can_frame_t foreign[] = {
        {.id = 0x282, .length = 8},                             /* node 2 */
        {.id = 0x481, .length = 8},                             /* no frame of this protocol */
        {.id = 0x281, .length = 8, .flags = CAN_FLAG_FD},       /* not classic */
        {.id = 0x281, .length = 8, .flags = CAN_FLAG_RTR},      /* no data */
        {.id = 0x281, .length = 8, .flags = CAN_FLAG_EXTENDED}, /* another identifier */
        {.id = 0x8281, .length = 8},
    };
    for (size_t i = 0; i < 6; i++)
        link_receive(&link, &foreign[i], 0);
    assert_int_equal(link.foreign, 6);
    struct can_frame_t own[] = {{.id = 0x000, .length = 2},
                                {.id = 0x080, .length = 1},
                                {.id = 0x77f, .length = 1},
                                {.id = 0x181, .length = 8},
                                {.id = 0x201, .length = 8}};
    own[4].data[7] = crc8_frame(own[4].id, own[4].data, 7);
    for (size_t i = 0; i < 5; i++)
        link_receive(&link, &own[i], 0);
    assert_int_equal(link.foreign, 6);
    assert_int_equal(link.malformed, 0);
    own[4].data[7] ^= 1; /* the torque frame's CRC */
    link_receive(&link, &own[4], 0);
    assert_int_equal(link.malformed, 1);
    assert_int_equal(link.frames, 12);
}

static void a_storm_of_garbage_is_survived(void **state)
{
    (void)state;
    struct link link;
    print_message("# seed %llu\n", (unsigned long long)seed);
    link_start(&link, 1);
    static const uint16_t bases[] = {0x080, 0x180, 0x200, 0x280, 0x280, 0x280, 0x380, 0x500, 0x700};
    for (int i = 0; i < 1000000; i++) {
        struct can_frame_t frame = {.id = random32() & 0x7ff, .length = 8};
        if (random32() % 4)
            frame.id = bases[random32() % 9] + 1u;
        if (random32() % 8 == 0) {
            frame.length = (uint8_t)(random32() % 65);
            frame.flags = (uint8_t)(random32() & 15);
        }
        const uint32_t low = random32(), high = random32();
        memcpy(frame.data, &low, 4);
        memcpy(frame.data + 4, &high, 4);
        link_receive(&link, &frame, (uint64_t)i * 50);
        assert_true(link.contact_count <= LINK_MAX_CONTACTS && link.state <= 3 && link.reason <= 0);
        for (size_t k = 0; k < link.contact_count; k++)
            assert_true(link.contact[k].triangle <= 131071 &&
                        link.contact[k].weights[0] + link.contact[k].weights[1] <= 1 + 1.0 / 65535);
    }
    assert_int_equal(link.frames, 1000000);
    assert_true(link.malformed + link.foreign + link.late <= link.frames && link.malformed > 100000);
    /* afterwards it hears the controller again, at the latest when the window is over */
    const uint64_t sets = link.contact_sets;
    uint32_t number = 0;
    while (count_of(number) != 1)
        number++;
    for (unsigned part = 0; part < 2; part++) {
        const struct can_frame_t frame = contact_frame(number, 0, part);
        link_receive(&link, &frame, 50000000 + LINK_CONTACT_WINDOW_US);
    }
    assert_int_equal(link.contact_sets, sets + 1);
    assert_is_a_set_that_was_sent(&link, number);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_clean_channel_delivers_every_set),
        cmocka_unit_test(repeated_and_reordered_frames_lose_no_set),
        cmocka_unit_test(a_bad_channel_never_mixes_two_sets),
        cmocka_unit_test(an_incomplete_set_is_not_finished_by_one_of_the_same_number),
        cmocka_unit_test(frames_that_contradict_each_other_throw_the_set_away),
        cmocka_unit_test(frames_that_disagree_about_the_count_throw_the_set_away),
        cmocka_unit_test(a_late_frame_does_not_end_the_set_under_way),
        cmocka_unit_test(count_zero_says_that_contact_was_lost),
        cmocka_unit_test(impossible_contacts_are_counted_and_ignored),
        cmocka_unit_test(tip_and_force_come_in_pairs),
        cmocka_unit_test(health_emergency_and_heartbeat_are_kept),
        cmocka_unit_test(frames_of_others_are_told_apart),
        cmocka_unit_test(a_storm_of_garbage_is_survived),
    };
    return cmocka_run_group_tests_name("link", tests, NULL, NULL);
}
