/* Pulling the cable, as a table: every way in which the bus, the device, the host or the controller can fail, in the middle of
 * a contact, one after the other in one session that is never restarted. For every row
 *
 *   - what loop_tick checks holds in every tick (force and its change bounded, torques within the motors' limits); in
 *     SAFE, and in a tick without a sample, the force does not grow;
 *   - every frame is accounted for, by equations between the bus's and the nodes' counters:
 *       samples   that arrived + ticks missed = ticks + duplicates + out of sequence + malformed
 *       torques   that arrived = taken + rejected + late
 *       sets      begun = complete + incomplete, but for one of each kind under way, and as long as no number is damaged
 *     and for a fault on one kind of frame alone, its loss in the counters is the number that the bus injected;
 *   - once the fault is gone the host's acknowledgement alone leads back to RUN and to the same force, up to the device's own
 *     friction; and no frame that was held up passes then: every torque frame answers the newest sample.
 *
 * The table is printed. TROCAR_LONG=1 runs it with more ticks and seeds. */
#include "device_node.h"
#include "loop_fixture.h"

enum { SETTLE_TICKS = 400, RECOVERY_TICKS = 500, DRAIN_TICKS = 10 };

static const uint32_t sync_id = WIRE_SYNC_ID, encoders = WIRE_ENCODERS_ID + SESSION_NODE,
                      torques = WIRE_TORQUES_ID + SESSION_NODE, contacts = WIRE_CONTACT_ID + SESSION_NODE,
                      poses = WIRE_FORCE_POSE_ID + SESSION_NODE;

/* What the bus delivered, by an ear of its own. */
struct ear {
    uint64_t torques;
    bool fresh_only; /* every torque frame must answer the newest sample */
    uint8_t sample;
    uint64_t checked;
    uint64_t begun; /* sets of contacts, pairs of pose */
    uint32_t set, pose_set;
};

static struct loop l; /* large */
static struct ear ear;

static void hear(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    (void)context;
    struct wire_encoders sample;
    struct wire_torques m;
    (void)time_us;
    if (frame->id == encoders && wire_encoders_unpack(&sample, frame->data, frame->length))
        ear.sample = sample.sequence;
    if (frame->id != torques)
        return;
    ear.torques++;
    if (ear.fresh_only) {
        assert_true(wire_torques_unpack(&m, frame->data, frame->length));
        assert_int_equal(m.sequence, ear.sample);
        ear.checked++;
    }
}

/* Everything that counts, at one moment. */
struct ledger {
    uint64_t ticks, received, missed, duplicates, out_of_sequence, implausible, malformed, safe_entries;
    uint64_t arrived, taken, rejected, late; /* torque frames */
    uint64_t begun, complete, incomplete;    /* sets of contacts, pairs of pose */
    uint64_t dropped, duplicated, delayed, corrupted, reordered;
};

static struct ledger read_ledger(void)
{
    const struct node *node = session_node(l.session);
    const struct safety *s = &node->controller.instrument[0].safety;
    const struct device_node *device = (const struct device_node *)session_device(l.session, 0); /* its first member */
    const struct link *link = session_link(l.session, 0);
    const struct bus_statistics *bus = bus_statistics(session_bus(l.session));
    return (struct ledger){.ticks = node->controller.tick_count,
                           .received = node->frames_received - node->frames_ignored,
                           .missed = s->missed,
                           .duplicates = s->duplicates,
                           .out_of_sequence = s->out_of_sequence,
                           .implausible = s->implausible,
                           .malformed = node->frames_malformed,
                           .safe_entries = s->safe_entries,
                           .arrived = ear.torques,
                           .taken = device->device.commands_received,
                           .rejected = device->device.commands_rejected,
                           .late = device->late,
                           .begun = ear.begun,
                           .complete = link->contact_sets + link->pose_sets,
                           .incomplete = link->incomplete_sets,
                           .dropped = bus->dropped,
                           .duplicated = bus->duplicated,
                           .delayed = bus->delayed,
                           .corrupted = bus->corrupted,
                           .reordered = bus->reordered};
}

static struct ledger since(const struct ledger *now, const struct ledger *before)
{
    struct ledger d;
    const uint64_t *a = (const uint64_t *)now, *b = (const uint64_t *)before;
    for (size_t i = 0; i < sizeof d / sizeof(uint64_t); i++)
        ((uint64_t *)&d)[i] = a[i] - b[i];
    return d;
}

