/* Gestures: the text, and the motion that it describes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "gestures.h"
#include "hand.h"
#include "status.h"

static struct gesture gesture;
static struct hand hand = {.start = {0, 0, 0.10}, .touch = {0, 0, 0.13}, .gesture = &gesture};

static void parse(const char *text)
{
    char message[200] = "";
    long line;
    int status = gesture_parse(text, "test", &gesture, message, sizeof message, &line);
    if (status)
        print_error("line %ld: %s\n", line, message);
    assert_int_equal(status, STATUS_OK);
}

static void refuse(const char *text, long expected_line, const char *expected_part)
{
    char message[200] = "";
    long line = -1;
    assert_int_equal(gesture_parse(text, "test", &gesture, message, sizeof message, &line), STATUS_GESTURE_SYNTAX);
    if (line != expected_line || !strstr(message, expected_part))
        print_error("\"%s\" -> line %ld: %s\n", text, line, message);
    assert_int_equal(line, expected_line);
    assert_non_null(strstr(message, expected_part));
}

static void at(double time_s, double x, double y, double z)
{
    double target[3];
    hand_target(&hand, time_s, target);
    /* sums of a few decimal fractions: a few units in the last place of 1 */
    assert_true(fabs(target[0] - x) < 1e-12 && fabs(target[1] - y) < 1e-12 && fabs(target[2] - z) < 1e-12);
}

static void steps_end_where_they_say(void **state)
{
    (void)state;
    parse("approach 0.5 s\n"
          "press 20 mm in 0.5 s   # comment\n"
          "\n"
          "slide 1.5cm -5 mm in 1000 ms\r\n"
          "hold 1 s\n"
          "poke 0.04 m in 0.5 s times 2\n"
          "press 0 mm in 1 s\n"
          "retract 1 s");
    assert_int_equal(gesture.count, 7);
    assert_true(fabs(gesture_duration_s(&gesture) - 6) < 1e-12);
    at(-1, 0, 0, 0.10);
    at(0, 0, 0, 0.10);
    at(0.25, 0, 0, 0.115); /* minimum-jerk is half-way at half time */
    at(0.5, 0, 0, 0.13);
    at(1, 0, 0, 0.15);
    at(2, 0.015, -0.005, 0.15);
    at(2.7, 0.015, -0.005, 0.15);
    at(3.25, 0.015, -0.005, 0.17);
    at(3.5, 0.015, -0.005, 0.15);
    at(3.75, 0.015, -0.005, 0.17);
    at(5, 0.015, -0.005, 0.13);
    at(6, 0, 0, 0.10);
    at(1e6, 0, 0, 0.10);
}

static void jaws_close_and_open_where_the_gesture_says(void **state)
{
    (void)state;
    struct hand jaws = {.start = {0, 0, 0.1}, .touch = {0, 0, 0.12}, .gesture = &gesture};
    parse("approach 1 s\nclose 1 s\nhold 1 s\nopen 1 s\nhold 1 s\nclose 1 s\nrepeat 2");
    const double expected[][2] = {
        {0, 0},   {1, 0},   {1.5, 0.5}, {2.5, 1}, {3.5, 0.5}, {4.5, 0}, {5.5, 0.5},
        {6.5, 1}, {8.5, 1}, {9.5, 0.5}, {12, 1},  {1e6, 1}}; /* minimum jerk: half way at half the time */
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++)
        assert_true(fabs(hand_grip(&jaws, expected[i][0]) - expected[i][1]) < 1e-12);
    double target[3];
    hand_target(&jaws, 1.5, target); /* the tip stays */
    assert_true(fabs(target[2] - 0.12) < 1e-12);
}

