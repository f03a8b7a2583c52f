/* The backends where no CAN is needed: SocketCAN's bytes and error frames against the layout in the kernel's documentation, written down
 * here byte by byte; the soft bus's end; and one clear line with its own status for each name that cannot be opened. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "backend.h"
#include "bus.h"
#include "random.h"
#include "socketcan.h"

/* struct can_frame: id 32 bits in the machine's order (bit 31 EFF, 30 RTR, 29 ERR), len, 3 bytes, data. */
static void kernel_bytes_are_as_documented(void **state)
{
    (void)state;
    static const struct {
        struct can_frame_t frame;
        uint32_t id;
        size_t length;
    } cases[] = {
        {{.id = 0x181, .length = 3, .data = {1, 2, 3}}, 0x181, 16},
        {{.id = 0x1abcdef0, .length = 8, .flags = CAN_FLAG_EXTENDED, .data = {9, 8, 7, 6, 5, 4, 3, 2}}, 0x9abcdef0, 16},
        {{.id = 0x700, .length = 4, .flags = CAN_FLAG_RTR}, 0x40000700, 16},
        {{.id = 0x40, .length = 8, .flags = CAN_FLAG_ERROR, .data = {0, 4}}, 0x20000040, 16},
        {{.id = 0x7ff, .length = 64, .flags = CAN_FLAG_FD, .data = {[0] = 1, [63] = 64}}, 0x7ff, 72},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct can_frame_t *f = &cases[i].frame;
        unsigned char bytes[SOCKETCAN_FD_BYTES], expected[SOCKETCAN_FD_BYTES] = {0};
        struct can_frame_t back;
        memcpy(expected, &cases[i].id, 4);
        expected[4] = f->length;
        memcpy(expected + 8, f->data, f->length);
        assert_int_equal(socketcan_pack(f, bytes), cases[i].length);
        bytes[5] &= cases[i].length == 72 ? 0 : 0xff; /* FD: flags, which newer kernels' headers set */
        assert_memory_equal(bytes, expected, cases[i].length);
        assert_true(socketcan_unpack(expected, cases[i].length, &back));
        assert_memory_equal(&back, f, sizeof back);
    }
}

static void impossible_bytes_are_refused(void **state)
{
    (void)state;
    unsigned char bytes[80] = {0};
    struct can_frame_t frame;
    random_seed("bytes", 42);
    for (size_t length = 0; length <= 80; length++)
        assert_int_equal(socketcan_unpack(bytes, length, &frame), length == 16 || length == 72);
    for (int i = 0; i < 20000; i++) {
        for (size_t k = 0; k < sizeof bytes; k++)
            bytes[k] = (unsigned char)random_below(256);
        const size_t length = random_below(2) ? 16 : 72;
        const bool good = socketcan_unpack(bytes, length, &frame);
        assert_int_equal(good, bytes[4] <= (length == 16 ? 8 : 64));
        if (good && frame.flags & CAN_FLAG_EXTENDED)
            assert_true(frame.id <= 0x1fffffff);
        else if (good && !(frame.flags & CAN_FLAG_ERROR))
            assert_true(frame.id <= 0x7ff);
    }
}

