/* trocar run --bus: the host of a controller that is out there. */
#include <json-c/json.h>
#include <stdio.h>

#include "cli.h"
#include "progress.h"
#include "remote.h"
#include "safety.h"

static const char *state_text(unsigned state)
{
    static const char *const names[] = {"INIT", "READY", "RUN", "SAFE"};
    return state < 4 ? names[state] : "?";
}

static uint64_t missed(const struct remote_instrument *i)
{
    return i->link.health[0]; /* link_health_name(0) is "missed" */
}

static double seconds(const struct remote *r)
{
    return 1e-6 * (double)(r->last_us - r->first_us);
}

/* Of all instruments: sums, the largest force, and of the states SAFE before the lowest. */
struct sum {
    uint64_t missed, malformed, incomplete, torques;
    double peak_force_N;
    bool ran;
    const struct link *worst;
};

static struct sum sum_up(const struct remote *r)
{
    struct sum s = {.ran = true, .worst = &r->instrument[0].link};
    for (uint32_t t = 0; t < r->instruments; t++) {
        const struct remote_instrument *i = &r->instrument[t];
        s.missed += missed(i);
        s.malformed += i->link.malformed;
        s.incomplete += i->link.incomplete_sets;
        s.torques += i->torques;
        s.peak_force_N = i->peak_force_N > s.peak_force_N ? i->peak_force_N : s.peak_force_N;
        s.ran = s.ran && i->ran;
        if (s.worst->state != SAFETY_SAFE && (i->link.state == SAFETY_SAFE || i->link.state < s.worst->state))
            s.worst = &i->link;
    }
    return s;
}

static void print_table(const struct remote *r, const struct backend_counters *c, const char *sha256)
{
    const struct sum s = sum_up(r);
    printf("%-26s %llu in %.2f s\n", "ticks", (unsigned long long)r->ticks, seconds(r));
    printf("%-26s %llu\n", "missed ticks", (unsigned long long)s.missed);
    printf("%-26s %.3f N\n", "peak force", s.peak_force_N);
    for (uint32_t t = 0; t < r->instruments && r->instruments > 1; t++)
        printf("  node %-19u %.3f N, %s\n", (unsigned)r->instrument[t].link.node_id, r->instrument[t].peak_force_N,
               state_text(r->instrument[t].link.state));
    printf("%-26s %s%s%s\n", "state at the end", state_text(s.worst->state), s.worst->reason ? ", " : "",
           s.worst->reason ? status_name(s.worst->reason) : "");
    printf("%-26s %llu (%llu lost here, %llu malformed, %llu sets incomplete)\n", "frames heard",
           (unsigned long long)c->received, (unsigned long long)c->dropped, (unsigned long long)s.malformed,
           (unsigned long long)s.incomplete);
    printf("%-26s %s (%llu frames, %llu ticks without)\n", "SHA-256 of torque log", sha256,
           (unsigned long long)s.torques, (unsigned long long)r->unanswered);
}

static void integer(struct json_object *o, const char *key, uint64_t value)
{
    json_object_object_add(o, key, json_object_new_int64((int64_t)value));
}

/* State and reason of an instrument, or of the worst. */
static void state(struct json_object *o, const struct link *link)
{
    json_object_object_add(o, "state", json_object_new_string(state_text(link->state)));
    json_object_object_add(o, "reason", link->reason ? json_object_new_string(status_name(link->reason)) : NULL);
}

static struct json_object *instrument_json(const struct remote_instrument *i)
{
    struct json_object *o = json_object_new_object();
    integer(o, "node", i->link.node_id);
    integer(o, "missed", missed(i));
    json_object_object_add(o, "peak_force_N", json_object_new_double(i->peak_force_N));
    state(o, &i->link);
    json_object_object_add(o, "ran", json_object_new_boolean(i->ran));
    integer(o, "torque_frames", i->torques);
    return o;
}

static int print_json(const struct remote *r, const struct backend_counters *c, const char *sha256, struct failure *why)
{
    const struct sum s = sum_up(r);
    struct json_object *o = json_object_new_object(), *list = json_object_new_array();
    if (!o || !list)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the report");
    json_object_object_add(o, "bus", json_object_new_string(r->options.bus));
    integer(o, "ticks", r->ticks);
    integer(o, "missed", s.missed);
    json_object_object_add(o, "peak_force_N", json_object_new_double(s.peak_force_N));
    state(o, s.worst);
    json_object_object_add(o, "ran", json_object_new_boolean(s.ran));
    json_object_object_add(o, "seconds", json_object_new_double(seconds(r)));
    integer(o, "frames", c->received);
    integer(o, "frames_lost", c->dropped);
    integer(o, "frames_malformed", s.malformed);
    integer(o, "sets_incomplete", s.incomplete);
    integer(o, "torque_frames", s.torques);
    integer(o, "ticks_without_torque", r->unanswered);
    json_object_object_add(o, "torque_log_sha256", json_object_new_string(sha256));
    for (uint32_t t = 0; t < r->instruments; t++)
        json_object_array_add(list, instrument_json(&r->instrument[t]));
    json_object_object_add(o, "instruments", list);
    puts(json_object_to_json_string_ext(o, JSON_C_TO_STRING_SPACED));
    json_object_put(o);
    return STATUS_OK;
}

static int judge(const struct remote *r, struct failure *why)
{
    const struct link *worst = sum_up(r).worst;
    if (worst->state == SAFETY_SAFE && !r->stopped)
        return failure_set(why, STATUS_LOOP_SAFE, NULL, status_remedy(worst->reason),
                           "the controller ended in SAFE: %s [%s]", status_meaning(worst->reason),
                           status_name(worst->reason));
    return STATUS_OK;
}

int run_remote(const struct remote_options *options, bool json, struct failure *why)
{
    struct remote r;
    char sha256[65] = "";
    int status = remote_open(&r, options, why), result = 1;
    while (!status && result == 1)
        result = remote_step(&r, 100000, cli_warn, why);
    if (status) {
        remote_free(&r);
        return status;
    }
    const struct backend_counters counters = *backend_counters(r.backend);
    if (result < 0) {
        remote_free(&r);
        return result;
    }
    status = remote_finish(&r, sha256, why);
    if (!status && json)
        status = print_json(&r, &counters, sha256, why);
    else if (!status)
        print_table(&r, &counters, sha256);
    remote_free(&r);
    return status ? status : judge(&r, why);
}
