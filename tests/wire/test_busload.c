/* What the protocol takes of the bus: the closed formula, every stuffing of short frames and many of long ones, the frames
 * that a controller really sends, and two instruments on one bus. */
#include "loop/loop_fixture.h"

#include <stdio.h>

#include "busload.h"
#include "framebits.h"
#include "random.h"
#include "wire_dbc.h"

static const uint32_t nodes[] = {1, 2, 37, 85, 126};

/* SYNC, heartbeats and NMT: every payload. The bound is never passed; for some frame of each length it is nearly met. */
static void no_short_frame_is_longer_than_the_formula(void **state)
{
    (void)state;
    static const struct {
        uint32_t id;
        unsigned length;
    } frames[] = {{WIRE_SYNC_ID, 1}, {WIRE_HEARTBEAT_ID + 1, 1}, {WIRE_HEARTBEAT_ID + 126, 1}, {0x77F, 1}, {0, 2}};
    for (size_t i = 0; i < sizeof frames / sizeof frames[0]; i++) {
        unsigned longest = 0;
        struct framebits_fd fd, fd_longest = {0, 0};
        for (uint32_t payload = 0; payload < 1u << (8 * frames[i].length); payload++) {
            struct can_frame_t frame = {.id = frames[i].id, .length = (uint8_t)frames[i].length};
            frame.data[0] = (uint8_t)payload;
            frame.data[1] = (uint8_t)(payload >> 8);
            const unsigned bits = framebits(&frame);
            longest = bits > longest ? bits : longest;
            assert_true(framebits_fd(&frame, &fd));
            fd_longest.nominal = fd.nominal > fd_longest.nominal ? fd.nominal : fd_longest.nominal;
            fd_longest.data = fd.data > fd_longest.data ? fd.data : fd_longest.data;
        }
        const struct framebits_fd worst = framebits_fd_worst(frames[i].length);
        print_message("# 0x%03X, %u bytes: at most %u bits, formula %u; FD %u + %u, formula %u + %u\n", frames[i].id,
                      frames[i].length, longest, 55 + 10 * frames[i].length, fd_longest.nominal, fd_longest.data,
                      worst.nominal, worst.data);
        assert_true(longest <= 55 + 10 * frames[i].length);
        assert_true(fd_longest.nominal <= worst.nominal && fd_longest.data <= worst.data);
    }
}

static struct can_frame_t random_frame(uint32_t id, unsigned length)
{
    static const uint8_t runs[] = {0x00, 0xff, 0x0f, 0xf0, 0x1f, 0xe0, 0x87, 0x78, 0xc3, 0x3c, 0xe1, 0x1e};
    struct can_frame_t frame = {.id = id, .length = (uint8_t)length};
    const bool long_runs = random_below(2);
    for (unsigned i = 0; i < length; i++)
        frame.data[i] = long_runs ? runs[random_below(sizeof runs)] : (uint8_t)random_bits();
    return frame;
}

static void no_random_frame_is_longer_than_its_row(void **state)
{
    (void)state;
    struct dbc *dbc;
    struct failure why = {0};
    struct busload load;
    assert_int_equal(wire_dbc(&dbc, &why), STATUS_OK);
    assert_int_equal(busload(dbc, &(struct busload_use){1, {7, 7}, 1e6, 5e6}, &load, &why), STATUS_OK);
    random_seed("stuffing", 11);
    for (size_t i = 0; i < load.count; i++) {
        const struct busload_row *row = &load.row[i];
        bool per_node;
        const uint32_t base = dbc_base(row->message, &per_node);
        unsigned longest = 0;
        for (int round = 0; round < 40000; round++) {
            const uint32_t id = base + (per_node ? nodes[random_below(5)] : 0);
            const struct can_frame_t frame = random_frame(id, row->message->length);
            struct framebits_fd fd;
            const unsigned bits = framebits(&frame);
            longest = bits > longest ? bits : longest;
            assert_true(framebits_fd(&frame, &fd));
            assert_true(bits <= row->bits);
            assert_true(fd.nominal <= row->fd_bits.nominal && fd.data <= row->fd_bits.data);
        }
        print_message("# %-14s longest of 40000: %u bits, counted with %u\n", row->message->name, longest, row->bits);
    }
    dbc_free(dbc);
}

static void add(char *text, uint32_t value, unsigned bits)
{
    for (char *end = text + strlen(text); bits > 0; *end = 0)
        *end++ = value >> --bits & 1 ? '1' : '0';
}

/* The same in another way: the frame as text up to the end of the data, stuff bits written into a second one; the rest is
 * a fixed number of bits. */
