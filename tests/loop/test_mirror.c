/* The host's own controller beside the real one: it agrees frame by frame whatever the bus does, and says so when it cannot. */
#include "loop_fixture.h"

#include "mirror.h"
#include "state_hash.h"

struct watch {
    struct mirror mirror;
};

static void watch(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct watch *w = context;
    mirror_receive(&w->mirror, frame, time_us);
}

/* Run a gesture with faults on every identifier; the mirror hears what the bus delivers. With two instruments the second pokes. */
static struct watch run(unsigned instruments, const char *gesture, const struct bus_faults *faults,
                        struct session_result *result)
{
    struct loop l;
    struct watch w = {0};
    struct failure why = {0};
    struct bank_fixture_options bank = bank_fixture_default;
    bank.instruments = instruments;
    loop_bank(&l, &bank);
    loop_open(&l, &(struct session_options){.gesture = {gesture, instruments > 1 ? "poke" : NULL}});
    assert_int_equal(mirror_open(&w.mirror, &l.bank.view, SESSION_NODE, &why), STATUS_OK);
    bus_listen(session_bus(l.session), watch, &w);
    if (faults)
        bus_inject(session_bus(l.session), faults);
    while (loop_tick(&l))
        if (loop_state(&l) == SAFETY_SAFE && l.torques % 2 == 0)
            session_command(l.session, 1);
    mirror_finish(&w.mirror);
    loop_close(&l);
    *result = l.result;
    loop_end(&l);
    mirror_close(&w.mirror);
    return w;
}

static void it_agrees_with_every_torque_frame_and_every_hash(void **state)
{
    (void)state;
    struct session_result result;
    for (unsigned instruments = 1; instruments <= 2; instruments++) {
        const struct watch w = run(instruments, "tour", NULL, &result);
        assert_int_equal(w.mirror.agreed, instruments * result.ticks);
        assert_int_equal(w.mirror.differed + w.mirror.unanswered + w.mirror.lost_ticks + w.mirror.hashes_differed, 0);
        /* one page in ten of Health */
        const uint64_t hashes = instruments * result.ticks / 10 / telemetry_paces[instruments - 1].health;
        assert_in_range(w.mirror.hashes_agreed, hashes - instruments, hashes + instruments);
        assert_false(w.mirror.joined);
        assert_true(result.contact_ticks > 1000);
    }
}

/* What the bus delivers is what the controller got: losses, copies and late frames of anything change nothing. Only a frame that is
 * ticks late, or another than was sent, cannot always be told from another's; then the mirror joins anew. */
static void it_agrees_on_a_bad_bus(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        struct bus_faults faults;
        bool exact;
    } cases[] = {
        {"drop", {.drop = 0.02}, true},
        {"duplicate", {.duplicate = 0.02}, true},
        {"delay", {.delay = 0.02, .delay_us = 300}, true},
        {"delay long", {.delay = 0.02, .delay_us = 2700}, false},
        {"reorder", {.reorder = 0.02}, true},
        {"corrupt", {.corrupt = 0.02}, false},
    };
    for (size_t n = 0; n < 2 * sizeof cases / sizeof cases[0]; n++) {
        const size_t i = n / 2;
        const unsigned instruments = 1 + n % 2;
        struct session_result result;
        struct bus_faults faults = cases[i].faults;
        faults.id_to = 0x7FF;
        faults.seed = 5 + i;
        const struct watch w = run(instruments, "tour", &faults, &result);
        print_message(
            "# %u, %-10s: %llu agree, %llu differ, %llu not heard, %llu ticks lost, %llu frames late, %llu damaged; "
            "hashes %llu, %llu differ\n",
            instruments, cases[i].name, (unsigned long long)w.mirror.agreed, (unsigned long long)w.mirror.differed,
            (unsigned long long)w.mirror.unanswered, (unsigned long long)w.mirror.lost_ticks,
            (unsigned long long)w.mirror.late, (unsigned long long)w.mirror.damaged,
            (unsigned long long)w.mirror.hashes_agreed, (unsigned long long)w.mirror.hashes_differed);
        assert_int_equal(w.mirror.agreed + w.mirror.differed + w.mirror.unanswered, instruments * w.mirror.ticks);
        assert_true(w.mirror.agreed > instruments * 6000);
        assert_true(cases[i].exact ? w.mirror.differed == 0 : w.mirror.differed < w.mirror.agreed / 4);
    }
}

/* Whoever comes later knows neither state nor contacts, and agrees once the instrument has left the tissue. */
static void one_that_joins_agrees_when_the_contact_is_new(void **state)
{
    (void)state;
    struct loop l;
    struct watch w = {0};
    struct failure why = {0};
    loop_bank(&l, NULL);
    loop_open(&l, &(struct session_options){.gesture = {"poke"}});
    assert_int_equal(mirror_open(&w.mirror, &l.bank.view, SESSION_NODE, &why), STATUS_OK);
    while (session_node(l.session)->controller.contact.count == 0)
        loop_run(&l, 1);
    bus_listen(session_bus(l.session), watch, &w);
    loop_run(&l, 1);
    assert_true(w.mirror.joined);
    while (session_node(l.session)->controller.contact.count > 0)
        loop_run(&l, 1);
    loop_run(&l, 300);
    const uint64_t differed = w.mirror.differed, agreed = w.mirror.agreed;
    assert_true(differed > 0);
    while (loop_tick(&l))
        ;
    assert_int_equal(w.mirror.differed, differed);
    assert_true(w.mirror.agreed > agreed + 100);
    mirror_close(&w.mirror);
    loop_close(&l);
    loop_end(&l);
}

/* Another bank, a sample changed by one count: it says so. */
static void it_differs_when_what_it_hears_is_not_what_was(void **state)
{
    (void)state;
    struct loop l;
    struct watch w = {0};
    struct failure why = {0};
    loop_bank(&l, NULL);
    loop_open(&l, &(struct session_options){.gesture = {"press"}});
    struct bank_fixture_options softer = bank_fixture_default;
    softer.young_Pa *= 0.999;
    size_t length;
    struct bank_view other;
    unsigned char *bytes = bank_fixture(&softer, &length);
    assert_int_equal(bank_view_open(&other, bytes, length), STATUS_OK);
    assert_int_equal(mirror_open(&w.mirror, &other, SESSION_NODE, &why), STATUS_OK);
    bus_listen(session_bus(l.session), watch, &w);
    while (loop_tick(&l))
        ;
    assert_true(w.mirror.differed > 100 && w.mirror.hashes_differed > 0 && w.mirror.agreed > 100);
    mirror_close(&w.mirror);
    free(bytes);
    loop_close(&l);
    loop_end(&l);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_agrees_with_every_torque_frame_and_every_hash),
        cmocka_unit_test(it_agrees_on_a_bad_bus),
        cmocka_unit_test(one_that_joins_agrees_when_the_contact_is_new),
        cmocka_unit_test(it_differs_when_what_it_hears_is_not_what_was),
    };
    return cmocka_run_group_tests_name("mirror", tests, NULL, NULL);
}