/* One tick; in SAFE, and without a usable sample, the force does not grow. */
static void one(void)
{
    const struct telemetry *t = &session_node(l.session)->instrument[0].telemetry;
    const struct safety *s = &session_node(l.session)->controller.instrument[0].safety;
    const float before = loop_force(&l);
    const uint32_t missed = s->missed;
    const bool safe = s->state == SAFETY_SAFE;
    assert_true(loop_tick(&l));
    if ((safe && s->state == SAFETY_SAFE) || s->missed > missed)
        assert_true(loop_force(&l) <= before);
    ear.begun += ((t->set - ear.set) & 31) + ((t->pose_set - ear.pose_set) & 7);
    ear.set = t->set;
    ear.pose_set = t->pose_set;
}

/* By how much two equilibria of hand and tissue can differ: in each axis both are within the device's Coulomb friction. */
static double friction_N(void)
{
    const struct device *device = session_device(l.session, 0);
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const double arm = k < 2 ? device->joint[2] * 0.8 : 1; /* cos(0.52 rad) = 0.87 at the end of its range */
        sum += pow(device->model->axis[k].coulomb / arm, 2);
    }
    return 2 * sqrt(sum);
}

static void run(uint64_t ticks)
{
    for (uint64_t t = 0; t < ticks; t++)
        one();
}

/* Back to RUN by acknowledging; returns the ticks that it took. */
static uint64_t recover(void)
{
    uint64_t ticks = 0;
    ear.fresh_only = true;
    for (; loop_state(&l) != SAFETY_RUN; ticks++) {
        assert_true(ticks < RECOVERY_TICKS);
        if (ticks % 20 == 0)
            session_command(l.session, 1);
        one();
    }
    run(SETTLE_TICKS);
    ear.fresh_only = false;
    return ticks;
}

/* A session in contact, held there by the hand for ever. */
static void open_in_contact(void)
{
    double target_m[3];
    memset(&ear, 0, sizeof ear);
    loop_bank(&l, NULL);
    loop_open(&l, &(struct session_options){.gesture = {"hold"}, .endless = true});
    bus_listen(session_bus(l.session), hear, NULL);
    while (session_gesture_time_s(l.session) < 1.2)
        one();
    hand_target(session_hand(l.session, 0), 1.2, target_m);
    session_drive(l.session, 0, true, target_m);
    run(SETTLE_TICKS);
    assert_int_equal(loop_state(&l), SAFETY_RUN);
    assert_true(loop_force(&l) > 0.3f);
}

struct row {
    const char *what, *on;
    struct bus_faults faults;
    uint64_t ticks;
};

static void check_balance(const struct row *row, const struct ledger *d)
{
    const bool silent = row->faults.drop == 1;

    assert_int_equal(d->received + d->missed, d->ticks + d->duplicates + d->out_of_sequence + d->malformed);
    assert_int_equal(d->arrived, d->taken + d->rejected + d->late);
    if (row->faults.corrupt == 0 && !silent)
        assert_in_range(d->complete + d->incomplete + 2, d->begun, d->begun + 4);
}

/* A fault on one kind of frame: its loss in the counters is what the bus says that it injected. */
static void check_alone(const struct row *row, const struct ledger *d)
{
    const uint32_t from = row->faults.id_from, to = row->faults.id_to;
    const bool drop = row->faults.drop > 0, duplicate = row->faults.duplicate > 0, corrupt = row->faults.corrupt > 0;
    if (from == to && (from == encoders || from == sync_id) && drop)
        assert_int_equal(d->missed, d->dropped);
    if (from == to && from == encoders && duplicate)
        assert_int_equal(d->duplicates + d->out_of_sequence, d->duplicated);
    if (from == to && from == encoders && corrupt) /* what is not counted is a count that no receiver can doubt */
        assert_true(d->missed + d->out_of_sequence + d->duplicates + d->implausible + d->malformed <= 2 * d->corrupted);
    if (from == to && from == torques) {
        assert_int_equal(d->missed + d->duplicates + d->out_of_sequence, 0);
        if (drop)
            assert_int_equal(d->ticks - d->arrived, d->dropped);
        if (duplicate)
            assert_int_equal(d->arrived - d->ticks, d->duplicated);
        if (corrupt) { /* rejected, or no longer a torque frame */
            assert_int_equal(d->rejected + (d->ticks - d->arrived), d->corrupted);
            assert_int_equal(d->taken, d->ticks - d->corrupted);
        }
    }
    if (from == contacts && to == poses) {
        assert_int_equal(d->missed + d->late, 0);
        assert_true(d->rejected <= d->corrupted); /* some became torque frames, without a torque frame's CRC */
        if (drop && row->faults.drop < 1)         /* a set and a pair have two frames here */
            assert_in_range(d->dropped, d->incomplete, 2 * d->incomplete);
        if (duplicate)
            assert_int_equal(d->incomplete, 0);
    }
}

