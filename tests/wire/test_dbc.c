/* The parser of the protocol file refuses what it does not understand, and says where. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "dbc.h"

#define HEAD          "VERSION \"1\"\nNS_ :\n CM_\nBS_:\nBU_: A B\n"
#define BODY(signals) HEAD "BO_ 385 M: 2 A\n" signals

static void every_fault_is_named_with_its_line(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        long line;
        const char *cause;
    } cases[] = {
        {"", 1, "no message"},
        {HEAD "BO_TX_BU_ 1;", 6, "'BO_TX_BU_' is not a keyword"},
        {HEAD "SG_ X : 0|8@1+ (1,0) [0|1] \"\" A\n", 6, "outside a message"},
        {HEAD "BO_ 2048 M: 8 A\n", 6, "the identifier is 2048"},
        {HEAD "BO_ M: 8 A\n", 6, "a whole number"},
        {HEAD "BO_ 1 M: 9 A\n", 6, "the length is 9"},
        {HEAD "BO_ 1 M 8 A\n", 6, "':' is expected"},
        {HEAD "BO_ 1 M: 8 C\n", 6, "sender C is not among"},
        {HEAD "BO_ 1 M: 8 A\nBO_ 1 N: 8 A\n", 7, "same identifier 1"},
        {HEAD "BO_ 1 M: 8 A\nBO_ 2 M: 8 A\n", 7, "two messages have the name M"},
        {HEAD "BO_ 1 ThisNameIsLongerThanThirtyTwoChars: 8 A\n", 6, "more than 32"},
        {BODY(" SG_ X : 9|8@1+ (1,0) [0|255] \"\" B\n"), 7, "ends at bit 16, beyond the 2 bytes"},
        {BODY(" SG_ X : 0|8@0+ (1,0) [0|255] \"\" B\n"), 7, "Motorola"},
        {BODY(" SG_ X : 0|33@1+ (1,0) [0|255] \"\" B\n"), 7, "the number of bits is 33"},
        {BODY(" SG_ X : 0|0@1+ (1,0) [0|255] \"\" B\n"), 7, "the number of bits is 0"},
        {BODY(" SG_ X : 0|8@1* (1,0) [0|255] \"\" B\n"), 7, "'+' is expected before '*'"},
        {BODY(" SG_ X : 0|8@1+ (0,0) [0|255] \"\" B\n"), 7, "factor of signal X is 0"},
        {BODY(" SG_ X : 0|8@1+ (inf,0) [0|255] \"\" B\n"), 7, "the factor"},
        {BODY(" SG_ X : 0|8@1+ (0x2,0) [0|255] \"\" B\n"), 7, "expected"},
        {BODY(" SG_ X : 0|8@1+ (1,0) [0|256] \"\" B\n"), 7, "range of signal X is [0|256], but its bits hold [0|255]"},
        {BODY(" SG_ X : 0|8@1- (1,0) [0|255] \"\" B\n"), 7, "but its bits hold [-128|127]"},
        {BODY(" SG_ X : 0|8@1+ (1,0) [9|1] \"\" B\n"), 7, "range of signal X"},
        {BODY(" SG_ X : 0|8@1+ (1,0) [0|1] \"\" C\n"), 7, "receiver C is not among"},
        {BODY(" SG_ X : 0|8@1+ (1,0) [0|1] \"m B\n"), 7, "not closed"},
        {BODY(" SG_ X : 0|8@1+ (1,0) [0|1] \"\" B\n SG_ X : 8|8@1+ (1,0) [0|1] \"\" B\n"), 8, "two signals X"},
        {BODY(" SG_ X : 0|8@1+ (1,0) [0|1] \"\" B\n SG_ Y : 7|8@1+ (1,0) [0|1] \"\" B\n"), 8, "X and Y of M overlap"},
        {BODY(" SG_ X M : 0|1@1+ (1,0) [0|1] \"\" B\n SG_ Y m2 : 8|8@1+ (1,0) [0|1] \"\" B\n"), 8, "page 2"},
        {BODY(" SG_ X M : 0|1@1+ (1,0) [0|1] \"\" B\n SG_ Y M : 1|1@1+ (1,0) [0|1] \"\" B\n"), 8, "two page selectors"},
        {BODY(" SG_ Y m0 : 8|8@1+ (1,0) [0|1] \"\" B\n"), 7, "no signal selects one"},
        {BODY(" SG_ X M : 0|8@1+ (1,0) [0|1] \"\" B\n SG_ Y m0 : 0|8@1+ (1,0) [0|1] \"\" B\n"), 8,
         "X and Y of M overlap"},
        {BODY("CM_ BO_ 386 \"x\";\n"), 7, "no message has the identifier 386"},
        {BODY("CM_ SG_ 385 X \"x\";\n"), 7, "message M has no signal X"},
        {BODY("CM_ \"x\"\n"), 8, "';' is expected, but the file ends"},
        {BODY("VAL_ 385 X 1 \"x\";\n"), 7, "message M has no signal X"},
        {BODY("BU_: C\n"), 7, "BU_ is given twice"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct dbc *dbc = (void *)1;
        struct failure why = {0};
        char place[40];
        assert_int_equal(dbc_parse(cases[i].text, "x.dbc", &dbc, &why), STATUS_BUS_DBC);
        assert_null(dbc);
        snprintf(place, sizeof place, "x.dbc:%ld", cases[i].line);
        if (strcmp(place, why.place) != 0 || !strstr(why.cause, cases[i].cause))
            fail_msg("case %zu: %s: %s, expected %s: %s", i, why.place, why.cause, place, cases[i].cause);
    }
}

static void a_file_that_is_right_is_read_in_full(void **state)
{
    (void)state;
    static const char text[] = HEAD "BO_ 385 M: 8 A\n"
                                    " SG_ Page M : 0|2@1+ (1,0) [0|3] \"\" B\n"
                                    " SG_ X m0 : 8|12@1- (0.5,-3) [-1027|1020.5] \"N m\" A,B\n"
                                    " SG_ Y m3 : 8|32@1+ (1,0) [0|4294967295] \"\" B\n"
                                    "CM_ \"all\nof it\";\nCM_ BO_ 385 \"one\";\n"
                                    "VAL_ 385 Page 0 \"first\" 3 \"last\" ;\n";
    struct dbc *dbc = NULL;
    struct failure why = {0};
    assert_int_equal(dbc_parse(text, "x.dbc", &dbc, &why), STATUS_OK);
    assert_int_equal(dbc->node_count, 2);
    assert_string_equal(dbc->comment, "all\nof it");
    assert_string_equal(dbc->message[0].comment, "one");
    const struct dbc_signal *x = &dbc->message[0].signal[1];
    assert_int_equal(x->kind, DBC_PAGED);
    assert_true(x->is_signed);
    assert_string_equal(x->unit, "N m");
    assert_int_equal(x->receivers, 3);
    struct dbc_reading reading[DBC_MAX_SIGNALS];
    /* -2 in 12 bits behind page 0: -2 * 0.5 - 3 = -4 */
    const uint8_t data[8] = {0x00, 0xfe, 0x0f};
    assert_int_equal(dbc_decode(&dbc->message[0], data, 8, reading), 2);
    assert_string_equal(reading[0].name, "first");
    assert_true(reading[1].value == -4);
    const uint8_t no_page[8] = {0x01};
    assert_int_equal(dbc_decode(&dbc->message[0], no_page, 8, reading), 0);
    dbc_free(dbc);
}

