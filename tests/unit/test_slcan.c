/* SLCAN: the text against lines written down from the LAWICEL CAN232 manual's own examples and against its grammar; the
 * backend against an adapter on a pseudo-terminal that this test plays. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "backend.h"
#include "random.h"
#include "slcan.h"

static void lines_of_the_manual_are_read_and_written(void **state)
{
    (void)state;
    static const struct {
        const char *line;
        struct can_frame_t frame;
    } cases[] = {
        {"t10021133\r", {.id = 0x100, .length = 2, .data = {0x11, 0x33}}},
        {"T0000010021133\r", {.id = 0x100, .length = 2, .flags = CAN_FLAG_EXTENDED, .data = {0x11, 0x33}}},
        {"r1002\r", {.id = 0x100, .length = 2, .flags = CAN_FLAG_RTR}},
        {"R000001002\r", {.id = 0x100, .length = 2, .flags = CAN_FLAG_RTR | CAN_FLAG_EXTENDED}},
        {"t7FF0\r", {.id = 0x7ff}},
        {"T1FFFFFFF8FFFEFDFCFBFAF9F8\r",
         {.id = 0x1fffffff,
          .length = 8,
          .flags = CAN_FLAG_EXTENDED,
          .data = {0xff, 0xfe, 0xfd, 0xfc, 0xfb, 0xfa, 0xf9, 0xf8}}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char line[SLCAN_LINE];
        struct can_frame_t frame;
        assert_int_equal(slcan_format(&cases[i].frame, line), strlen(cases[i].line));
        assert_string_equal(line, cases[i].line);
        assert_int_equal(slcan_parse(line, strlen(line) - 1, &frame), SLCAN_FRAME);
        assert_memory_equal(&frame, &cases[i].frame, sizeof frame);
    }
}

static void what_the_grammar_does_not_have_is_malformed(void **state)
{
    (void)state;
    static const char *const bad[] = {
        "t",
        "t1",
        "t100",
        "t1009",
        "t10021",
        "t1002113",
        "t10021133445",
        "t8001AA",
        "t1001GG",
        "t 001AA",
        "T20000000100",
        "T000001",
        "t100211334",
        "t1002113344556",
        "q",
        "1",
        "tt1001AA",
        "t1001AA ",
        "\001",
        "z1",
        "zz",
        "r1009",
        "R00000100",
        "T0000010021",
        "t10081122334455667788990011",
    };
    static const char *const nothing[] = {"", "z", "Z"};
    static const char *const commands[] = {"S8", "O", "C", "V1013", "NA123", "F00"};
    struct can_frame_t frame;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        if (slcan_parse(bad[i], strlen(bad[i]), &frame) != SLCAN_MALFORMED)
            fail_msg("\"%s\" was taken", bad[i]);
    for (size_t i = 0; i < sizeof nothing / sizeof nothing[0]; i++)
        assert_int_equal(slcan_parse(nothing[i], strlen(nothing[i]), &frame), SLCAN_NOTHING);
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++)
        assert_int_equal(slcan_parse(commands[i], strlen(commands[i]), &frame), SLCAN_COMMAND);
}

static void a_time_of_four_digits_is_read_past(void **state)
{
    (void)state;
    struct can_frame_t frame;
    assert_int_equal(slcan_parse("t10021133EA5F", 13, &frame), SLCAN_FRAME);
    assert_int_equal(frame.length, 2);
    assert_int_equal(slcan_parse("t10021133EA5", 12, &frame), SLCAN_MALFORMED);
    assert_int_equal(slcan_parse("r1002EA5F", 9, &frame), SLCAN_FRAME);
}

static void every_frame_comes_back_and_every_text_is_survived(void **state)
{
    (void)state;
    random_seed("frames and text", 41);
    for (int i = 0; i < 20000; i++) {
        struct can_frame_t frame = {.length = (uint8_t)random_below(9)}, back;
        char line[SLCAN_LINE];
        frame.flags = (uint8_t)((random_below(2) ? CAN_FLAG_EXTENDED : 0) | (random_below(4) ? 0 : CAN_FLAG_RTR));
        frame.id = (uint32_t)random_below(frame.flags & CAN_FLAG_EXTENDED ? 1 << 29 : 1 << 11);
        for (unsigned k = 0; k < frame.length && !(frame.flags & CAN_FLAG_RTR); k++)
            frame.data[k] = (uint8_t)random_below(256);
        size_t n = slcan_format(&frame, line);
        assert_int_equal(slcan_parse(line, n - 1, &back), SLCAN_FRAME);
        assert_memory_equal(&frame, &back, sizeof frame);
        /* one character changed: another frame or none, and never one that cannot be */
        line[random_below((int)n - 1)] = (char)random_below(256);
        if (slcan_parse(line, n - 1, &back) == SLCAN_FRAME)
            assert_true(back.length <= 8 && back.id <= (back.flags & CAN_FLAG_EXTENDED ? 0x1fffffffu : 0x7ffu));
    }
    const struct can_frame_t fd = {.flags = CAN_FLAG_FD}, error = {.flags = CAN_FLAG_ERROR};
    char line[SLCAN_LINE];
    assert_int_equal(slcan_format(&fd, line), 0);
    assert_int_equal(slcan_format(&error, line), 0);
    assert_int_equal(slcan_rate(1000000), 8);
    assert_int_equal(slcan_rate(125000), 4);
    assert_int_equal(slcan_rate(123456), -1);
}