static void depth_runs_along_the_line_from_the_trocar(void **state)
{
    (void)state;
    struct hand tilted = {.start = {0.06, 0, 0.08}, .touch = {0.09, 0, 0.12}, .gesture = &gesture};
    parse("approach 1 s\npress 50 mm in 1 s");
    double target[3];
    hand_target(&tilted, 5, target);
    assert_true(fabs(target[0] - 0.12) < 1e-12 && fabs(target[1]) < 1e-12 && fabs(target[2] - 0.16) < 1e-12);
}

static void repeats_continue_where_the_pass_ended(void **state)
{
    (void)state;
    parse("press 10 mm in 1 s\nslide 2 mm 1 mm in 1 s\nrepeat 3\n");
    assert_true(fabs(gesture_duration_s(&gesture) - 6) < 1e-12);
    at(2, 0.002, 0.001, 0.14);
    at(4, 0.004, 0.002, 0.14);
    at(6, 0.006, 0.003, 0.14);
    at(60, 0.006, 0.003, 0.14);
    parse("approach 1 s\nslide 2 mm 1 mm in 1 s\nretract 1 s\nslide 1 mm 1 mm in 1 s\nrepeat 2");
    at(4, 0.001, 0.001, 0.13);
    at(5, 0, 0, 0.13);
    at(8, 0.001, 0.001, 0.13);
}

/* The speed of minimum-jerk motion is at most 15/8 of distance over time, so the target cannot move more than that
 * between two samples; any jump in any built-in gesture would show. */
static void built_in_gestures_parse_and_do_not_jump(void **state)
{
    (void)state;
    for (size_t i = 0; gesture_builtin_name(i); i++) {
        char message[200];
        long line;
        const char *name = gesture_builtin_name(i);
        assert_non_null(strstr(gesture_names(), name));
        assert_int_equal(gesture_read(name, &gesture, message, sizeof message, &line), STATUS_OK);
        gesture.repeat = 2;
        double fastest = 0;
        for (size_t s = 0; s < gesture.count; s++) {
            /* no step of these moves further than 60 mm; a poke does it in half its time */
            double v = 15.0 / 8 * 0.06 / gesture.step[s].duration_s * (gesture.step[s].kind == HAND_POKE ? 2 : 1);
            fastest = fmax(fastest, v);
        }
        double last[3], now[3], h = 1e-4;
        hand_target(&hand, 0, last);
        assert_true(last[2] == hand.start[2]);
        for (double t = h; t < gesture_duration_s(&gesture) + 0.1; t += h) {
            hand_target(&hand, t, now);
            double d = sqrt(pow(now[0] - last[0], 2) + pow(now[1] - last[1], 2) + pow(now[2] - last[2], 2));
            assert_true(d <= fastest * h);
            memcpy(last, now, sizeof last);
        }
        assert_true(fabs(last[2] - hand.start[2]) < 1e-12);
    }
}

static void errors_name_the_line(void **state)
{
    (void)state;
    refuse("", 0, "no step");
    refuse("# nothing\n\n", 2, "no step");
    refuse("approach 1 s\nprod 3 mm in 1 s\n", 2, "\"prod\" is not a step");
    refuse("press 20 in 1 s", 1, "unit \"in\"");
    refuse("press 20 mm 1 s", 1, "\"in\" is expected");
    refuse("press 20 mm in", 1, "is missing");
    refuse("press 20 mm", 1, "\"in\" is expected");
    refuse("press 20 s in 1 s", 1, "unit \"s\"");
    refuse("press nan mm in 1 s", 1, "\"nan\" is not a length");
    refuse("press inf mm in 1 s", 1, "\"inf\"");
    refuse("press 0x10 mm in 1 s", 1, "0x10");
    refuse("press 700 mm in 1 s", 1, "out of range");
    refuse("hold 0 s", 1, "out of range");
    refuse("hold -1 s", 1, "out of range");
    refuse("hold 1 s now", 1, "\"now\"");
    refuse("slide 3 mm in 1 s", 1, "\"in\" is not a length");
    refuse("poke 3 mm in 1 s times 0", 1, "whole number");
    refuse("poke 3 mm in 1 s times 2.5", 1, "whole number");
    refuse("poke 3 mm in 1 s times", 1, "whole number");
    refuse("hold 1 s\nrepeat\n", 2, "whole number");
    refuse("hold 1 s\nrepeat 2\nhold 1 s\n", 3, "last line");
    refuse("repeat 2\n", 1, "no step");
    refuse("hold 1 s times 3 4 5 6 7 8 9 10 11 12", 1, "too much");
    char many[HAND_MAX_STEPS * 10 + 20] = "";
    for (int i = 0; i <= HAND_MAX_STEPS; i++)
        memcpy(many + 9 * i, "hold 1 s\n", 10);
    refuse(many, HAND_MAX_STEPS + 1, "more than 256 steps");
    char wide[400];
    memset(wide, ' ', sizeof wide);
    wide[399] = 0;
    refuse(wide, 1, "longer than");
}

