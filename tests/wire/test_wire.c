/* The generated packing against the DBC's rule applied bit by bit, for every message. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "dbc.h"
#include "wire.h"

/* Where the generated struct keeps a signal. A signal of wire.dbc that is missing here fails the test. */
struct place {
    const char *message, *signal;
    size_t offset, size;
};

#define AT(Message, message, Signal, signal)                                                                           \
    {                                                                                                                  \
#Message, #Signal, offsetof(struct wire_##message, signal), sizeof(((struct wire_##message *)0)->signal)       \
    }

static const struct place places[] = {
    AT(Nmt, nmt, Command, command),
    AT(Nmt, nmt, Node, node),
    AT(Sync, sync, Counter, counter),
    AT(Emergency, emergency, ErrorCode, error_code),
    AT(Emergency, emergency, ErrorRegister, error_register),
    AT(Emergency, emergency, State, state),
    AT(Emergency, emergency, Reason, reason),
    AT(Emergency, emergency, Tick, tick),
    AT(Encoders, encoders, Alpha, alpha),
    AT(Encoders, encoders, Beta, beta),
    AT(Encoders, encoders, Insertion, insertion),
    AT(Encoders, encoders, Roll, roll),
    AT(Encoders, encoders, Grip, grip),
    AT(Encoders, encoders, Sequence, sequence),
    AT(Torques, torques, Alpha, alpha),
    AT(Torques, torques, Beta, beta),
    AT(Torques, torques, Insertion, insertion),
    AT(Torques, torques, Enable, enable),
    AT(Torques, torques, Sequence, sequence),
    AT(Torques, torques, Crc, crc),
    AT(Contact, contact, Part, part),
    AT(Contact, contact, Slot, slot),
    AT(Contact, contact, Set, set),
    AT(Contact, contact, Triangle, triangle),
    AT(Contact, contact, Weight1, weight1),
    AT(Contact, contact, Weight2, weight2),
    AT(Contact, contact, Count, count),
    AT(Contact, contact, DisplacementX, displacement_x),
    AT(Contact, contact, DisplacementY, displacement_y),
    AT(Contact, contact, DisplacementZ, displacement_z),
    AT(ForcePose, force_pose, Part, part),
    AT(ForcePose, force_pose, Set, set),
    AT(ForcePose, force_pose, TipX, tip_x),
    AT(ForcePose, force_pose, TipY, tip_y),
    AT(ForcePose, force_pose, TipZ, tip_z),
    AT(ForcePose, force_pose, ForceX, force_x),
    AT(ForcePose, force_pose, ForceY, force_y),
    AT(ForcePose, force_pose, ForceZ, force_z),
    AT(ForcePose, force_pose, Contacts, contacts),
    AT(ForcePose, force_pose, State, state),
    AT(Health, health, Page, page),
    AT(Health, health, State, state),
    AT(Health, health, Missed, missed),
    AT(Health, health, Implausible, implausible),
    AT(Health, health, OutOfSequence, out_of_sequence),
    AT(Health, health, Duplicates, duplicates),
    AT(Health, health, Overruns, overruns),
    AT(Health, health, SafeEntries, safe_entries),
    AT(Health, health, Clamps, clamps),
    AT(Health, health, RateLimits, rate_limits),
    AT(Health, health, PassivityInterventions, passivity_interventions),
    AT(Health, health, Malformed, malformed),
    AT(Health, health, QueueOverflows, queue_overflows),
    AT(Health, health, Reason, reason),
    AT(Health, health, Tick, tick),
    AT(Health, health, Energy, energy),
    AT(Health, health, WalksCut, walks_cut),
    AT(Health, health, SolverCuts, solver_cuts),
    AT(Health, health, Nonfinite, nonfinite),
    AT(Health, health, ReceiveOverflows, receive_overflows),
    AT(Health, health, ErrorPassive, error_passive),
    AT(Health, health, BusOff, bus_off),
    AT(Health, health, ContactsHeld, contacts_held),
    AT(Health, health, ContactsWaiting, contacts_waiting),
    AT(Health, health, RowsDropped, rows_dropped),
    AT(Health, health, RowWork, row_work),
    AT(Health, health, WorstTick, worst_tick),
    AT(Health, health, StateHash, state_hash),
    AT(Health, health, HashTick, hash_tick),
    AT(Heartbeat, heartbeat, NmtState, nmt_state),
    AT(HostHeartbeat, host_heartbeat, NmtState, nmt_state),
};