/* ---- an adapter ---- */

struct adapter {
    int master, slave, stop[2]; /* the slave is held open, so that the line does not hang up between two uses */
    pthread_t thread;
    char path[64];
    const char *refuse; /* answers a bell to lines that begin so */
    bool mute;          /* answers nothing */
    char heard[400];    /* lines, with | for their ends */
};

static void answer(struct adapter *a, const char *line)
{
    const char *text = "\r";
    if (a->mute)
        return;
    if (a->refuse && !strncmp(line, a->refuse, strlen(a->refuse)))
        text = "\a";
    else if (*line == 't' || *line == 'r')
        text = "z\r";
    else if (*line == 'T' || *line == 'R')
        text = "Z\r";
    assert_int_equal(write(a->master, text, strlen(text)), strlen(text));
}

static void *play(void *context)
{
    struct adapter *a = context;
    char line[64];
    size_t n = 0;
    struct pollfd poll_both[2] = {{.fd = a->master, .events = POLLIN}, {.fd = a->stop[0], .events = POLLIN}};
    while (poll(poll_both, 2, -1) > 0 && !poll_both[1].revents) {
        char c;
        if (read(a->master, &c, 1) != 1)
            break;
        if (c != '\r') {
            line[n++ % sizeof line] = c;
            continue;
        }
        line[n] = '\0';
        if (n > 0 && strlen(a->heard) + n + 2 < sizeof a->heard)
            strcat(strcat(a->heard, line), "|");
        if (n > 0)
            answer(a, line);
        n = 0;
    }
    return NULL;
}

static void plug(struct adapter *a)
{
    a->master = posix_openpt(O_RDWR | O_NOCTTY);
    assert_true(a->master >= 0 && grantpt(a->master) == 0 && unlockpt(a->master) == 0);
    assert_int_equal(ptsname_r(a->master, a->path, sizeof a->path), 0);
    a->slave = open(a->path, O_RDWR | O_NOCTTY);
    assert_true(a->slave >= 0 && pipe(a->stop) == 0);
    a->heard[0] = '\0';
    assert_int_equal(pthread_create(&a->thread, NULL, play, a), 0);
}

static void unplug(struct adapter *a)
{
    assert_int_equal(write(a->stop[1], "x", 1), 1);
    pthread_join(a->thread, NULL);
    close(a->stop[0]);
    close(a->stop[1]);
    close(a->slave);
    close(a->master);
}

static void say(struct adapter *a, const char *text)
{
    assert_int_equal(write(a->master, text, strlen(text)), strlen(text));
}

static int start(struct adapter *a, const struct backend_options *options, struct backend **backend)
{
    char name[100];
    struct failure why = {0};
    snprintf(name, sizeof name, "slcan:%s", a->path);
    return backend_open(name, options, backend, &why);
}

static void the_channel_is_opened_and_closed_and_frames_pass_both_ways(void **state)
{
    (void)state;
    struct adapter a = {0};
    struct backend *b;
    struct backend_received r;
    struct failure why = {0};
    plug(&a);
    assert_int_equal(start(&a, NULL, &b), STATUS_OK);
    say(&a, "t1812ABCD\r");
    assert_int_equal(backend_receive(b, &r, -1, &why), 1);
    assert_int_equal(r.frame.id, 0x181);
    assert_memory_equal(r.frame.data, "\xab\xcd", 2);
    const struct can_frame_t frame = {.id = 0x201, .length = 1, .data = {0x5a}};
    assert_int_equal(backend_send(b, &frame, -1, &why), 1);
    say(&a, "T000001810\r"); /* the frame above was answered before this */
    assert_int_equal(backend_receive(b, &r, -1, &why), 1);
    assert_int_equal(r.frame.flags, CAN_FLAG_EXTENDED);
    assert_int_equal(backend_counters(b)->malformed + backend_counters(b)->refused, 0);
    backend_close(b);
    unplug(&a);
    assert_memory_equal(a.heard, "C|S8|O|t20115A|", 15);
}

