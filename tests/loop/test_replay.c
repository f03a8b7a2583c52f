/* A recording of a whole gesture through a controller in this process, and through one on a bus in the place of its device. */
#include "loop_fixture.h"

#include "random.h"
#include "replay_bus.h"

static bool busy; /* the machine that stamps was away now and then */

static void write_frame(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct failure why = {0};
    static uint64_t away_us;
    if (busy && random_below(50) == 0)
        away_us += random_below(40000);
    assert_int_equal(candump_write(context, "soft", frame, busy ? time_us + away_us : time_us, &why), STATUS_OK);
}

/* The log of a gesture in a temporary file, of two instruments with the second one's pokes; `l` keeps the bank. */
static FILE *record(struct loop *l, unsigned instruments, const char *gesture)
{
    struct bank_fixture_options bank = bank_fixture_default;
    bank.instruments = instruments;
    FILE *log = tmpfile();
    assert_non_null(log);
    loop_bank(l, &bank);
    loop_open(l, &(struct session_options){.gesture = {gesture, instruments > 1 ? "poke" : NULL}});
    bus_listen(session_bus(l->session), write_frame, log);
    while (loop_tick(l))
        ;
    loop_close(l);
    rewind(log);
    return log;
}

static void in_this_process(unsigned instruments)
{
    struct loop l;
    struct replay_result result;
    struct failure why = {0};
    FILE *log = record(&l, instruments, "tour");
    assert_int_equal(replay_log(log, "log", &l.bank.view, &(struct replay_options){0}, &result, &why), STATUS_OK);
    assert_int_equal(result.ticks, l.result.ticks);
    assert_int_equal(result.agreed, instruments * l.result.ticks);
    assert_int_equal(result.instruments, instruments);
    assert_int_equal(result.differed + result.hashes_differed + result.unanswered + result.late + result.line, 0);
    assert_true(fabs(result.peak_force_N - l.result.peak_force_N) < 1e-6);
    fclose(log);
    loop_end(&l);
}

static void in_this_process_every_torque_frame_is_the_same(void **state)
{
    (void)state;
    in_this_process(1);
    in_this_process(2);
}

static void stamps_of_a_busy_machine_do_no_harm(void **state)
{
    random_seed("stamps", 31);
    busy = true;
    in_this_process_every_torque_frame_is_the_same(state);
    busy = false;
}

static void ignore(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    (void)time_us;
    node_receive(context, frame);
}

static void transmit(struct bus *bus, int port, struct node *node)
{
    struct can_frame_t frame;
    while (node_transmit(node, &frame))
        assert_true(bus_send(bus, port, &frame));
}

/* `wrong`: the controller has another bank. */
static void on_a_bus(unsigned instruments, bool wrong, const char *gesture)
{
    static struct node node;
    struct loop l;
    struct failure why = {0};
    struct replay_bus replay;
    struct backend *backend;
    struct backend_received received;
    struct bank_fixture_options softer = bank_fixture_default;
    struct bank_view other;
    size_t length;
    softer.young_Pa *= 0.999;
    softer.instruments = instruments;
    unsigned char *bytes = bank_fixture(&softer, &length);
    assert_int_equal(bank_view_open(&other, bytes, length), STATUS_OK);
    FILE *log = record(&l, instruments, gesture);
    assert_int_equal(replay_bus_open(&replay, log, "log", &(struct replay_options){0}, &why), STATUS_OK);
    assert_int_equal(replay.tick_count, l.result.ticks);
    struct bus *bus = bus_create(1000000);
    const int port = bus_attach(bus, ignore, &node);
    assert_int_equal(backend_soft(bus, NULL, &backend, &why), STATUS_OK);
    assert_int_equal(node_start(&node, wrong ? &other : &l.bank.view, SESSION_NODE, NULL, 0), STATUS_OK);
    int status = 0;
    for (uint64_t tick = 0; status == 0; tick++) {
        assert_true(tick <= replay.tick_count);
        node_begin_tick(&node);
        transmit(bus, port, &node);
        for (uint64_t t = 50; t <= 1000; t += 50) {
            bus_run(bus, 1000 * tick + t);
            while (status == 0 && backend_receive(backend, &received, 0, &why) == 1)
                status = replay_bus_receive(&replay, backend, &received, &why);
            if (t == 450) {
                node_finish_tick(&node);
                transmit(bus, port, &node);
            }
        }
    }
    assert_int_equal(status, 1);
    assert_int_equal(replay.agreed + replay.differed, instruments * l.result.ticks);
    assert_int_equal(replay.unanswered + replay.no_room + replay.not_recorded, 0);
    assert_int_equal(node.controller.instrument[0].safety.missed, 0);
    if (wrong)
        assert_true(replay.differed > 100 && replay.agreed > 100 && replay.line > 0);
    else
        assert_int_equal(replay.differed, 0);
    replay_bus_close(&replay);
    backend_close(backend);
    bus_free(bus);
    fclose(log);
    free(bytes);
    loop_end(&l);
}

static void on_a_bus_in_the_place_of_the_device_every_torque_frame_is_the_same(void **state)
{
    (void)state;
    on_a_bus(1, false, "tour");
    on_a_bus(2, false, "tour");
}

static void on_a_bus_another_bank_is_found_out(void **state)
{
    (void)state;
    on_a_bus(1, true, "press");
    on_a_bus(2, true, "press");
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(in_this_process_every_torque_frame_is_the_same),
        cmocka_unit_test(stamps_of_a_busy_machine_do_no_harm),
        cmocka_unit_test(on_a_bus_in_the_place_of_the_device_every_torque_frame_is_the_same),
        cmocka_unit_test(on_a_bus_another_bank_is_found_out),
    };
    return cmocka_run_group_tests_name("replay", tests, NULL, NULL);
}