struct codec {
    const char *name;
    uint32_t id;
    unsigned length;
    size_t size;
    void (*pack)(uint8_t *data, const void *m);
    bool (*unpack)(void *m, const uint8_t *data, uint8_t length);
};

#define CODEC(name)                                                                                                    \
    static void pack_##name(uint8_t *data, const void *m)                                                              \
    {                                                                                                                  \
        wire_##name##_pack(data, m);                                                                                   \
    }                                                                                                                  \
    static bool unpack_##name(void *m, const uint8_t *data, uint8_t length)                                            \
    {                                                                                                                  \
        return wire_##name##_unpack(m, data, length);                                                                  \
    }
CODEC(nmt)
CODEC(sync)
CODEC(emergency)
CODEC(encoders)
CODEC(torques)
CODEC(contact)
CODEC(force_pose)
CODEC(health)
CODEC(heartbeat)
CODEC(host_heartbeat)

#define ROW(Name, NAME, name)                                                                                          \
    {                                                                                                                  \
#Name, WIRE_##NAME##_ID, WIRE_##NAME##_LENGTH, sizeof(struct wire_##name), pack_##name, unpack_##name          \
    }
static const struct codec codecs[] = {
    ROW(Nmt, NMT, nmt),
    ROW(Sync, SYNC, sync),
    ROW(Emergency, EMERGENCY, emergency),
    ROW(Encoders, ENCODERS, encoders),
    ROW(Torques, TORQUES, torques),
    ROW(Contact, CONTACT, contact),
    ROW(ForcePose, FORCE_POSE, force_pose),
    ROW(Health, HEALTH, health),
    ROW(Heartbeat, HEARTBEAT, heartbeat),
    ROW(HostHeartbeat, HOST_HEARTBEAT, host_heartbeat),
};

enum { ROOM = 128 }; /* bytes for any message as a struct */
static uint64_t seed = 20240611;

static uint64_t random_bits(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return seed;
}

static struct dbc *read_wire(void)
{
    struct dbc *dbc = NULL;
    struct failure why = {0};
    if (dbc_read("shared/wire.dbc", &dbc, &why) != STATUS_OK)
        fail_msg("%s: %s", why.place, why.cause);
    return dbc;
}

static const struct codec *codec_of(const struct dbc_message *m)
{
    for (size_t i = 0; i < sizeof codecs / sizeof codecs[0]; i++)
        if (strcmp(codecs[i].name, m->name) == 0)
            return &codecs[i];
    fail_msg("message %s of wire.dbc is not tested", m->name);
    return NULL;
}

static const struct place *place_of(const struct dbc_message *m, const struct dbc_signal *signal)
{
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++)
        if (strcmp(places[i].message, m->name) == 0 && strcmp(places[i].signal, signal->name) == 0)
            return &places[i];
    fail_msg("signal %s of %s is not tested", signal->name, m->name);
    return NULL;
}

/* The rule of the DBC language, one bit at a time: bit k of an Intel signal is bit (start + k) mod 8 of byte
 * (start + k) div 8; a signed one is in two's complement. */
static int64_t bits_of(const uint8_t *data, const struct dbc_signal *signal)
{
    int64_t value = 0;
    for (unsigned k = 0; k < signal->bits; k++) {
        const unsigned at = signal->start + k;
        if (data[at / 8] >> at % 8 & 1) {
            const int64_t weight = INT64_C(1) << k;
            value += signal->is_signed && k == signal->bits - 1 ? -weight : weight;
        }
    }
    return value;
}