static void bells_and_broken_lines_are_counted_and_cost_no_other_frame(void **state)
{
    (void)state;
    struct adapter a = {.refuse = "t7FF"};
    struct backend *b;
    struct backend_received r;
    struct failure why = {0};
    plug(&a);
    assert_int_equal(start(&a, NULL, &b), STATUS_OK);
    const struct can_frame_t refused = {.id = 0x7ff}, too_long = {.id = 1, .length = 9},
                             fd = {.id = 1, .flags = CAN_FLAG_FD};
    assert_int_equal(backend_send(b, &refused, -1, &why), 1);
    assert_int_equal(backend_send(b, &too_long, -1, &why), STATUS_BUS_FRAME);
    assert_int_equal(backend_send(b, &fd, -1, &why), STATUS_BUS_FRAME);
    while (backend_counters(b)->refused < 1)
        assert_int_equal(backend_receive(b, &r, 1000, &why), 0);
    say(&a, "t18x0\rgarbage\rtttttttttttttttttttttttttttttttttttttttttttttttttt\rt1809\rS8\r\r\r\nt1231AA\rt12");
    assert_int_equal(backend_receive(b, &r, -1, &why), 1);
    assert_int_equal(r.frame.id, 0x123);
    assert_int_equal(backend_counters(b)->malformed, 4);
    assert_int_equal(backend_receive(b, &r, 0, &why), 0); /* half a line is no frame yet */
    say(&a, "40\r");
    assert_int_equal(backend_receive(b, &r, -1, &why), 1);
    assert_int_equal(r.frame.id, 0x124);
    backend_close(b);
    unplug(&a);
}

static void filters_are_kept_and_a_mute_adapter_serves(void **state)
{
    (void)state;
    struct adapter a = {.mute = true};
    struct backend *b;
    struct backend_received r;
    struct failure why = {0};
    const struct backend_filter only = {.id = 0x200, .mask = 0x780};
    const struct backend_options options = {.filter = &only, .filters = 1, .bit_rate = 500000};
    plug(&a);
    assert_int_equal(start(&a, &options, &b), STATUS_OK);
    say(&a, "t1810\rT000002010\rt2010\r");
    assert_int_equal(backend_receive(b, &r, -1, &why), 1);
    assert_int_equal(r.frame.id, 0x201);
    assert_int_equal(r.frame.flags, 0);
    backend_close(b);
    unplug(&a);
    assert_memory_equal(a.heard, "C|S6|O|", 7);
}

static void an_adapter_that_refuses_is_refused(void **state)
{
    (void)state;
    static const char *const lines[] = {"S", "O"};
    for (size_t i = 0; i < 2; i++) {
        struct adapter a = {.refuse = lines[i]};
        struct backend *b = NULL;
        plug(&a);
        assert_int_equal(start(&a, NULL, &b), STATUS_BUS_OPEN);
        assert_null(b);
        unplug(&a);
    }
}

static void an_adapter_that_is_unplugged_is_reported_once_and_taken_again(void **state)
{
    (void)state;
    struct adapter a = {0};
    struct backend *b;
    struct backend_received r;
    struct failure why = {0};
    const struct can_frame_t frame = {.id = 0x201};
    char link[] = "/tmp/trocar-slcan-XXXXXX", name[100];
    int file = mkstemp(link);
    close(file);
    unlink(link);
    plug(&a);
    assert_int_equal(symlink(a.path, link), 0);
    snprintf(name, sizeof name, "slcan:%s", link);
    assert_int_equal(backend_open(name, NULL, &b, &why), STATUS_OK);
    unplug(&a);
    assert_int_equal(backend_receive(b, &r, -1, &why), STATUS_BUS_LOST);
    assert_int_equal(backend_state(b), BACKEND_GONE);
    assert_int_equal(backend_receive(b, &r, 0, &why), 0); /* said once */
    assert_int_equal(backend_send(b, &frame, 0, &why), 0);
    unlink(link);
    plug(&a);
    assert_int_equal(symlink(a.path, link), 0);
    while (backend_state(b) != BACKEND_UP)
        assert_int_equal(backend_receive(b, &r, 1000, &why), 0);
    say(&a, "t1230\r");
    assert_int_equal(backend_receive(b, &r, -1, &why), 1);
    assert_int_equal(r.frame.id, 0x123);
    assert_int_equal(backend_counters(b)->downs, 1);
    backend_close(b);
    unplug(&a);
    unlink(link);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_of_the_manual_are_read_and_written),
        cmocka_unit_test(what_the_grammar_does_not_have_is_malformed),
        cmocka_unit_test(a_time_of_four_digits_is_read_past),
        cmocka_unit_test(every_frame_comes_back_and_every_text_is_survived),
        cmocka_unit_test(the_channel_is_opened_and_closed_and_frames_pass_both_ways),
        cmocka_unit_test(bells_and_broken_lines_are_counted_and_cost_no_other_frame),
        cmocka_unit_test(filters_are_kept_and_a_mute_adapter_serves),
        cmocka_unit_test(an_adapter_that_refuses_is_refused),
        cmocka_unit_test(an_adapter_that_is_unplugged_is_reported_once_and_taken_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