/* Cut anywhere or with any byte changed, the file is read or refused, never worse. */
static void a_damaged_file_does_no_harm(void **state)
{
    (void)state;
    FILE *in = fopen("shared/wire.dbc", "rb");
    assert_non_null(in);
    static char text[65536], damaged[65536];
    const size_t length = fread(text, 1, sizeof text - 1, in);
    fclose(in);
    uint64_t random = 7;
    print_message("# seed %llu\n", (unsigned long long)random);
    for (int round = 0; round < 3000; round++) {
        struct dbc *dbc;
        struct failure why = {0};
        memcpy(damaged, text, length + 1);
        random = random * UINT64_C(6364136223846793005) + 1442695040888963407;
        const size_t at = (size_t)((random >> 33) % length);
        damaged[at] = round % 2 ? '\0' : (char)(random >> 25);
        const int status = dbc_parse(damaged, "x.dbc", &dbc, &why);
        assert_true(status == STATUS_OK ? dbc != NULL : status == STATUS_BUS_DBC && dbc == NULL && *why.cause);
        dbc_free(dbc);
    }
}

static void a_file_that_is_missing_or_binary_is_refused(void **state)
{
    (void)state;
    struct dbc *dbc;
    struct failure why = {0};
    assert_int_equal(dbc_read("no/such/file.dbc", &dbc, &why), STATUS_FILE_OPEN);
    char path[] = "/tmp/trocar-dbc-XXXXXX";
    const int file = mkstemp(path);
    assert_true(file >= 0);
    FILE *out = fdopen(file, "wb");
    fwrite("VERSION\0", 1, 8, out);
    fclose(out);
    assert_int_equal(dbc_read(path, &dbc, &why), STATUS_BUS_DBC);
    remove(path);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_fault_is_named_with_its_line),
        cmocka_unit_test(a_file_that_is_right_is_read_in_full),
        cmocka_unit_test(a_damaged_file_does_no_harm),
        cmocka_unit_test(a_file_that_is_missing_or_binary_is_refused),
    };
    return cmocka_run_group_tests_name("dbc", tests, NULL, NULL);
}
