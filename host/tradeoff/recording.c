#include "recording.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "progress.h"
#include "session.h"
#include "wire.h"

struct ear {
    struct recording *recording;
    size_t room;
    bool failed;
};

static void hear(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct ear *ear = context;
    struct recording *r = ear->recording;
    bool wanted =
        frame->id == WIRE_ENCODERS_ID + SESSION_NODE || frame->id == WIRE_NMT_ID || frame->id == WIRE_HOST_HEARTBEAT_ID;
    if (!wanted || ear->failed)
        return;
    if (r->frames == ear->room) {
        size_t room = ear->room ? 2 * ear->room : 4096;
        void *frames = realloc(r->frame, room * sizeof *r->frame);
        if (frames)
            r->frame = frames;
        void *times = realloc(r->time_us, room * sizeof *r->time_us);
        if (times)
            r->time_us = times;
        ear->failed = !frames || !times;
        if (ear->failed)
            return;
        ear->room = room;
    }
    r->frame[r->frames] = *frame;
    r->time_us[r->frames++] = time_us;
}

/* What each tick sees: the frames go through a node as the session moves them. */
static bool gather_inputs(const struct bank_view *bank, struct recording *r)
{
    struct node *node = malloc(sizeof *node);
    size_t bytes = row_cache_memory(bank);
    void *memory = malloc(bytes + 1);
    r->input = malloc((r->ticks + 1) * sizeof *r->input);
    if (!node || !memory || !r->input || node_start(node, bank, SESSION_NODE, memory, bytes) != STATUS_OK) {
        free(node);
        free(memory);
        return false;
    }
    struct can_frame_t drop;
    size_t next = 0;
    for (size_t t = 0; t < r->ticks; t++) {
        uint64_t start_us = t * SESSION_TICK_US;
        node_begin_tick(node);
        for (; next < r->frames && r->time_us[next] <= start_us + SESSION_COMPUTE_US; next++)
            node_receive(node, &r->frame[next]);
        for (uint32_t i = 0; i < TICK_INSTRUMENTS; i++)
            r->input[t][i] = node->instrument[i].input;
        node_finish_tick(node);
        while (node_transmit(node, &drop))
            ;
        for (; next < r->frames && r->time_us[next] < start_us + SESSION_TICK_US; next++)
            node_receive(node, &r->frame[next]);
    }
    free(node);
    free(memory);
    return true;
}

int recording_make(const struct bank_file *bank, const char *gesture, struct recording *r, struct failure *why)
{
    *r = (struct recording){0};
    snprintf(r->gesture, sizeof r->gesture, "%s", gesture);
    struct session_options options = {.gesture = {gesture}};
    struct session_result result;
    struct session *session;
    struct ear ear = {.recording = r};
    int status = session_create(bank, NULL, &options, &session, why);
    if (status)
        return status;
    bus_listen(session_bus(session), hear, &ear);
    while (session_tick(session))
        r->ticks++;
    status = session_finish(session, &result, why);
    session_free(session);
    if (!status && interrupted())
        status = failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while recording a gesture");
    else if (!status && (result.final_state != SAFETY_RUN || result.contact_ticks == 0))
        status = failure_set(why, STATUS_LOOP_SAFE, NULL, "try it with trocar run",
                             "the gesture \"%.60s\" cannot be measured: %s", gesture,
                             result.contact_ticks ? "the controller ended in SAFE" : "it never touches the body");
    else if (!status && (ear.failed || !gather_inputs(&bank->view, r)))
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the recording");
    if (status)
        recording_free(r);
    return status;
}

void recording_free(struct recording *r)
{
    free(r->input);
    free(r->frame);
    free(r->time_us);
    *r = (struct recording){0};
}