static void run_row(const struct row *row)
{
    struct ledger before, after, d;
    const float *f = session_node(l.session)->controller.instrument[0].coupling.force_N;
    const float held[3] = {f[0], f[1], f[2]};
    const uint64_t silences = session_device(l.session, 0)->silences;
    l.largest_change_N = 0;
    before = read_ledger();
    bus_inject(session_bus(l.session), &row->faults);
    run(row->ticks);
    bus_inject(session_bus(l.session), NULL);
    run(DRAIN_TICKS);
    after = read_ledger();
    d = since(&after, &before);
    const bool was_safe = loop_state(&l) == SAFETY_SAFE;
    const uint64_t ticks = recover();
    const float change[3] = {f[0] - held[0], f[1] - held[1], f[2] - held[2]};
    print_message("# %-12s %-8s %6llu %6llu %6llu %6llu %6llu %6llu %6llu %6llu %6llu %5.2f %4s %4llu %6.3f\n",
                  row->what, row->on,
                  (unsigned long long)(d.dropped + d.duplicated + d.delayed + d.corrupted + d.reordered),
                  (unsigned long long)d.missed, (unsigned long long)(d.duplicates + d.out_of_sequence),
                  (unsigned long long)d.implausible, (unsigned long long)d.malformed, (unsigned long long)d.rejected,
                  (unsigned long long)d.late, (unsigned long long)d.incomplete,
                  (unsigned long long)(session_device(l.session, 0)->silences - silences), (double)l.largest_change_N,
                  d.safe_entries ? "SAFE" : "-", (unsigned long long)ticks, (double)loop_length(change));
    check_balance(row, &d);
    check_alone(row, &d);
    assert_true(!was_safe || d.safe_entries > 0);
    assert_true((double)loop_length(change) <= friction_N());
}

static void print_head(void)
{
    print_message("# %-12s %-8s %6s %6s %6s %6s %6s %6s %6s %6s %6s %5s %4s %4s %6s\n", "fault", "on", "hit", "missed",
                  "order", "implau", "malfor", "reject", "late", "sets", "silent", "dF N", "", "ms", "dF end");
}

static void anything_lost_repeated_late_or_damaged_is_bounded_counted_and_recovered_from(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint32_t from, to;
    } on[] = {{"sync", WIRE_SYNC_ID, WIRE_SYNC_ID},
              {"samples", WIRE_ENCODERS_ID + 1, WIRE_ENCODERS_ID + 1},
              {"torques", WIRE_TORQUES_ID + 1, WIRE_TORQUES_ID + 1},
              {"display", WIRE_CONTACT_ID + 1, WIRE_FORCE_POSE_ID + 1},
              {"all", 0, 0x7FF}};
    static const struct {
        const char *name;
        struct bus_faults faults; /* with a probability of 1 */
    } kinds[] = {{"drop", {.drop = 1}},
                 {"duplicate", {.duplicate = 1}},
                 {"delay 0.3 ms", {.delay = 1, .delay_us = 300}},
                 {"delay 2.5 ms", {.delay = 1, .delay_us = 2500}},
                 {"reorder", {.reorder = 1}},
                 {"corrupt", {.corrupt = 1}}};
    static const double rates[] = {0.001, 0.01, 0.1};
    const bool thorough = getenv("TROCAR_LONG") != NULL;
    open_in_contact();
    for (size_t r = 0; r < 3; r++) {
        print_message("# %g %% of the frames\n", 100 * rates[r]);
        print_head();
        for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++)
            for (size_t i = 0; i < sizeof on / sizeof on[0]; i++)
                for (uint64_t seed = 1; seed <= (thorough ? 20 : 1); seed++) {
                    struct row row = {kinds[k].name, on[i].name, kinds[k].faults,
                                      thorough ? 5000
                                      : r == 0 ? 4000
                                               : 1000};
                    row.faults.drop *= rates[r];
                    row.faults.duplicate *= rates[r];
                    row.faults.delay *= rates[r];
                    row.faults.reorder *= rates[r];
                    row.faults.corrupt *= rates[r];
                    row.faults.id_from = on[i].from;
                    row.faults.id_to = on[i].to;
                    row.faults.seed = seed + 100 * k;
                    run_row(&row);
                }
    }
    assert_true(ear.checked > 10000);
    loop_close(&l);
    loop_end(&l);
}

