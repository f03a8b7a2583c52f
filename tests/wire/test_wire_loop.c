/* The protocol in use: every frame of a whole run against wire.dbc, and what the host has heard against what the
 * controller held. */
#include "loop/loop_fixture.h"

#include "dbc.h"
#include "framebits.h"

/* What was heard on the bus of one run. */
struct ear {
    struct dbc *dbc;
    uint64_t count[DBC_MAX_MESSAGES];
    uint64_t sync_start_us, torque_latest_us, pages; /* pages: bit per page of Health */
    uint8_t counter;
    bool counter_known;
};

static void hear(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct ear *ear = context;
    unsigned node;
    const struct dbc_message *m = dbc_find(ear->dbc, frame->id, &node);
    if (!m || frame->flags || (node != 0 && node != SESSION_NODE))
        fail_msg("frame 0x%x is not of the protocol", frame->id);
    struct dbc_reading reading[DBC_MAX_SIGNALS];
    const size_t count = dbc_decode(m, frame->data, frame->length, reading);
    if (count == 0)
        fail_msg("a frame of %s has a wrong length or page", m->name);
    ear->count[m - ear->dbc->message]++;
    uint64_t owned = 0, bits = 0;
    for (size_t i = 0; i < count; i++) {
        const struct dbc_signal *s = reading[i].signal;
        owned |= ((UINT64_C(1) << s->bits) - 1) << s->start;
        if (reading[i].value < s->minimum || reading[i].value > s->maximum)
            fail_msg("%s.%s is %g, not in [%g|%g]", m->name, s->name, reading[i].value, s->minimum, s->maximum);
        if (frame->id == WIRE_HEALTH_ID + SESSION_NODE && s->kind == DBC_SELECTOR)
            ear->pages |= UINT64_C(1) << reading[i].raw;
    }
    for (unsigned i = 0; i < frame->length; i++)
        bits |= (uint64_t)frame->data[i] << 8 * i;
    if (bits & ~owned)
        fail_msg("%s has a bit that no signal owns", m->name);
    if (frame->id == WIRE_SYNC_ID) {
        if (ear->counter_known)
            assert_int_equal(frame->data[0], (uint8_t)(ear->counter + 1));
        ear->counter = frame->data[0];
        ear->counter_known = true;
        ear->sync_start_us = time_us - framebits(frame);
    }
    if (frame->id == WIRE_TORQUES_ID + SESSION_NODE && time_us - ear->sync_start_us > ear->torque_latest_us)
        ear->torque_latest_us = time_us - ear->sync_start_us;
}

static void every_frame_of_a_run_is_in_the_dbc_and_within_its_ranges(void **state)
{
    (void)state;
    struct loop l;
    struct ear ear = {0};
    struct failure why = {0};
    assert_int_equal(dbc_read("shared/wire.dbc", &ear.dbc, &why), STATUS_OK);
    loop_bank(&l, NULL);
    loop_open(&l, &(struct session_options){.gesture = {"tour"}});
    bus_listen(session_bus(l.session), hear, &ear);
    uint64_t ticks = 0;
    while (loop_tick(&l))
        if (++ticks == 3000)
            session_command(l.session, 2); /* so that an EMCY is heard */
    loop_close(&l);
    for (size_t i = 0; i < ear.dbc->message_count; i++) {
        print_message("# %-14s %6llu\n", ear.dbc->message[i].name, (unsigned long long)ear.count[i]);
        assert_true(ear.count[i] > 0);
    }
    assert_int_equal(ear.pages, 0x3ff);
    assert_int_equal(l.result.link_malformed + l.result.link_incomplete, 0);
    print_message("# load %.1f %%, torques at most %llu us behind the start of SYNC\n", 100 * l.result.bus_load,
                  (unsigned long long)ear.torque_latest_us);
    assert_true(l.result.bus_load < 0.70);
    /* SPEC.md, One tick, with one foreign frame before the torques */
    assert_true(ear.torque_latest_us <= SESSION_COMPUTE_US + 2 * framebits_worst(8, false));
    dbc_free(ear.dbc);
    loop_end(&l);
}

enum { HISTORY = 256 };

/* The pushing contacts of as many ticks as a set may take and be late, as the controller held them. */
struct history {
    size_t next;
    struct contact_set tick[HISTORY];
};

/* Half a step of the wire and the rounding of two floats. */
static bool near(double wire, double controller, double step)
{
    return fabs(wire - controller) <= step / 2 + 1e-6 * fabs(controller);
}

