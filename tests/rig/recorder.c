/* recorder BANK GESTURE ANSWERS TICKS.csv [options]: a simulated run, written down as what an emulated controller reads.
 *
 *   --ticks N       so many (default: the whole gesture)
 *   --drop P        encoder frames are lost with this probability
 *   --seed N        of the losses and of the jumps (default 1)
 *   --jumps TICK    from this tick on no hand moves so: in every ten ticks four samples are lost, and the tool is then
 *                   elsewhere, as far as the plausibility of the encoders lets it
 *   --period N      of the jumps, instead of ten ticks; at least five
 *   --torques FILE  the torque frames of the run, as `trocar run --torque-log` writes them; not with --jumps
 *
 * The hands of all instruments make the same gesture. ANSWERS holds records of ports/lockstep.h: for each tick the frames
 * until the sample and that time, then the frames until the end and that time. TICKS.csv has a line per tick, found by running the controller on the answers in this
 * process: tick, state, contacts, factorisations, rows' work, rows read, products, contacts held, contacts left out. */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bank.h"
#include "loop.h"
#include "ports/lockstep.h"
#include "session.h"
#include "wire.h"

#define JUMP_rad 0.06 /* to either side: twice that is less than 25 rad/s in five ticks */
#define JUMP_m   0.006

struct recorder {
    const char *bank_path, *gesture, *answers_path, *ticks_path;
    struct session_options options;
    uint64_t jumps_from; /* 0: none */
    uint64_t jump_period;
    struct bank_file bank;
    struct session *session;
    FILE *answers, *ticks;
    uint64_t start_us;
    bool computed; /* in this tick */
    bool failed;
    uint64_t random;
    double jump[BANK_MAX_INSTRUMENTS][3];
};

static double random_between(struct recorder *r, double low, double high)
{
    r->random = r->random * 6364136223846793005u + 1442695040888963407u; /* Knuth's MMIX */
    return low + (high - low) * (double)(r->random >> 11) * 0x1p-53;
}

static void put(struct recorder *r, const struct lockstep_record *record)
{
    r->failed = fwrite(record, sizeof *record, 1, r->answers) != 1 || r->failed;
}

static void put_time(struct recorder *r, uint64_t time_us)
{
    put(r, &(struct lockstep_record){.kind = LOCKSTEP_TIME, .u.time_us = time_us});
}

/* Whether the frame of instrument `t` is lost, and else where the tool is told to be. */
static bool displace(struct recorder *r, uint32_t t, struct can_frame_t *frame)
{
    uint64_t tick = r->start_us / LOOP_TICK_US;
    struct wire_encoders m;
    if (r->jumps_from == 0 || tick < r->jumps_from || !wire_encoders_unpack(&m, frame->data, frame->length))
        return true;
    unsigned phase = (unsigned)((tick - r->jumps_from) % r->jump_period);
    if (phase < 4)
        return false;
    if (phase == 4)
        for (int k = 0; k < 3; k++)
            r->jump[t][k] = k < 2 ? random_between(r, -JUMP_rad, JUMP_rad) : random_between(r, -JUMP_m, JUMP_m);
    const struct bank_axis *axis = r->bank.view.tools[t].axis;
    m.alpha = (uint16_t)(m.alpha + lround(r->jump[t][0] / axis[0].per_count)) & 16383;
    m.beta = (uint16_t)(m.beta + lround(r->jump[t][1] / axis[1].per_count)) & 16383;
    m.insertion = (uint16_t)(m.insertion + lround(r->jump[t][2] / axis[2].per_count)) & 16383;
    wire_encoders_pack(frame->data, &m);
    return true;
}

static void listen(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    (void)time_us;
    struct recorder *r = context;
    struct can_frame_t copy = *frame;
    uint32_t t = frame->id - (WIRE_ENCODERS_ID + SESSION_NODE);
    if (frame->id != WIRE_NMT_ID && t >= r->bank.view.tool_count)
        return;
    bool computed = session_node(r->session)->controller.tick_count * (uint64_t)LOOP_TICK_US > r->start_us;
    if (computed && !r->computed)
        put_time(r, r->start_us + LOOP_SAMPLE_WAIT_US);
    r->computed = computed;
    if (frame->id == WIRE_NMT_ID || displace(r, t, &copy)) {
        struct lockstep_record record = lockstep_send(&copy);
        put(r, &record);
    }
}

static int record(struct recorder *r, struct failure *why)
{
    r->answers = fopen(r->answers_path, "wb");
    if (!r->answers)
        return failure_set(why, STATUS_FILE_WRITE, r->answers_path, NULL, "cannot be written");
    for (uint32_t t = 0; t < r->bank.view.tool_count; t++)
        r->options.gesture[t] = r->gesture;
    int status = session_create(&r->bank, NULL, &r->options, &r->session, why);
    if (status)
        return status;
    bus_listen(session_bus(r->session), listen, r);
    while (session_tick(r->session)) {
        if (!r->computed)
            put_time(r, r->start_us + LOOP_SAMPLE_WAIT_US);
        r->computed = false;
        r->start_us += LOOP_TICK_US;
        put_time(r, r->start_us);
    }
    struct session_result result;
    status = session_finish(r->session, &result, why);
    r->failed = fclose(r->answers) != 0 || r->failed;
    r->answers = NULL;
    if (!status && r->failed)
        return failure_set(why, STATUS_FILE_WRITE, r->answers_path, NULL, "cannot be written");
    return status;
}