static void any_silence_is_bounded_counted_and_recovered_from(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint32_t from, to;
        uint64_t ticks;
        bool safe, motors_off;
    } cuts[] = {
        {"device 4 ms", WIRE_ENCODERS_ID + 1, WIRE_ENCODERS_ID + 1, SAFETY_STALE_TICKS - 1, false, false},
        {"device 5 ms", WIRE_ENCODERS_ID + 1, WIRE_ENCODERS_ID + 1, SAFETY_STALE_TICKS, true, false},
        {"device 1 s", WIRE_ENCODERS_ID + 1, WIRE_ENCODERS_ID + 1, 1000, true, true},
        {"sync 1 s", WIRE_SYNC_ID, WIRE_SYNC_ID, 1000, true, true},
        {"torques 9 ms", WIRE_TORQUES_ID + 1, WIRE_TORQUES_ID + 1, 9, false, false},
        {"torques 1 s", WIRE_TORQUES_ID + 1, WIRE_TORQUES_ID + 1, 1000, false, true},
        {"host 1 s", 0x77F, 0x77F, 1000, false, false},
        {"display 1 s", WIRE_CONTACT_ID + 1, WIRE_FORCE_POSE_ID + 1, 1000, false, false},
        {"cable 20 ms", 0, 0x7FF, 20, true, true},
        {"cable 1 s", 0, 0x7FF, 1000, true, true},
    };
    open_in_contact();
    print_head();
    for (size_t i = 0; i < sizeof cuts / sizeof cuts[0]; i++) {
        const struct row row = {
            cuts[i].name, "silent", {.drop = 1, .id_from = cuts[i].from, .id_to = cuts[i].to}, cuts[i].ticks};
        const uint32_t entries = session_node(l.session)->controller.instrument[0].safety.safe_entries;
        /* look at the motors at the silence's end: run it once for that, without the ledger */
        bus_inject(session_bus(l.session), &row.faults);
        run(row.ticks);
        double effort = 0;
        for (int k = 0; k < 3; k++)
            effort = fmax(effort, fabs(session_device(l.session, 0)->effort[k]));
        assert_true(cuts[i].motors_off ? effort < 2e-3 : effort > 0.1); /* 2 mN: the motors' lag after 10 ms */
        assert_int_equal(loop_state(&l), cuts[i].safe ? SAFETY_SAFE : SAFETY_RUN);
        assert_int_equal(session_node(l.session)->controller.instrument[0].safety.safe_entries - entries, cuts[i].safe);
        bus_inject(session_bus(l.session), NULL);
        run(DRAIN_TICKS);
        recover();
        run_row(&row);
    }
    loop_close(&l);
    loop_end(&l);
}

/* The controller starts anew in mid-contact: silent at once, and for as long as the host does not start it; then the force
 * comes in again with its rate limit, although the tool has been in the tissue all the time. */
static void a_controller_that_resets_in_contact_is_silent_until_started(void **state)
{
    (void)state;
    open_in_contact();
    for (int n = 0; n < 5; n++) {
        struct node *node = (struct node *)session_node(l.session);
        const float held = loop_force(&l);
        assert_int_equal(node_start(node, &l.bank.view, SESSION_NODE, NULL, 0), STATUS_OK);
        memset(l.last_force, 0, sizeof l.last_force); /* it has none */
        for (int t = 0; t < 300 + 37 * n; t++) {
            one();
            assert_true(loop_state(&l) == SAFETY_INIT || loop_state(&l) == SAFETY_READY);
            assert_true(loop_force(&l) == 0 && !node->instrument[0].output.enable);
            assert_true(t < 2 || !session_device(l.session, 0)->enabled);
        }
        assert_int_equal(loop_state(&l), SAFETY_READY);
        assert_int_equal(session_link(l.session, 0)->state, SAFETY_READY);
        l.largest_change_N = 0;
        const uint64_t ticks = recover();
        print_message("# reset %d: force %.3f N before, %.3f N after %llu ms, at most %.3f N in a tick\n", n,
                      (double)held, (double)loop_force(&l), (unsigned long long)(ticks + SETTLE_TICKS),
                      (double)l.largest_change_N);
        assert_true(loop_force(&l) > 0.3f);
        assert_true(l.largest_change_N < 0.2f * held); /* no step */
    }
    loop_close(&l);
    loop_end(&l);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_silence_is_bounded_counted_and_recovered_from),
        cmocka_unit_test(a_controller_that_resets_in_contact_is_silent_until_started),
        cmocka_unit_test(anything_lost_repeated_late_or_damaged_is_bounded_counted_and_recovered_from),
    };
    return cmocka_run_group_tests_name("pulling the cable", tests, NULL, NULL);
}