static int rising(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

/* One run; `took_ns` takes the time of each tick. */
static bool run_once(const struct bank_view *bank, const struct recording *recording, struct controller *c,
                     void *memory, size_t bytes, struct replay *r, double *took_ns)
{
    struct tick_output out[TICK_INSTRUMENTS];
    if (controller_start(c, bank, memory, bytes) != STATUS_OK)
        return false;
    for (size_t t = 0; t < recording->ticks; t++) {
        double before = now_ns();
        tick(c, bank, recording->input[t], out);
        took_ns[t] = now_ns() - before;
        memcpy(r->force_N[t], c->contact.force_N[0], sizeof r->force_N[t]);
        r->contacts[t] = (uint8_t)c->contact.count;
        if (c->contact.count == 0)
            continue;
        r->contacts_max = c->contact.count > r->contacts_max ? c->contact.count : r->contacts_max;
        r->factors_max = c->contact.factors > r->factors_max ? c->contact.factors : r->factors_max;
    }
    r->solver_cuts = c->contact.cut;
    r->waits = c->contact.held + c->contact.waiting;
    return true;
}

/* Of each tick the median of the runs: what else the machine did in one of them falls out. */
static void judge_times(struct replay *r, unsigned runs, const double *took_ns)
{
    double sum = 0, of_tick[REPLAY_MAX_RUNS];
    size_t touching = 0;
    r->ns_max = 0;
    for (size_t t = 0; t < r->ticks; t++) {
        if (r->contacts[t] == 0)
            continue;
        for (unsigned k = 0; k < runs; k++)
            of_tick[k] = took_ns[k * r->ticks + t];
        qsort(of_tick, runs, sizeof *of_tick, rising);
        touching++;
        sum += of_tick[runs / 2];
        r->ns_max = fmax(r->ns_max, of_tick[runs / 2]);
    }
    r->ns_mean = touching ? sum / (double)touching : NAN;
}

int replay_run(const struct bank_view *bank, const struct recording *recording, unsigned runs, struct replay *r,
               struct failure *why)
{
    *r = (struct replay){.ticks = recording->ticks};
    runs = runs < REPLAY_MAX_RUNS ? runs : REPLAY_MAX_RUNS;
    r->force_N = malloc((r->ticks + 1) * sizeof *r->force_N);
    r->contacts = malloc(r->ticks + 1);
    struct controller *c = malloc(sizeof *c);
    double *took_ns = malloc((runs * r->ticks + 1) * sizeof *took_ns);
    size_t bytes = row_cache_memory(bank);
    void *memory = malloc(bytes + 1);
    int status = STATUS_OK;
    if (!r->force_N || !r->contacts || !c || !took_ns || !memory)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to replay the recording");
    for (unsigned k = 0; k < runs && !status; k++) {
        if (!run_once(bank, recording, c, memory, bytes, r, took_ns + k * r->ticks))
            status = failure_set(why, STATUS_BANK_MEMORY, NULL, NULL, "the controller does not start on the bank");
        else if (interrupted())
            status = failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while replaying the recording");
    }
    if (!status)
        judge_times(r, runs, took_ns);
    free(c);
    free(took_ns);
    free(memory);
    if (status)
        replay_free(r);
    return status;
}

void replay_free(struct replay *r)
{
    free(r->force_N);
    free(r->contacts);
    *r = (struct replay){0};
}

struct tick_error tick_error_of(double *found, size_t count, double peak)
{
    struct tick_error error = {0};
    if (count > 0 && peak > 0) {
        qsort(found, count, sizeof *found, rising);
        error.p95 = found[(size_t)ceil(0.95 * (double)count) - 1] / peak;
        error.max = found[count - 1] / peak;
    }
    return error;
}

int replay_compare(const struct replay *r, const struct replay *reference, unsigned rate_Hz, struct tick_error *error,
                   struct failure *why)
{
    size_t hold = rate_Hz > 0 && rate_Hz < TICK_RATE_HZ ? TICK_RATE_HZ / rate_Hz : 1, count = 0;
    double *found = malloc((r->ticks + 1) * sizeof *found), peak = 0;
    *error = (struct tick_error){0};
    if (!found)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to compare forces");
    for (size_t t = 0; t < r->ticks; t++) {
        double difference = 0, size = 0;
        size_t held = t - t % hold;
        for (int a = 0; a < 3; a++) {
            double f = (double)r->force_N[held][a], g = (double)reference->force_N[t][a];
            difference += (f - g) * (f - g);
            size += g * g;
        }
        peak = fmax(peak, sqrt(size));
        if (r->contacts[held] || reference->contacts[t])
            found[count++] = sqrt(difference);
    }
    *error = tick_error_of(found, count, peak);
    free(found);
    return STATUS_OK;
}