static void put_bits(uint8_t *data, const struct dbc_signal *signal, uint64_t value)
{
    for (unsigned k = 0; k < signal->bits; k++) {
        const unsigned at = signal->start + k;
        if (value >> k & 1)
            data[at / 8] |= (uint8_t)(1u << at % 8);
    }
}

static int64_t member(const void *m, const struct place *place, bool is_signed)
{
    const void *at = (const char *)m + place->offset;
    if (place->size == 1)
        return is_signed ? *(const int8_t *)at : *(const uint8_t *)at;
    if (place->size == 2)
        return is_signed ? *(const int16_t *)at : *(const uint16_t *)at;
    return is_signed ? *(const int32_t *)at : (int64_t) * (const uint32_t *)at;
}

static const struct dbc_signal *selector_of(const struct dbc_message *m)
{
    for (size_t i = 0; i < m->signal_count; i++)
        if (m->signal[i].kind == DBC_SELECTOR)
            return &m->signal[i];
    return NULL;
}

static bool present(const struct dbc_signal *signal, int64_t page)
{
    return signal->kind != DBC_PAGED || (int64_t)signal->page == page;
}

static bool page_exists(const struct dbc_message *m, int64_t page)
{
    for (size_t i = 0; i < m->signal_count; i++)
        if (m->signal[i].kind == DBC_PAGED && (int64_t)m->signal[i].page == page)
            return true;
    return false;
}

static void pack_follows_the_dbc_for_every_message(void **state)
{
    (void)state;
    struct dbc *dbc = read_wire();
    print_message("# seed %llu\n", (unsigned long long)seed);
    for (size_t i = 0; i < dbc->message_count; i++) {
        const struct dbc_message *m = &dbc->message[i];
        const struct codec *codec = codec_of(m);
        for (int round = 0; round < 20000; round++) {
            _Alignas(8) uint8_t raw[ROOM];
            for (size_t k = 0; k < sizeof raw; k++) /* members hold more bits than the frame: the rest must not leak */
                raw[k] = (uint8_t)random_bits();
            const struct dbc_signal *selector = selector_of(m);
            const int64_t page =
                selector ? member(raw, place_of(m, selector), false) & ((INT64_C(1) << selector->bits) - 1) : 0;
            uint8_t expected[8] = {0}, data[8];
            for (size_t k = 0; k < m->signal_count; k++)
                if (present(&m->signal[k], page))
                    put_bits(expected, &m->signal[k],
                             (uint64_t)member(raw, place_of(m, &m->signal[k]), m->signal[k].is_signed));
            memset(data, 0xa5, sizeof data);
            codec->pack(data, raw);
            if (memcmp(data, expected, sizeof data) != 0)
                fail_msg("%s, round %d", m->name, round);
        }
    }
    dbc_free(dbc);
}

static void unpack_follows_the_dbc_for_every_message(void **state)
{
    (void)state;
    struct dbc *dbc = read_wire();
    print_message("# seed %llu\n", (unsigned long long)seed);
    for (size_t i = 0; i < dbc->message_count; i++) {
        const struct dbc_message *m = &dbc->message[i];
        const struct codec *codec = codec_of(m);
        const struct dbc_signal *selector = selector_of(m);
        for (int round = 0; round < 20000; round++) {
            uint8_t data[8];
            for (size_t k = 0; k < sizeof data; k++)
                data[k] = (uint8_t)random_bits();
            _Alignas(8) uint8_t before[ROOM], after[ROOM];
            const int filler = (int)(random_bits() & 0xff);
            memset(before, filler, sizeof before);
            memset(after, filler, sizeof after);
            const int64_t page = selector ? bits_of(data, selector) : 0;
            const bool good = !selector || page_exists(m, page);
            assert_int_equal(codec->unpack(after, data, (uint8_t)m->length), good);
            for (size_t k = 0; k < m->signal_count; k++) {
                const struct dbc_signal *signal = &m->signal[k];
                const struct place *at = place_of(m, signal);
                const bool written = good && present(signal, page);
                if (member(after, at, signal->is_signed) !=
                    (written ? bits_of(data, signal) : member(before, at, signal->is_signed)))
                    fail_msg("%s.%s, round %d", m->name, signal->name, round);
            }
        }
    }
    dbc_free(dbc);
}

