#include "run_report.h"

#include <json-c/json.h>

static const char *const state_name[] = {"INIT", "READY", "RUN", "SAFE"};

static const char *state_of(const struct session_result *r)
{
    return r->final_state < 4 ? state_name[r->final_state] : "?";
}

void run_report_table(FILE *out, const struct session_result *r)
{
    const struct safety *s = &r->safety;
    fprintf(out, "%-26s %llu (%.2f s in %.2f s)\n", "ticks", (unsigned long long)r->ticks, 1e-3 * (double)r->ticks,
            r->seconds);
    fprintf(out, "%-26s %llu\n", "missed ticks", (unsigned long long)r->missed);
    fprintf(out, "%-26s %llu, at most %u points, deepest %.1f mm\n", "ticks in contact",
            (unsigned long long)r->contact_ticks, r->max_contacts, 1e3 * r->max_depth_m);
    fprintf(out, "%-26s %.3f N (contact system %.3f N)\n", "peak force", r->peak_force_N, r->peak_contact_force_N);
    for (uint32_t t = 0; t < r->instruments && r->instruments > 1; t++) {
        const struct session_instrument *i = &r->instrument[t];
        char label[40];
        snprintf(label, sizeof label, "  %.20s", *i->name ? i->name : t ? "second" : "first");
        fprintf(out, "%-26s %.3f N, in contact for %llu ticks, at most %u points, deepest %.1f mm\n", label,
                i->peak_force_N, (unsigned long long)i->contact_ticks, i->max_contacts, 1e3 * i->max_depth_m);
        if (r->fem_known)
            fprintf(out, "%-26s %.3f N of it because of the other, error against full FE %.2g\n", "", i->from_other_N,
                    i->force_error_vs_fem);
    }
    if (r->fem_known)
        fprintf(out, "%-26s %.2g of %.3f N, over %u ticks (%s)\n", "error against full FE", r->force_error_vs_fem,
                r->peak_fem_force_N, r->fem_compared, r->fem_reference);
    else
        fprintf(out, "%-26s not known: %s\n", "error against full FE", r->fem_reason);
    if (r->correction_N > 0)
        fprintf(out, "%-26s %.3f N at most, %u ticks beyond its range\n", "correction of linear force", r->correction_N,
                r->beyond_range);
    fprintf(out, "%-26s %s%s%s\n", "state at the end", state_of(r), r->reason ? ", " : "",
            r->reason ? status_name(r->reason) : "");
    fprintf(out, "%-26s %u clamped, %u rate-limited, %u braked for passivity\n", "force limited in ticks", r->clamps,
            r->rate_limits, r->passivity_interventions);
    fprintf(out, "%-26s %u duplicate, %u out of order, %u implausible, %u overruns\n", "samples refused", s->duplicates,
            s->out_of_sequence, s->implausible, s->overruns);
    fprintf(out, "%-26s %u walks, %u solves (of at most %u factorisations)\n", "cut at their bound", r->walks_cut,
            r->solver_cuts, r->max_factors);
    fprintf(out, "%-26s %.0f %%, %llu frames (%llu dropped, %llu corrupted)\n", "bus load", 100 * r->bus_load,
            (unsigned long long)r->bus.frames, (unsigned long long)r->bus.dropped,
            (unsigned long long)r->bus.corrupted);
    fprintf(out, "%-26s %s (%llu frames)\n", "SHA-256 of torque log", r->torque_log_sha256,
            (unsigned long long)r->torque_frames);
}

static void integer(struct json_object *o, const char *key, uint64_t value)
{
    json_object_object_add(o, key, json_object_new_int64((int64_t)value));
}

static void real(struct json_object *o, const char *key, double value)
{
    json_object_object_add(o, key, json_object_new_double(value));
}

static void text(struct json_object *o, const char *key, const char *value)
{
    json_object_object_add(o, key, json_object_new_string(value));
}

