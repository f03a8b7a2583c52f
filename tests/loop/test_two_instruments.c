/* Two devices on one bus and one controller: what is one instrument's own, and what they share. */
#include "loop_fixture.h"

static void open_two(struct loop *l, const char *first, const char *second)
{
    struct bank_fixture_options two = bank_fixture_default;
    two.instruments = 2;
    loop_bank(l, &two);
    loop_open(l, &(struct session_options){.gesture = {first, second}});
}

static float rendered(const struct loop *l, uint32_t t)
{
    return loop_length(session_node(l->session)->controller.instrument[t].coupling.force_N);
}

static enum safety_state state_of(const struct loop *l, uint32_t t)
{
    return session_node(l->session)->controller.instrument[t].safety.state;
}

/* Into the hold of both. */
static void lean(struct loop *l)
{
    while (session_gesture_time_s(l->session) < 1.5)
        loop_run(l, 1);
    assert_int_equal(state_of(l, 0), SAFETY_RUN);
    assert_int_equal(state_of(l, 1), SAFETY_RUN);
    assert_true(rendered(l, 0) > 0.05f && rendered(l, 1) > 0.05f);
}

/* Each link hears its own controller's numbers, each device its own torques. */
static void unequal_loads_are_unequal_forces_on_the_bus_and_at_the_motors(void **state)
{
    (void)state;
    struct loop l;
    open_two(&l, "press", "hold");
    while (session_gesture_time_s(l.session) < 1.0)
        loop_run(&l, 1);
    for (uint32_t t = 0; t < 2; t++) {
        const struct link *link = session_link(l.session, t);
        const struct device *device = session_device(l.session, t);
        double heard = 0, effort = 0;
        for (int k = 0; k < 3; k++) {
            heard += link->force_N[k] * link->force_N[k];
            effort = fmax(effort, fabs(device->command[k]));
        }
        /* ForcePose is of one of the last 20 ticks, in which the held force moves by less than a part in ten */
        assert_true(fabs(sqrt(heard) - (double)rendered(&l, t)) < 0.1 * (double)rendered(&l, t));
        assert_true(device->enabled && effort > 0);
    }
    assert_true(fabsf(rendered(&l, 0) - rendered(&l, 1)) > 0.2f * rendered(&l, 1));
    while (loop_tick(&l))
        ;
    loop_close(&l);
    assert_int_equal(l.result.instruments, 2);
    assert_int_equal(l.result.missed, 0);
    assert_int_equal(l.result.torque_frames, 2 * l.result.ticks);
    assert_true(l.result.bus_load < 0.7);
    assert_true(l.result.instrument[0].peak_force_N > 1.2 * l.result.instrument[1].peak_force_N);
    loop_end(&l);
}

/* A device that falls silent takes its own torque away, and nothing else; the other feels that it let go of the tissue. */
static void a_silent_device_stops_its_own_instrument_only(void **state)
{
    (void)state;
    for (uint32_t t = 0; t < 2; t++) {
        struct loop l;
        const uint32_t id = WIRE_ENCODERS_ID + SESSION_NODE + t;
        open_two(&l, "hold", "hold");
        lean(&l);
        bus_inject(session_bus(l.session), &(struct bus_faults){.drop = 1, .id_from = id, .id_to = id});
        loop_run(&l, 300);
        assert_int_equal(state_of(&l, t), SAFETY_SAFE);
        assert_true(rendered(&l, t) == 0);
        assert_int_equal(session_link(l.session, t)->state, SAFETY_SAFE);
        assert_int_equal(session_link(l.session, t)->reason, STATUS_LOOP_STALE);
        assert_int_equal(state_of(&l, 1 - t), SAFETY_RUN);
        assert_true(rendered(&l, 1 - t) > 0.05f);
        assert_int_equal(session_node(l.session)->controller.instrument[1 - t].safety.missed, 0);
        assert_int_equal(session_link(l.session, 1 - t)->state, SAFETY_RUN);

        bus_inject(session_bus(l.session), NULL);
        loop_run(&l, 100);
        session_command(l.session, 1); /* SAFE to READY */
        loop_run(&l, 200);
        session_command(l.session, 1);
        loop_run(&l, 400);
        assert_int_equal(state_of(&l, t), SAFETY_RUN);
        assert_int_equal(state_of(&l, 1 - t), SAFETY_RUN);
        loop_close(&l);
        assert_int_equal(l.result.instrument[1 - t].safety.safe_entries, 0);
        loop_end(&l);
    }
}

/* NMT names a node. */
static void a_stop_for_one_node_stops_that_instrument(void **state)
{
    (void)state;
    struct loop l;
    open_two(&l, "hold", "hold");
    lean(&l);
    struct can_frame_t frame = {.id = WIRE_NMT_ID, .length = WIRE_NMT_LENGTH};
    wire_nmt_pack(frame.data, &(struct wire_nmt){.command = 2, .node = SESSION_NODE + 1});
    node_receive((struct node *)session_node(l.session), &frame);
    loop_run(&l, 100);
    assert_int_equal(state_of(&l, 0), SAFETY_RUN);
    assert_int_equal(state_of(&l, 1), SAFETY_SAFE);
    assert_int_equal(session_node(l.session)->controller.instrument[1].safety.reason, STATUS_LOOP_HOST);
    loop_end(&l);
}

/* While both hold still, one draws back: the other's force rises, as the tissue comes up to it. */
static void each_feels_in_the_tissue_what_the_other_does(void **state)
{
    (void)state;
    struct loop l;
    double back[3];
    open_two(&l, "hold", "hold");
    lean(&l);
    const float before = rendered(&l, 0);
    memcpy(back, session_hand(l.session, 1)->start, sizeof back);
    session_drive(l.session, 1, true, back);
    loop_run(&l, 500);
    assert_true(rendered(&l, 1) == 0);
    assert_true(rendered(&l, 0) > 1.02f * before);
    print_message("# %.3f N, and %.3f N when the other is gone\n", (double)before, (double)rendered(&l, 0));
    loop_end(&l);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unequal_loads_are_unequal_forces_on_the_bus_and_at_the_motors),
        cmocka_unit_test(a_silent_device_stops_its_own_instrument_only),
        cmocka_unit_test(a_stop_for_one_node_stops_that_instrument),
        cmocka_unit_test(each_feels_in_the_tissue_what_the_other_does),
    };
    return cmocka_run_group_tests_name("two instruments", tests, NULL, NULL);
}