static void a_wrong_length_is_refused_and_changes_nothing(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof codecs / sizeof codecs[0]; i++)
        for (unsigned length = 0; length < 256; length++) {
            const uint8_t data[8] = {0};
            _Alignas(8) uint8_t before[ROOM], after[ROOM];
            memset(before, 0x5a, sizeof before);
            memset(after, 0x5a, sizeof after);
            assert_int_equal(codecs[i].unpack(after, data, (uint8_t)length), length == codecs[i].length);
            if (length != codecs[i].length)
                assert_memory_equal(before, after, sizeof before);
        }
}

static void identifiers_lengths_and_types_are_those_of_the_dbc(void **state)
{
    (void)state;
    struct dbc *dbc = read_wire();
    assert_int_equal(dbc->message_count, sizeof codecs / sizeof codecs[0]);
    size_t signals = 0;
    for (size_t i = 0; i < dbc->message_count; i++) {
        const struct dbc_message *m = &dbc->message[i];
        const struct codec *codec = codec_of(m);
        const uint32_t node = (m->id & 0x7f) == 1 ? 1 : 0;
        assert_int_equal(codec->id + node, m->id);
        assert_int_equal(codec->length, m->length);
        assert_true(codec->size <= ROOM); /* the room that the tests below give it */
        signals += m->signal_count;
        for (size_t k = 0; k < m->signal_count; k++) {
            const unsigned bits = m->signal[k].bits;
            assert_int_equal(place_of(m, &m->signal[k])->size, bits <= 8 ? 1 : bits <= 16 ? 2 : 4);
        }
    }
    assert_int_equal(signals, sizeof places / sizeof places[0]);
    dbc_free(dbc);
}

/* Independent of the parser's own check: every bit of every page has at most one owner. */
static void no_two_signals_of_a_page_share_a_bit(void **state)
{
    (void)state;
    struct dbc *dbc = read_wire();
    for (size_t i = 0; i < dbc->message_count; i++)
        for (int64_t page = 0; page < 256; page++) {
            const struct dbc_message *m = &dbc->message[i];
            int owners[64] = {0};
            for (size_t k = 0; k < m->signal_count; k++)
                for (unsigned bit = 0; bit < m->signal[k].bits && present(&m->signal[k], page); bit++) {
                    const unsigned at = m->signal[k].start + bit;
                    assert_true(at < 8 * m->length);
                    assert_int_equal(owners[at]++, 0);
                }
        }
    dbc_free(dbc);
}

static void decoding_a_frame_follows_the_dbc(void **state)
{
    (void)state;
    struct dbc *dbc = read_wire();
    print_message("# seed %llu\n", (unsigned long long)seed);
    for (size_t i = 0; i < dbc->message_count; i++)
        for (int round = 0; round < 2000; round++) {
            const struct dbc_message *m = &dbc->message[i];
            const struct dbc_signal *selector = selector_of(m);
            uint8_t data[8];
            for (size_t k = 0; k < sizeof data; k++)
                data[k] = (uint8_t)random_bits();
            const int64_t page = selector ? bits_of(data, selector) : 0;
            struct dbc_reading reading[DBC_MAX_SIGNALS];
            const size_t count = dbc_decode(m, data, m->length, reading);
            size_t expected = 0;
            for (size_t k = 0; k < m->signal_count && (!selector || page_exists(m, page)); k++)
                if (present(&m->signal[k], page)) {
                    assert_true(expected < count);
                    const struct dbc_reading *r = &reading[expected++];
                    assert_ptr_equal(r->signal, &m->signal[k]);
                    assert_int_equal(r->raw, bits_of(data, r->signal));
                    /* one product and one sum: the same in any order to a rounding */
                    assert_true(fabs(r->value - ((double)r->raw * r->signal->factor + r->signal->offset)) <=
                                1e-15 * fabs(r->value));
                }
            assert_int_equal(count, expected);
            assert_int_equal(dbc_decode(m, data, m->length + 1, reading), 0);
        }
    dbc_free(dbc);
}