/* Numbers from include/uapi/linux/can/error.h. */
static void error_frames_are_counted_and_told(void **state)
{
    (void)state;
    static const struct {
        struct can_frame_t frame;
        size_t counter; /* offset of what it raises besides errors */
        const char *text;
    } cases[] = {
        {{.id = 0x40, .length = 8}, offsetof(struct backend_counters, bus_off), "bus off"},
        {{.id = 0x100, .length = 8}, offsetof(struct backend_counters, restarted), "restarted"},
        {{.id = 0x20, .length = 8}, offsetof(struct backend_counters, no_acknowledge), "nobody acknowledges"},
        {{.id = 0x02, .length = 8, .data = {5}},
         offsetof(struct backend_counters, arbitration_lost),
         "arbitration lost"},
        {{.id = 0x01, .length = 8}, offsetof(struct backend_counters, timeouts), "a frame could not be sent in time"},
        {{.id = 0x04, .length = 8, .data = {0, 0x20, 0, 0, 0, 0, 128, 3}},
         offsetof(struct backend_counters, passive),
         "error passive (transmit errors 128, receive errors 3)"},
        {{.id = 0x04, .length = 8, .data = {0, 0x08}}, offsetof(struct backend_counters, warnings), "error warning"},
        {{.id = 0x04, .length = 8, .data = {0, 0x01}},
         offsetof(struct backend_counters, overflows),
         "the controller's receive buffer overflowed"},
        {{.id = 0x88, .length = 8, .data = {0, 0, 2}},
         offsetof(struct backend_counters, errors),
         "protocol violation, bus error"},
        {{.id = 0x10000, .length = 8}, offsetof(struct backend_counters, errors), "error frame of class 0x10000"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct backend_counters c = {0};
        struct can_frame_t frame = cases[i].frame;
        char text[100];
        frame.flags = CAN_FLAG_ERROR;
        socketcan_count_error(&frame, &c);
        assert_int_equal(c.errors, 1);
        assert_int_equal(*(uint64_t *)((char *)&c + cases[i].counter), 1);
        assert_string_equal(socketcan_error_text(&frame, text, sizeof text), cases[i].text);
        for (size_t size = 1; size < sizeof text; size++) { /* cut short, never past its end */
            char *small = malloc(size);
            socketcan_error_text(&frame, small, size);
            assert_true(strlen(small) < size);
            free(small);
        }
    }
}

static void names_that_cannot_be_opened_have_their_status_and_remedy(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int status;
    } cases[] = {
        {"", STATUS_BUS_NAME},
        {"soft", STATUS_BUS_NAME},
        {"can0", STATUS_BUS_NAME},
        {"socketcan:", STATUS_BUS_NAME},
        {"slcan:", STATUS_BUS_NAME},
        {"slcan:/dev/null@12", STATUS_BUS_NAME},
        {"socketcan:a-name-too-long-for-linux", STATUS_BUS_INTERFACE},
        {"slcan:/nonexistent/tty", STATUS_BUS_INTERFACE},
        {"slcan:/dev/null", STATUS_BUS_INTERFACE},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct backend *b = (struct backend *)state;
        struct failure why = {0};
        assert_int_equal(backend_open(cases[i].name, NULL, &b, &why), cases[i].status);
        assert_null(b);
        assert_true(why.cause[0] && why.remedy[0] && !strchr(why.cause, '\n'));
    }
    /* with or without CAN in this kernel, this is no interface */
    struct backend *b;
    struct failure why = {0};
    int status = backend_open("socketcan:nosuchif0", NULL, &b, &why);
    assert_true(status == STATUS_BUS_INTERFACE || status == STATUS_BUS_KERNEL || status == STATUS_BUS_PERMISSION);
    backend_close(NULL);
}

static void a_soft_end_hears_filters_sends_and_counts(void **state)
{
    (void)state;
    struct bus *bus = bus_create(1000000);
    struct backend *all, *some;
    struct backend_received r;
    struct failure why = {0};
    const struct backend_filter torques = {.id = 0x200, .mask = 0x780};
    const struct backend_options filtered = {.filter = &torques, .filters = 1}, fd = {.fd = true};
    assert_int_equal(backend_soft(bus, NULL, &all, &why), STATUS_OK);
    assert_int_equal(backend_soft(bus, &filtered, &some, &why), STATUS_OK);
    struct backend *none;
    assert_int_equal(backend_soft(bus, &fd, &none, &why), STATUS_BUS_FRAME);
    const struct can_frame_t sync = {.id = 0x80, .length = 1}, torque = {.id = 0x201, .length = 8};
    assert_int_equal(backend_send(all, &sync, 0, &why), 1);
    assert_int_equal(backend_send(all, &torque, 0, &why), 1);
    assert_int_equal(backend_receive(some, &r, -1, &why), 0); /* time stands still until somebody runs the bus */
    bus_run(bus, 1000);
    assert_int_equal(backend_receive(some, &r, -1, &why), 1);
    assert_int_equal(r.frame.id, 0x201);
    assert_false(r.own);
    assert_int_equal(backend_receive(some, &r, 0, &why), 0);
    assert_int_equal(backend_receive(all, &r, 0, &why), 0); /* not what it sent itself */
    const uint64_t arrived_us = r.time_us;
    assert_true(arrived_us > 150 && arrived_us < 250); /* 55 to 65 bits, then 111 to 135 */
    /* what nobody reads is dropped, and counted */
    for (unsigned i = 0; i < BACKEND_MAX_FRAMES + 7; i++) {
        assert_int_equal(backend_send(all, &torque, 0, &why), 1);
        bus_run(bus, 1000 + 200 * (i + 1));
    }
    assert_int_equal(backend_counters(some)->dropped, 7);
    unsigned kept = 0;
    while (backend_receive(some, &r, 0, &why) == 1)
        kept++;
    assert_int_equal(kept, BACKEND_MAX_FRAMES);
    assert_int_equal(backend_descriptor(some), -1);
    assert_string_equal(backend_interface(some), "soft");
    backend_close(all);
    backend_close(some);
    bus_free(bus);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kernel_bytes_are_as_documented),
        cmocka_unit_test(impossible_bytes_are_refused),
        cmocka_unit_test(error_frames_are_counted_and_told),
        cmocka_unit_test(names_that_cannot_be_opened_have_their_status_and_remedy),
        cmocka_unit_test(a_soft_end_hears_filters_sends_and_counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