static void fd_frames_agree_with_a_second_construction(void **state)
{
    (void)state;
    random_seed("fd", 12);
    static const uint8_t lengths[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    for (int round = 0; round < 20000; round++) {
        const unsigned code = random_below(16);
        const struct can_frame_t frame = random_frame(random_below(4) ? random_below(2048) : 0, lengths[code]);
        char plain[600] = "0", stuffed[800] = "";
        add(plain, frame.id, 11);
        strcat(plain, "00101" /* RRS IDE FDF res BRS */ "0" /* ESI */);
        add(plain, code, 4);
        for (unsigned i = 0; i < frame.length; i++)
            add(plain, frame.data[i], 8);
        size_t out = 0, nominal = 0;
        for (size_t i = 0; plain[i]; i++) {
            stuffed[out++] = plain[i];
            if (plain[i + 1] && out >= 5 && memcmp(stuffed + out - 5, plain[i] == '1' ? "11111" : "00000", 5) == 0)
                stuffed[out++] = plain[i] == '1' ? '0' : '1';
            if (i == 16)
                nominal = out;
        }
        struct framebits_fd bits;
        assert_true(framebits_fd(&frame, &bits));
        assert_int_equal(bits.nominal, nominal + 13);
        assert_int_equal(bits.data, out - nominal + (frame.length > 16 ? 32 : 27));
        const struct framebits_fd worst = framebits_fd_worst(frame.length);
        assert_true(bits.nominal <= worst.nominal && bits.data <= worst.data);
    }
    struct framebits_fd bits;
    /* the two parts of the bound are met: 00000 1111 0000 in the head, then BRS 1, ESI 0: by hand */
    const struct can_frame_t head = {.id = 0x078, .length = 0};
    assert_true(framebits_fd(&head, &bits));
    assert_int_equal(bits.nominal, framebits_fd_worst(0).nominal);
    assert_false(framebits_fd(&(struct can_frame_t){.length = 9}, &bits));
    assert_false(framebits_fd(&(struct can_frame_t){.flags = CAN_FLAG_RTR}, &bits));
}

/* ---- what is really sent ---- */

struct counted {
    const struct dbc *dbc;
    uint64_t count[DBC_MAX_MESSAGES];
};

static void count(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    (void)time_us;
    struct counted *c = context;
    unsigned node;
    const struct dbc_message *m = dbc_find(c->dbc, frame->id, &node);
    assert_non_null(m);
    c->count[m - c->dbc->message]++;
}

/* The schedule alone, with as many pushing contacts as there can be: over ten seconds exactly the frames computed, and no tick
 * in which two instruments speak or one sends more than a pair. */
static void the_schedule_keeps_its_rates_for_any_number_of_contacts(void **state)
{
    (void)state;
    enum { TICKS = 10000 };
    struct dbc *dbc;
    struct failure why = {0};
    assert_int_equal(wire_dbc(&dbc, &why), STATUS_OK);
    for (unsigned instruments = 1; instruments <= 2; instruments++)
        for (unsigned points = 1; points <= CONTACT_MAX / instruments; points++) {
            static struct controller c;
            static struct telemetry t[2];
            struct busload load;
            struct counted counted = {.dbc = dbc};
            memset(&c, 0, sizeof c);
            memset(t, 0, sizeof t);
            const struct bank_view bank = {.tool_count = instruments};
            c.instrument_count = instruments;
            c.contact.count = points * instruments;
            for (unsigned k = 0; k < c.contact.count; k++) {
                c.contact.contact[k].pressure_N = 1;
                c.contact.contact[k].tool = k / points;
            }
            for (unsigned tick = 0; tick < TICKS; tick++) {
                uint32_t sent = 0;
                c.tick_count = tick;
                for (unsigned i = 0; i < instruments; i++) {
                    struct can_frame_t frame[TELEMETRY_FRAMES];
                    const struct telemetry_counters none = {0};
                    const uint32_t n = telemetry_tick(&t[i], &c, i, &bank, &none, (uint8_t)(1 + i), frame);
                    assert_true(sent == 0 || n == 0);
                    sent += n;
                    for (uint32_t k = 0; k < n; k++)
                        count(&counted, &frame[k], 0);
                }
                assert_true(sent <= TELEMETRY_FRAMES);
            }
            const struct busload_use use = {instruments, {points, points}, 1e6, 5e6};
            assert_int_equal(busload(dbc, &use, &load, &why), STATUS_OK);
            for (size_t i = 0; i < load.count; i++) {
                const char *name = load.row[i].message->name;
                if (!strcmp(name, "Contact") || !strcmp(name, "ForcePose") || !strcmp(name, "Health") ||
                    !strcmp(name, "Heartbeat")) {
                    /* a set may be cut by the end of the time */
                    const double computed = load.row[i].per_second * 1e-3 * TICKS, cut = 2.0 * points * instruments;
                    assert_true(fabs((double)counted.count[i] - computed) <= (*name == 'C' ? cut : 0));
                }
            }
            assert_true(load.share <= 0.70);
        }
    dbc_free(dbc);
}

/* Hands that hold some points in the tissue: over whole seconds every frame comes as often as computed for so many. */
static void two_instruments_fit_and_frames_come_as_often_as_computed(void **state)
{
    (void)state;
    struct dbc *dbc;
    struct failure why = {0};
    assert_int_equal(wire_dbc(&dbc, &why), STATUS_OK);
    for (unsigned instruments = 1; instruments <= 2; instruments++) {
        struct loop l;
        struct busload load;
        struct counted counted = {.dbc = dbc};
        struct bank_fixture_options two = bank_fixture_default;
        two.instruments = instruments;
        two.tip_points = instruments == 2 && two.tip_points > CONTACT_MAX / 2 ? CONTACT_MAX / 2 : two.tip_points;
        enum { TICKS = 2000 };
        loop_bank(&l, &two);
        loop_open(&l, &(struct session_options){.gesture = {"hold", instruments == 2 ? "hold" : NULL}});
        uint64_t bits = 0, ticks = 0;
        while (loop_tick(&l)) {
            const double time_s = session_gesture_time_s(l.session);
            if (ticks == 0 && time_s < 1.5)
                continue;
            if (ticks == 0) {
                bits = bus_statistics(session_bus(l.session))->bits;
                bus_listen(session_bus(l.session), count, &counted);
            }
            if (ticks++ == TICKS) {
                bits = bus_statistics(session_bus(l.session))->bits - bits;
                bus_listen(session_bus(l.session), NULL, NULL);
                break;
            }
        }
        assert_true(ticks > TICKS);
        struct busload_use use = {instruments, {0, 0}, 1e6, 5e6};
        for (unsigned t = 0; t < instruments; t++)
            use.points[t] = (unsigned)session_link(l.session, t)->contact_count;
        assert_int_equal(busload(dbc, &use, &load, &why), STATUS_OK);
        for (size_t i = 0; i < load.count; i++) {
            const double computed = load.row[i].per_second * 1e-3 * TICKS;
            const bool contact = !strcmp(load.row[i].message->name, "Contact");
            print_message("# %u: %-14s %5llu of %.1f\n", instruments, load.row[i].message->name,
                          (unsigned long long)counted.count[i], computed);
            assert_true(fabs((double)counted.count[i] - computed) <=
                        (contact ? 2.0 * (use.points[0] + use.points[1]) : instruments));
        }
        const double share = (double)bits / (1000.0 * TICKS);
        print_message("# %u instruments, %u and %u contacts: %.1f %% of the bus, computed at most %.1f %%\n",
                      instruments, use.points[0], use.points[1], 100 * share, 100 * load.share);
        assert_true(share <= load.share && load.share <= 0.70 && share > 0.8 * load.share);
        assert_true(load.worst_tick_us < 1000);
        for (unsigned t = 0; t < instruments; t++) {
            const struct safety *safety = &session_node(l.session)->controller.instrument[t].safety;
            const struct link *link = session_link(l.session, t);
            assert_int_equal(safety->state, SAFETY_RUN);
            assert_int_equal(safety->missed, 0);
            assert_int_equal(link->malformed + link->incomplete_sets, 0);
            assert_true(link->contact_count > 0);
        }
        assert_int_equal(session_node(l.session)->queue_overflows, 0);
        loop_close(&l);
        assert_int_equal(l.result.device_rejected + l.result.device_late, 0);
        loop_end(&l);
    }
    dbc_free(dbc);
}

static void a_frame_without_a_known_rate_is_refused_by_name(void **state)
{
    (void)state;
    struct dbc *dbc;
    struct failure why = {0};
    struct busload load;
    assert_int_equal(wire_dbc(&dbc, &why), STATUS_OK);
    strcpy(dbc->message[3].name, "Riddle");
    assert_int_equal(busload(dbc, &(struct busload_use){1, {7, 7}, 1e6, 5e6}, &load, &why), STATUS_BUS_DBC);
    assert_non_null(strstr(why.cause, "Riddle"));
    dbc_free(dbc);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_short_frame_is_longer_than_the_formula),
        cmocka_unit_test(no_random_frame_is_longer_than_its_row),
        cmocka_unit_test(fd_frames_agree_with_a_second_construction),
        cmocka_unit_test(the_schedule_keeps_its_rates_for_any_number_of_contacts),
        cmocka_unit_test(two_instruments_fit_and_frames_come_as_often_as_computed),
        cmocka_unit_test(a_frame_without_a_known_rate_is_refused_by_name),
    };
    return cmocka_run_group_tests_name("bus load", tests, NULL, NULL);
}