static void identifiers_find_their_message_and_node(void **state)
{
    (void)state;
    struct dbc *dbc = read_wire();
    static const struct {
        uint32_t id;
        const char *name;
        unsigned node;
    } cases[] = {{0x000, "Nmt", 0},         {0x080, "Sync", 0},         {0x081, "Emergency", 1},
                 {0x0ff, "Emergency", 127}, {0x181, "Encoders", 1},     {0x205, "Torques", 5},
                 {0x2ff, "Contact", 127},   {0x382, "ForcePose", 2},    {0x501, "Health", 1},
                 {0x77e, "Heartbeat", 126}, {0x77f, "HostHeartbeat", 0}};
    unsigned node;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct dbc_message *m = dbc_find(dbc, cases[i].id, &node);
        assert_non_null(m);
        assert_string_equal(m->name, cases[i].name);
        assert_int_equal(node, cases[i].node);
    }
    static const uint32_t strangers[] = {0x001, 0x07f, 0x100, 0x180, 0x481, 0x700, 0x7ff, 0x881};
    for (size_t i = 0; i < sizeof strangers / sizeof strangers[0]; i++)
        assert_null(dbc_find(dbc, strangers[i], &node));
    dbc_free(dbc);
}

static void quantising_rounds_to_the_nearest_and_saturates(void **state)
{
    (void)state;
    print_message("# seed %llu\n", (unsigned long long)seed);
    for (int trial = 0; trial < 1000000; trial++) {
        const bool is_signed = random_bits() & 1;
        const int bits = 1 + (int)(random_bits() % (is_signed ? 32 : 31));
        const float scale = ldexpf(1 + (float)(random_bits() & 0xffff) / 65536, (int)(random_bits() % 40) - 30);
        /* from far below one step to beyond the range; halves among them */
        float steps = ldexpf((float)(int32_t)random_bits(), (int)(random_bits() % 36) - 31 - (32 - bits));
        if (random_bits() % 4 == 0)
            steps = floorf(steps) + 0.5f;
        const float value = steps * scale;
        const double maximum = ldexp(1, bits - is_signed) - 1, minimum = is_signed ? -maximum - 1 : 0;
        const double expected = fmin(fmax(round((double)(value / scale)), minimum), maximum);
        if ((double)wire_quantise(value, scale, bits, is_signed) != expected)
            fail_msg("trial %d: %a / %a in %d bits", trial, (double)value, (double)scale, bits);
    }
    assert_int_equal(wire_quantise(NAN, 1, 16, true), 0);
    assert_int_equal(wire_quantise(INFINITY, 1, 16, true), 32767);
    assert_int_equal(wire_quantise(-INFINITY, 1, 16, true), -32768);
    assert_int_equal(wire_quantise(-3, 1, 16, false), 0);
    assert_int_equal(wire_quantise(1, WIRE_CONTACT_WEIGHT1_SCALE, WIRE_CONTACT_WEIGHT1_BITS, false), 65535);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(identifiers_lengths_and_types_are_those_of_the_dbc),
        cmocka_unit_test(no_two_signals_of_a_page_share_a_bit),
        cmocka_unit_test(pack_follows_the_dbc_for_every_message),
        cmocka_unit_test(unpack_follows_the_dbc_for_every_message),
        cmocka_unit_test(a_wrong_length_is_refused_and_changes_nothing),
        cmocka_unit_test(decoding_a_frame_follows_the_dbc),
        cmocka_unit_test(identifiers_find_their_message_and_node),
        cmocka_unit_test(quantising_rounds_to_the_nearest_and_saturates),
    };
    return cmocka_run_group_tests_name("wire", tests, NULL, NULL);
}
