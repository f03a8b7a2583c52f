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

static uint64_t missed(const struct remote *r)
{
    return r->link.health[0]; /* link_health_name(0) is "missed" */
}

static double seconds(const struct remote *r)
{
    return 1e-6 * (double)(r->last_us - r->first_us);
}

static void print_table(const struct remote *r, const struct backend_counters *c, const char *sha256)
{
    printf("%-26s %llu in %.2f s\n", "ticks", (unsigned long long)r->ticks, seconds(r));
    printf("%-26s %llu\n", "missed ticks", (unsigned long long)missed(r));
    printf("%-26s %.3f N\n", "peak force", r->peak_force_N);
    printf("%-26s %s%s%s\n", "state at the end", state_text(r->link.state), r->link.reason ? ", " : "",
           r->link.reason ? status_name(r->link.reason) : "");
    printf("%-26s %llu (%llu lost here, %llu malformed, %llu sets incomplete)\n", "frames heard",
           (unsigned long long)c->received, (unsigned long long)c->dropped, (unsigned long long)r->link.malformed,
           (unsigned long long)r->link.incomplete_sets);
    printf("%-26s %s (%llu frames, %llu ticks without)\n", "SHA-256 of torque log", sha256,
           (unsigned long long)r->torques, (unsigned long long)r->unanswered);
}

static void integer(struct json_object *o, const char *key, uint64_t value)
{
    json_object_object_add(o, key, json_object_new_int64((int64_t)value));
}

static int print_json(const struct remote *r, const struct backend_counters *c, const char *sha256, struct failure *why)
{
    struct json_object *o = json_object_new_object();
    if (!o)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the report");
    json_object_object_add(o, "bus", json_object_new_string(r->options.bus));
    integer(o, "ticks", r->ticks);
    integer(o, "missed", missed(r));
    json_object_object_add(o, "peak_force_N", json_object_new_double(r->peak_force_N));
    json_object_object_add(o, "state", json_object_new_string(state_text(r->link.state)));
    json_object_object_add(o, "reason", r->link.reason ? json_object_new_string(status_name(r->link.reason)) : NULL);
    json_object_object_add(o, "ran", json_object_new_boolean(r->ran));
    json_object_object_add(o, "seconds", json_object_new_double(seconds(r)));
    integer(o, "frames", c->received);
    integer(o, "frames_lost", c->dropped);
    integer(o, "frames_malformed", r->link.malformed);
    integer(o, "sets_incomplete", r->link.incomplete_sets);
    integer(o, "torque_frames", r->torques);
    integer(o, "ticks_without_torque", r->unanswered);
    json_object_object_add(o, "torque_log_sha256", json_object_new_string(sha256));
    puts(json_object_to_json_string_ext(o, JSON_C_TO_STRING_SPACED));
    json_object_put(o);
    return STATUS_OK;
}

static int judge(const struct remote *r, struct failure *why)
{
    if (r->link.state == SAFETY_SAFE && !r->stopped)
        return failure_set(why, STATUS_LOOP_SAFE, NULL, status_remedy(r->link.reason),
                           "the controller ended in SAFE: %s [%s]", status_meaning(r->link.reason),
                           status_name(r->link.reason));
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