static void files_are_read_and_strangers_refused(void **state)
{
    (void)state;
    char message[200];
    long line;
    char path[] = "/tmp/trocar-gesture-XXXXXX";
    int file = mkstemp(path);
    assert_true(file >= 0);
    static const char text[] = "approach 1 s\nhold 2 s\n";
    assert_int_equal(write(file, text, sizeof text - 1), sizeof text - 1);
    assert_int_equal(gesture_read(path, &gesture, message, sizeof message, &line), STATUS_OK);
    assert_int_equal(gesture.count, 2);
    assert_int_equal(write(file, "\0\1", 2), 2);
    close(file);
    assert_int_equal(gesture_read(path, &gesture, message, sizeof message, &line), STATUS_GESTURE_SYNTAX);
    unlink(path);
    assert_int_equal(gesture_read(path, &gesture, message, sizeof message, &line), STATUS_FILE_OPEN);
    assert_non_null(strstr(message, gesture_names()));
    assert_int_equal(gesture_read("/", &gesture, message, sizeof message, &line), STATUS_FILE_OPEN);
}

/* Random words from the grammar and around it: always an answer, never a target that is not finite. */
static void random_text_never_breaks_it(void **state)
{
    (void)state;
    static const char *const words[] = {"approach", "press", "slide", "poke", "hold", "close", "open", "retract",
                                        "repeat",   "in",    "times", "mm",   "s",    "ms",    "m",    "1",
                                        "-3",       "1e-3",  "1e308", "7",    "\n",   "\n",    "#",    "\t"};
    const unsigned seed = 20240601;
    unsigned random = seed, good = 0;
    for (int n = 0; n < 20000; n++) {
        char text[300] = "", message[60];
        long line;
        for (int w = 0; w < 3 + n % 6; w++) {
            random = random * 1664525u + 1013904223u;
            strcat(text, words[(random >> 16) % (sizeof words / sizeof words[0])]);
            strcat(text, " ");
        }
        if (gesture_parse(text, "random", &gesture, message, sizeof message, &line))
            continue;
        good++;
        for (int t = 0; t < 20; t++) {
            double target[3];
            hand_target(&hand, t * gesture_duration_s(&gesture) / 18, target);
            assert_true(isfinite(target[0] + target[1] + target[2]));
        }
    }
    print_message("# seed %u: %u of 20000 texts were gestures\n", seed, good);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(steps_end_where_they_say),
        cmocka_unit_test(jaws_close_and_open_where_the_gesture_says),
        cmocka_unit_test(depth_runs_along_the_line_from_the_trocar),
        cmocka_unit_test(repeats_continue_where_the_pass_ended),
        cmocka_unit_test(built_in_gestures_parse_and_do_not_jump),
        cmocka_unit_test(errors_name_the_line),
        cmocka_unit_test(files_are_read_and_strangers_refused),
        cmocka_unit_test(random_text_never_breaks_it),
    };
    return cmocka_run_group_tests_name("hand", tests, NULL, NULL);
}
