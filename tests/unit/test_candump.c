/* Recordings: what is written is read back, lines of can-utils are understood, anything else is refused with its line. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "candump.h"

static uint64_t seed = 99;

static uint32_t random32(void)
{
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(seed >> 32);
}

/* Lines as candump -l writes them (log2asc's and canplayer's examples). */
static void lines_of_can_utils_are_understood(void **state)
{
    (void)state;
    static const struct {
        const char *line;
        uint64_t time_us;
        struct can_frame_t frame;
    } cases[] = {
        {"(1436509052.249713) vcan0 044#2A366C2BBA\n",
         1436509052249713,
         {.id = 0x44, .length = 5, .data = {0x2a, 0x36, 0x6c, 0x2b, 0xba}}},
        {"(0000000000.000001) can0 7ff#", 1, {.id = 0x7ff}},
        {"(1.500000) can0 1F334455#1122334455667788\r\n",
         1500000,
         {.id = 0x1f334455,
          .flags = CAN_FLAG_EXTENDED,
          .length = 8,
          .data = {0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88}}},
        {"(1.500000) can0 123#R\n", 1500000, {.id = 0x123, .flags = CAN_FLAG_RTR}},
        {"(1.500000) can0 123#R8 T\n", 1500000, {.id = 0x123, .flags = CAN_FLAG_RTR, .length = 8}},
        {"(1.500000) can0 123#00 R\n", 1500000, {.id = 0x123, .length = 1}},
        {"(1.500000) can0 123##1aabb\n",
         1500000,
         {.id = 0x123, .flags = CAN_FLAG_FD, .length = 2, .data = {0xaa, 0xbb}}},
        {"(1.500000) can0 20000080#0000000000000000\n", 1500000, {.id = 0x80, .flags = CAN_FLAG_ERROR, .length = 8}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct candump_record record;
        struct failure why = {0};
        if (candump_parse(cases[i].line, "x.log", 1, &record, &why) != STATUS_OK)
            fail_msg("%s: %s", cases[i].line, why.cause);
        assert_int_equal(record.time_us, cases[i].time_us);
        assert_memory_equal(&record.frame, &cases[i].frame, sizeof record.frame);
    }
}

static void a_line_is_written_as_can_utils_writes_it(void **state)
{
    (void)state;
    char line[CANDUMP_LINE];
    const struct can_frame_t frame = {.id = 0x44, .length = 5, .data = {0x2a, 0x36, 0x6c, 0x2b, 0xba}};
    candump_format(line, "vcan0", &frame, 1436509052249713);
    assert_string_equal(line, "(1436509052.249713) vcan0 044#2A366C2BBA\n");
    const struct can_frame_t sync = {.id = 0x80, .length = 1};
    candump_format(line, "can0", &sync, 1000);
    assert_string_equal(line, "(0000000000.001000) can0 080#00\n");
}

static void what_was_written_is_read_back(void **state)
{
    (void)state;
    enum { COUNT = 20000 };
    static struct can_frame_t frames[COUNT];
    print_message("# seed %llu\n", (unsigned long long)seed);
    FILE *file = tmpfile();
    assert_non_null(file);
    struct failure why = {0};
    for (uint64_t i = 0; i < COUNT; i++) {
        static const uint8_t kinds[] = {0,
                                        0,
                                        0,
                                        CAN_FLAG_EXTENDED,
                                        CAN_FLAG_RTR,
                                        CAN_FLAG_FD,
                                        CAN_FLAG_ERROR,
                                        CAN_FLAG_EXTENDED | CAN_FLAG_FD,
                                        CAN_FLAG_EXTENDED | CAN_FLAG_RTR};
        static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
        struct can_frame_t *f = &frames[i];
        f->flags = kinds[random32() % sizeof kinds];
        f->id = random32() & (f->flags & (CAN_FLAG_EXTENDED | CAN_FLAG_ERROR) ? 0x1fffffff : 0x7ff);
        f->length = lengths[random32() % (f->flags & CAN_FLAG_FD ? 16 : 9)];
        for (unsigned k = 0; k < f->length && !(f->flags & CAN_FLAG_RTR); k++)
            f->data[k] = (uint8_t)random32();
        assert_int_equal(candump_write(file, "soft", f, i * 123456789, &why), STATUS_OK);
    }
    rewind(file);
    long line = 0;
    struct candump_record record;
    for (uint64_t i = 0; i < COUNT; i++) {
        if (candump_read(file, "x.log", &line, &record, &why) != 1)
            fail_msg("%s: %s", why.place, why.cause);
        assert_int_equal(record.time_us, i * 123456789);
        assert_string_equal(record.interface, "soft");
        assert_memory_equal(&record.frame, &frames[i], sizeof record.frame);
    }
    assert_int_equal(candump_read(file, "x.log", &line, &record, &why), 0);
    assert_int_equal(line, COUNT);
    fclose(file);
}

static void every_fault_is_refused_with_its_line(void **state)
{
    (void)state;
    static const struct {
        const char *line, *cause;
    } cases[] = {
        {"hello", "does not begin with"},
        {"(1) can0 123#00", "does not begin with"},
        {"(1.5) can0 123#00", "six digits"},
        {"(1.0000005) can0 123#00", "six digits"},
        {"(99999999999999999999.000000) can0 123#00", "does not begin with"},
        {"(1.000000)can0 123#00", "a space is missing"},
        {"(1.000000)  123#00", "the interface"},
        {"(1.000000) anInterfaceTooLong 123#00", "the interface"},
        {"(1.000000) can0", "the interface"},
        {"(1.000000) can0 12#00", "3 or 8 hexadecimal digits"},
        {"(1.000000) can0 1234#00", "3 or 8 hexadecimal digits"},
        {"(1.000000) can0 123456789#00", "3 or 8 hexadecimal digits"},
        {"(1.000000) can0 12g#00", "3 or 8 hexadecimal digits"},
        {"(1.000000) can0 123", "3 or 8 hexadecimal digits"},
        {"(1.000000) can0 800#00", "too large"},
        {"(1.000000) can0 40000000#00", "too large"},
        {"(1.000000) can0 123#0", "only one digit"},
        {"(1.000000) can0 123#001122334455667788", "more than eight bytes"},
        {"(1.000000) can0 123#R9", "more than eight bytes"},
        {"(1.000000) can0 123##", "flags of an FD frame"},
        {"(1.000000) can0 123##0000102030405060708", "cannot have this length"},
        {"(1.000000) can0 123#00 X", "something behind"},
        {"(1.000000) can0 123#00 R ", "something behind"},
        {"(1.000000) can0 123#00\n(1.000000) can0 123#00", "something behind"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct candump_record record;
        struct failure why = {0};
        if (candump_parse(cases[i].line, "x.log", 12, &record, &why) != STATUS_BUS_LOG)
            fail_msg("accepted: %s", cases[i].line);
        assert_string_equal(why.place, "x.log:12");
        if (!strstr(why.cause, cases[i].cause))
            fail_msg("%s: %s, expected %s", cases[i].line, why.cause, cases[i].cause);
    }
}

static void a_stream_with_a_bad_line_stops_there(void **state)
{
    (void)state;
    static const char text[] = "(1.000000) can0 123#00\n\n(2.000000) can0 123#01\n(3.000000) can0 1#\n";
    FILE *file = fmemopen((void *)(uintptr_t)text, sizeof text - 1, "r");
    struct candump_record record;
    struct failure why = {0};
    long line = 0;
    assert_int_equal(candump_read(file, "x.log", &line, &record, &why), 1);
    assert_int_equal(candump_read(file, "x.log", &line, &record, &why), 1);
    assert_int_equal(record.frame.data[0], 1);
    assert_int_equal(candump_read(file, "x.log", &line, &record, &why), STATUS_BUS_LOG);
    assert_string_equal(why.place, "x.log:4");
    fclose(file);
    /* a line without end, and a NUL byte, are not text */
    static char dots[5000];
    memset(dots, '.', sizeof dots);
    for (int nul = 0; nul < 2; nul++) {
        dots[5] = nul ? '\0' : '.';
        file = fmemopen(dots, sizeof dots, "r");
        line = 0;
        assert_int_equal(candump_read(file, "x.log", &line, &record, &why), STATUS_BUS_LOG);
        assert_string_equal(why.place, "x.log:1");
        fclose(file);
    }
}

static void a_full_disk_is_reported(void **state)
{
    (void)state;
    FILE *full = fopen("/dev/full", "w");
    if (!full)
        skip();
    setvbuf(full, NULL, _IONBF, 0);
    const struct can_frame_t frame = {.id = 1};
    struct failure why = {0};
    assert_int_equal(candump_write(full, "can0", &frame, 0, &why), STATUS_FILE_WRITE);
    fclose(full);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_of_can_utils_are_understood),
        cmocka_unit_test(a_line_is_written_as_can_utils_writes_it),
        cmocka_unit_test(what_was_written_is_read_back),
        cmocka_unit_test(every_fault_is_refused_with_its_line),
        cmocka_unit_test(a_stream_with_a_bad_line_stops_there),
        cmocka_unit_test(a_full_disk_is_reported),
    };
    return cmocka_run_group_tests_name("candump", tests, NULL, NULL);
}