static bool same_set(const struct link *link, const struct contact_set *s)
{
    size_t k = 0;
    for (uint32_t i = 0; i < s->count; i++) {
        const struct contact *c = &s->contact[i];
        if (!(c->pressure_N > 0))
            continue;
        if (k == link->contact_count)
            return false;
        const struct link_contact *h = &link->contact[k++];
        if (h->triangle != c->triangle)
            return false;
        for (int a = 0; a < 3; a++)
            if (!near(h->displacement_m[a], (double)c->displacement_m[a], (double)WIRE_CONTACT_DISPLACEMENT_X_SCALE))
                return false;
        for (int a = 0; a < 2; a++)
            if (!near(h->weights[a], (double)c->weights[1 + a], (double)WIRE_CONTACT_WEIGHT1_SCALE))
                return false;
    }
    return k == link->contact_count;
}

/* Run a gesture; every set of contacts and every tip and force that the host hands on must be one that the controller had
 * in one tick. Returns sets with contact. */
static uint64_t compare(const struct bus_faults *faults, struct session_result *result)
{
    static struct history history;
    struct loop l;
    uint64_t sets = 0, poses = 0, touching = 0;
    memset(&history, 0, sizeof history);
    loop_bank(&l, NULL);
    loop_open(&l, &(struct session_options){.gesture = {"tour"}});
    if (faults)
        bus_inject(session_bus(l.session), faults);
    while (loop_tick(&l)) {
        const struct link *link = session_link(l.session, 0);
        const struct controller *c = &session_node(l.session)->controller;
        history.tick[history.next++ % HISTORY] = c->contact;
        if (link->contact_sets != sets) {
            bool found = false;
            for (size_t i = 0; i < HISTORY; i++)
                found |= same_set(link, &history.tick[i]);
            assert_true(found);
            touching += link->contact_count > 0;
            sets = link->contact_sets;
        }
        if (!faults && link->pose_sets != poses) {
            poses = link->pose_sets;
            for (int a = 0; a < 3; a++) {
                assert_true(near(link->tip_m[a], (double)c->instrument[0].kinematics.tip_m[a],
                                 (double)WIRE_FORCE_POSE_TIP_X_SCALE));
                assert_true(near(link->force_N[a], (double)c->instrument[0].coupling.force_N[a],
                                 (double)WIRE_FORCE_POSE_FORCE_X_SCALE));
            }
            assert_int_equal(link->state, c->instrument[0].safety.state);
        }
    }
    loop_close(&l);
    *result = l.result;
    loop_end(&l);
    return touching;
}

static void the_host_hears_what_the_controller_holds(void **state)
{
    (void)state;
    struct session_result result;
    const uint64_t sets = compare(NULL, &result);
    print_message("# %llu sets with contact in %llu ticks\n", (unsigned long long)sets,
                  (unsigned long long)result.ticks);
    /* a set takes its frames' turns, and the next begins at the soonest pace->set ticks after it began */
    const struct telemetry_pace *pace = &telemetry_paces[0];
    const uint64_t longest = pace->contact * (2 * (uint64_t)result.max_contacts + 1);
    assert_true(sets >= result.contact_ticks / (longest > pace->set ? longest : pace->set) - 2);
    assert_true(result.contact_ticks > 3000);
}

static void a_bad_bus_makes_the_host_hear_less_but_nothing_false(void **state)
{
    (void)state;
    struct session_result result;
    const uint32_t id = WIRE_CONTACT_ID + SESSION_NODE;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        const struct bus_faults faults = {.drop = 0.1,
                                          .duplicate = 0.1,
                                          .delay = 0.1,
                                          .reorder = 0.1,
                                          .delay_us = 3000,
                                          .id_from = id,
                                          .id_to = id,
                                          .seed = seed};
        const uint64_t sets = compare(&faults, &result);
        print_message("# seed %llu: %llu sets with contact, %llu incomplete, %llu frames dropped\n",
                      (unsigned long long)seed, (unsigned long long)sets, (unsigned long long)result.link_incomplete,
                      (unsigned long long)result.bus.dropped);
        assert_true(sets > 100 && result.link_incomplete > 0);
        assert_int_equal(result.missed, 0); /* telemetry does not touch the loop */
    }
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_frame_of_a_run_is_in_the_dbc_and_within_its_ranges),
        cmocka_unit_test(the_host_hears_what_the_controller_holds),
        cmocka_unit_test(a_bad_bus_makes_the_host_hear_less_but_nothing_false),
    };
    return cmocka_run_group_tests_name("wire in the loop", tests, NULL, NULL);
}