static void drain(struct node *n)
{
    struct can_frame_t frame;
    while (node_transmit(n, &frame))
        ;
}

/* Hand the node its frames up to the next time. False at the end. */
static bool answer(struct node *n, FILE *answers)
{
    struct lockstep l = {0};
    struct lockstep_record record;
    struct can_frame_t frame;
    while (fread(&record, sizeof record, 1, answers) == 1)
        if (lockstep_take(&l, &record)) {
            while (lockstep_receive(&l, &frame))
                node_receive(n, &frame);
            return true;
        }
    return false;
}

static int count(struct recorder *r, struct failure *why)
{
    static struct node node;
    size_t bytes = row_cache_memory(&r->bank.view);
    void *rows = bytes ? malloc(bytes) : NULL;
    FILE *answers = fopen(r->answers_path, "rb"), *ticks = fopen(r->ticks_path, "w");
    int status = STATUS_OK;
    if (!answers || !ticks || (bytes && !rows))
        status = failure_set(why, STATUS_FILE_WRITE, r->ticks_path, NULL, "cannot be written, or no memory");
    if (!status)
        status = node_start(&node, &r->bank.view, SESSION_NODE, rows, bytes);
    if (!status)
        fprintf(ticks, "tick,state,contacts,factors,work,rows,products,held,waiting\n");
    for (bool more = !status; more;) {
        struct controller before = node.controller;
        const struct controller *c = &node.controller;
        drain(&node);
        node_begin_tick(&node);
        drain(&node);
        more = answer(&node, answers);
        if (!more)
            break;
        node_finish_tick(&node);
        bool touched = c->rows.tick != before.rows.tick;
        fprintf(ticks, "%u,%d,%u,%u,%u,%u,%u,%u,%u\n", c->tick_count, (int)c->instrument[0].safety.state,
                touched ? c->contact.count : 0, touched ? c->contact.factors : 0, touched ? c->rows.work : 0,
                c->rows.rows_read - before.rows.rows_read, c->rows.products - before.rows.products,
                c->contact.held - before.contact.held, c->contact.waiting - before.contact.waiting);
        drain(&node);
        more = answer(&node, answers);
    }
    if (answers)
        fclose(answers);
    if (ticks && fclose(ticks) != 0 && !status)
        status = failure_set(why, STATUS_FILE_WRITE, r->ticks_path, NULL, "cannot be written");
    free(rows);
    return status;
}

static bool parse(struct recorder *r, int argc, char **argv)
{
    static const struct option options[] = {{"ticks", required_argument, NULL, 'n'},
                                            {"drop", required_argument, NULL, 'd'},
                                            {"seed", required_argument, NULL, 's'},
                                            {"jumps", required_argument, NULL, 'j'},
                                            {"torques", required_argument, NULL, 't'},
                                            {"period", required_argument, NULL, 'p'},
                                            {NULL, 0, NULL, 0}};
    r->jump_period = 10;
    r->options.faults = (struct bus_faults){.id_from = WIRE_ENCODERS_ID + SESSION_NODE,
                                            .id_to = WIRE_ENCODERS_ID + SESSION_NODE + BANK_MAX_INSTRUMENTS - 1,
                                            .seed = 1};
    for (int o; (o = getopt_long(argc, argv, "", options, NULL)) != -1;)
        switch (o) {
        case 'n':
            r->options.ticks = strtoull(optarg, NULL, 10);
            break;
        case 'd':
            r->options.faults.drop = strtod(optarg, NULL);
            break;
        case 's':
            r->options.faults.seed = strtoull(optarg, NULL, 10);
            break;
        case 'j':
            r->jumps_from = strtoull(optarg, NULL, 10);
            break;
        case 'p':
            r->jump_period = strtoull(optarg, NULL, 10);
            break;
        case 't':
            r->options.torque_log = optarg;
            break;
        default:
            return false;
        }
    r->random = r->options.faults.seed;
    if (argc - optind != 4 || r->jump_period < 5)
        return false;
    r->bank_path = argv[optind];
    r->gesture = argv[optind + 1];
    r->answers_path = argv[optind + 2];
    r->ticks_path = argv[optind + 3];
    return true;
}

int main(int argc, char **argv)
{
    static struct recorder r;
    struct failure why = {0};
    if (!parse(&r, argc, argv)) {
        fputs("usage: recorder BANK GESTURE ANSWERS TICKS.csv [options]; see recorder.c\n", stderr);
        return 2;
    }
    int status = bank_load(r.bank_path, &r.bank, &why);
    if (!status)
        status = record(&r, &why);
    if (!status)
        status = count(&r, &why);
    if (r.answers)
        fclose(r.answers);
    session_free(r.session);
    bank_unload(&r.bank);
    if (status)
        failure_print(stderr, &why);
    return status ? 1 : 0;
}
