#include "build_report.h"

#include <json-c/json.h>

#include "worst_tick.h"

static void number(struct json_object *into, const char *name, double value)
{
    json_object_object_add(into, name, json_object_new_double(value));
}

static void whole(struct json_object *into, const char *name, double value)
{
    json_object_object_add(into, name, json_object_new_int64((int64_t)value));
}

static void string(struct json_object *into, const char *name, const char *value)
{
    json_object_object_add(into, name, json_object_new_string(value));
}

static struct json_object *error_json(const struct build_result *r)
{
    struct json_object *error = json_object_new_object();
    string(error, "reference", COMPRESSION_ERROR_REFERENCE);
    number(error, "p95", r->force_error_p95);
    number(error, "max", r->force_error_max);
    for (int k = 0; k < COMPRESSION_ERROR_KINDS; k++) {
        struct json_object *kind = json_object_new_object();
        number(kind, "p95", r->error.of[k].p95);
        number(kind, "max", r->error.of[k].max);
        json_object_object_add(error, compression_error_kind[k], kind);
    }
    return error;
}

/* One limit; both numbers whole or not. */
static struct json_object *limit_json(double limit, double reached, bool is_whole)
{
    struct json_object *o = json_object_new_object();
    (is_whole ? whole : number)(o, "limit", limit);
    (is_whole ? whole : number)(o, "reached", reached);
    return o;
}

static struct json_object *limits_json(const struct build_report *b)
{
    const struct build_result *r = b->result;
    struct json_object *limits = json_object_new_object();
    if (b->max_bytes > 0) {
        struct json_object *o = limit_json(b->max_bytes, (double)r->bytes, true);
        if (r->default_bytes > 0) {
            whole(o, "bytes_without", r->default_bytes);
            number(o, "force_error_without", r->default_error);
        }
        json_object_object_add(limits, "bytes", o);
    }
    if (b->max_instructions > 0) {
        struct json_object *o = limit_json(b->max_instructions, r->instructions, true);
        if (b->cost->known) {
            number(o, "tick_error_p95", b->cost->error.p95);
            number(o, "tick_error_max", b->cost->error.max);
            whole(o, "waits", b->cost->waits);
            whole(o, "waits_without", b->cost->default_waits);
        } else if (*b->cost->reason)
            string(o, "tick_error_reason", b->cost->reason);
        json_object_object_add(limits, "instructions", o);
    }
    if (b->max_force_error > 0)
        json_object_object_add(limits, "force_error", limit_json(b->max_force_error, r->force_error_p95, false));
    return limits;
}

void build_report_json(FILE *out, const struct build_report *b)
{
    const struct build_result *r = b->result;
    struct json_object *root = json_object_new_object();
    string(root, "bank", b->path);
    whole(root, "nodes", (double)r->nodes);
    whole(root, "elements", (double)r->elements);
    whole(root, "surface_nodes", (double)r->surface_nodes);
    whole(root, "free_surface_nodes", (double)r->rows);
    whole(root, "unknowns", (double)r->unknowns);
    whole(root, "bytes", (double)r->bytes);
    number(root, "seconds", r->seconds);
    whole(root, "peak_rss_bytes", r->peak_rss_bytes);
    number(root, "median_compliance_m_N", r->median_compliance_m_N);
    string(root, "discretisation", r->discretisation);
    json_object_object_add(root, "force_error", error_json(r));
    if (r->step > 0)
        number(root, "step", r->step);
    whole(root, "worst_tick_instructions", r->instructions);
    if (r->row_work)
        whole(root, "row_work", (double)r->row_work * BANK_ROW_WORK_UNIT);
    json_object_object_add(root, "limits", limits_json(b));
    fprintf(out, "%s\n",
            json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED | JSON_C_TO_STRING_NOSLASHESCAPE));
    json_object_put(root);
}

void build_report_text(FILE *out, const struct build_report *b)
{
    const struct build_result *r = b->result;
    char measured[200];
    compression_error_print(&r->error, measured, sizeof measured);
    fprintf(out,
            "%s: %zu nodes, %zu tetrahedra (%s), %zu surface nodes (%zu free)\n"
            "%zu bytes, built in %.1f s with at most %.0f MB\n"
            "force error in %% (p95, max): %s; against the %s\n",
            b->path, r->nodes, r->elements, r->discretisation, r->surface_nodes, r->rows, r->bytes, r->seconds,
            1e-6 * r->peak_rss_bytes, measured, COMPRESSION_ERROR_REFERENCE);
    if (b->max_bytes > 0 && r->default_bytes > 0)
        fprintf(out, "limit of %.0f bytes: patch error %.3g %%; %.3g %% at %.0f bytes without it\n", b->max_bytes,
                100 * r->force_error_p95, 100 * r->default_error, r->default_bytes);
    else if (b->max_bytes > 0)
        fprintf(out, "limit of %.0f bytes: kept%s\n", b->max_bytes, r->step > 0 ? "" : ", not compressed");
    if (b->max_force_error > 0)
        fprintf(out, "limit of %.3g %% force error: %.3g %% (p95 of patches)\n", 100 * b->max_force_error,
                100 * r->force_error_p95);
    if (!(b->max_instructions > 0))
        return;
    fprintf(out, "limit of %.0f instructions: the worst tick takes at most %.0f", b->max_instructions, r->instructions);
    if (b->cost->known)
        fprintf(out,
                ", %u thousand units of row work; along a stroke at %g m/s that changes the force by %.2g %% (p95), "
                "%.2g %% (max)",
                r->row_work, ROW_COST_SPEED_m_s, 100 * b->cost->error.p95, 100 * b->cost->error.max);
    else if (*b->cost->reason)
        fprintf(out, "; what that costs is not known: %s", b->cost->reason);
    fputc('\n', out);
}