static struct json_object *instrument(const struct session_result *r, const struct session_instrument *i)
{
    struct json_object *o = json_object_new_object();
    text(o, "name", i->name);
    real(o, "peak_force_N", i->peak_force_N);
    real(o, "peak_contact_force_N", i->peak_contact_force_N);
    if (r->fem_known) {
        real(o, "force_error_vs_fem", i->force_error_vs_fem);
        real(o, "peak_fem_force_N", i->peak_fem_force_N);
        real(o, "from_other_N", i->from_other_N);
    }
    integer(o, "contact_ticks", i->contact_ticks);
    integer(o, "max_contacts", i->max_contacts);
    real(o, "max_depth_m", i->max_depth_m);
    text(o, "state", state_name[i->safety.state & 3]);
    text(o, "reason", i->safety.reason ? status_name(i->safety.reason) : "");
    integer(o, "missed", i->safety.missed);
    integer(o, "clamps", i->clamps);
    integer(o, "rate_limits", i->rate_limits);
    integer(o, "passivity_interventions", i->passivity_interventions);
    return o;
}

static void fill(struct json_object *o, const struct session_result *r)
{
    const struct safety *s = &r->safety;
    integer(o, "ticks", r->ticks);
    integer(o, "missed", r->missed);
    real(o, "peak_force_N", r->peak_force_N);
    if (r->fem_known) {
        real(o, "force_error_vs_fem", r->force_error_vs_fem);
        text(o, "fem_reference", r->fem_reference);
    } else {
        json_object_object_add(o, "force_error_vs_fem", NULL);
        text(o, "fem_reason", r->fem_reason);
    }
    text(o, "torque_log_sha256", r->torque_log_sha256);
    integer(o, "torque_frames", r->torque_frames);
    real(o, "peak_contact_force_N", r->peak_contact_force_N);
    real(o, "peak_fem_force_N", r->peak_fem_force_N);
    integer(o, "fem_compared", r->fem_compared);
    real(o, "correction_N", r->correction_N);
    integer(o, "beyond_range", r->beyond_range);
    integer(o, "contact_ticks", r->contact_ticks);
    integer(o, "max_contacts", r->max_contacts);
    integer(o, "max_factors", r->max_factors);
    real(o, "max_depth_m", r->max_depth_m);
    text(o, "state", state_of(r));
    text(o, "reason", r->reason ? status_name(r->reason) : "");
    integer(o, "late_ticks", r->late_ticks);
    integer(o, "safe_entries", s->safe_entries);
    integer(o, "implausible", s->implausible);
    integer(o, "out_of_sequence", s->out_of_sequence);
    integer(o, "duplicates", s->duplicates);
    integer(o, "overruns", s->overruns);
    integer(o, "nonfinite", s->nonfinite);
    integer(o, "clamps", r->clamps);
    integer(o, "rate_limits", r->rate_limits);
    integer(o, "passivity_interventions", r->passivity_interventions);
    integer(o, "walks_cut", r->walks_cut);
    integer(o, "solver_cuts", r->solver_cuts);
    integer(o, "frames_malformed", r->frames_malformed);
    integer(o, "queue_overflows", r->queue_overflows);
    integer(o, "device_rejected", r->device_rejected);
    integer(o, "device_late", r->device_late);
    integer(o, "device_silences", r->device_silences);
    integer(o, "link_malformed", r->link_malformed);
    integer(o, "link_incomplete", r->link_incomplete);
    real(o, "bus_load", r->bus_load);
    integer(o, "bus_frames", r->bus.frames);
    integer(o, "bus_dropped", r->bus.dropped);
    integer(o, "bus_duplicated", r->bus.duplicated);
    integer(o, "bus_delayed", r->bus.delayed);
    integer(o, "bus_corrupted", r->bus.corrupted);
    integer(o, "bus_reordered", r->bus.reordered);
    integer(o, "bus_overflowed", r->bus.overflowed);
    real(o, "seconds", r->seconds);
    struct json_object *list = json_object_new_array();
    for (uint32_t t = 0; t < r->instruments; t++)
        json_object_array_add(list, instrument(r, &r->instrument[t]));
    json_object_object_add(o, "instruments", list);
}

int run_report_json(FILE *out, const struct session_result *result, struct failure *why)
{
    struct json_object *o = json_object_new_object();
    if (!o)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the report");
    fill(o, result);
    const char *line = json_object_to_json_string_ext(o, JSON_C_TO_STRING_PLAIN);
    if (line)
        fprintf(out, "%s\n", line);
    json_object_put(o);
    return line ? STATUS_OK : failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the report");
}
