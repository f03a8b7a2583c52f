#include <json-c/json.h>
#include <math.h>
#include <stdlib.h>

#include "report.h"

static void text(struct json_object *to, const char *key, const char *value)
{
    json_object_object_add(to, key, json_object_new_string(value));
}

/* Numbers have at most ten digits by construction, and are written so. */
static struct json_object *number_object(double value)
{
    char digits[40];
    if (!isfinite(value))
        return NULL; /* null */
    if (value == floor(value) && fabs(value) < 1e15)
        return json_object_new_int64((int64_t)value);
    snprintf(digits, sizeof digits, "%.10g", value);
    return json_object_new_double_s(value, digits);
}

static void number(struct json_object *to, const char *key, double value)
{
    json_object_object_add(to, key, number_object(value));
}

static struct json_object *point(const struct tradeoff_point *p)
{
    struct json_object *o = json_object_new_object(), *knobs = json_object_new_object();
    text(o, "name", p->name);
    for (int k = 0; k < KNOBS; k++)
        number(knobs, knob_table[k].name, p->setting.value[k]);
    json_object_object_add(o, "knobs", knobs);
    number(o, "surface_nodes", p->surface_nodes);
    number(o, "bytes", p->bytes);
    number(o, "bytes_per_surface_node", p->bytes_per_node);
    struct json_object *sections = json_object_new_object(), *bank = json_object_new_object();
    for (size_t k = 0; k < p->sections; k++)
        number(sections, p->section[k].tag, p->section[k].bytes);
    json_object_object_add(o, "section_bytes", sections);
    for (int k = 0; k < COMPRESSION_ERROR_KINDS; k++) {
        struct json_object *kind = json_object_new_object();
        number(kind, "p95", p->bank[k].p95);
        number(kind, "max", p->bank[k].max);
        json_object_object_add(bank, compression_error_kind[k], kind);
    }
    json_object_object_add(o, "bank_error", bank);
    struct json_object *ticks = json_object_new_object();
    number(ticks, "p95", p->tick_p95);
    number(ticks, "max", p->tick_max);
    json_object_object_add(o, "tick_error", ticks);
    struct json_object *solver = json_object_new_object();
    number(solver, "p95", p->solver_p95);
    number(solver, "max", p->solver_max);
    json_object_object_add(o, "solver_error", solver);
    struct json_object *mesh = json_object_new_object();
    static const char *const tool[MESH_ERROR_RADII] = {"tool", "wide_tool"};
    for (int k = 0; k < MESH_ERROR_RADII; k++) {
        struct json_object *under = json_object_new_object();
        number(under, "mean", p->mesh[k].mean);
        number(under, "max", p->mesh[k].max);
        json_object_object_add(mesh, tool[k], under);
    }
    json_object_object_add(o, "mesh_error", mesh);
    number(o, "worst_tick_instructions", p->worst_bound);
    number(o, "instructions_mean", p->instructions_mean);
    number(o, "instructions_max", p->instructions_max);
    number(o, "instructions_per_ms_mean", p->load_mean);
    number(o, "instructions_per_ms_max", p->load_max);
    number(o, "nanoseconds_mean", p->ns_mean);
    number(o, "nanoseconds_max", p->ns_max);
    number(o, "build_seconds", p->build_s);
    number(o, "store_seconds", p->store_s);
    number(o, "contacts_max", p->contacts);
    number(o, "factorisations_max", p->factors);
    number(o, "ticks_cut", p->cut);
    number(o, "contacts_waiting", p->waits);
    number(o, "state_bytes", p->state_bytes);
    json_object_object_add(o, "front_time", json_object_new_boolean(p->front_time));
    json_object_object_add(o, "front_bytes", json_object_new_boolean(p->front_bytes));
    return o;
}

static struct json_object *axis(const struct plot_axis *a)
{
    struct json_object *o = json_object_new_object(), *ticks = json_object_new_array();
    text(o, "label", a->label);
    for (size_t k = 0; k < a->ticks; k++)
        json_object_array_add(ticks, number_object(a->tick[k]));
    json_object_object_add(o, "ticks", ticks);
    return o;
}

static struct json_object *plots(const struct tradeoff *r)
{
    struct json_object *list = json_object_new_array();
    for (int k = 0; k < REPORT_PLOTS; k++) {
        struct plot plot;
        if (!report_plot(r, k, &plot))
            continue;
        struct json_object *o = json_object_new_object();
        text(o, "title", plot.title);
        json_object_object_add(o, "x", axis(&plot.x));
        json_object_object_add(o, "y", axis(&plot.y));
        json_object_array_add(list, o);
        free(plot.mark);
    }
    return list;
}

static struct json_object *advices(const struct tradeoff *r)
{
    struct json_object *list = json_object_new_array();
    for (size_t k = 0; k < r->advices; k++) {
        const struct tradeoff_advice *a = &r->advice[k];
        struct json_object *o = json_object_new_object();
        if (a->of == BUDGET_SCENE)
            text(o, "of", "the scene's budget");
        else
            number(o, a->of == BUDGET_BYTES ? "bytes" : "instructions_per_ms", a->limit);
        json_object_object_add(o, "point", a->pick < r->points ? json_object_new_int64((int64_t)a->pick) : NULL);
        text(o, "text", a->text);
        json_object_array_add(list, o);
    }
    return list;
}

int report_json(FILE *out, const struct tradeoff *r, struct failure *why)
{
    struct json_object *root = json_object_new_object();
    if (!root)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the report");
    text(root, "scene", r->scene);
    text(root, "mesh", r->mesh);
    text(root, "gesture", r->gesture);
    json_object_object_add(root, "quick", json_object_new_boolean(r->quick));
    number(root, "seconds", r->seconds);
    number(root, "ticks", r->ticks);
    number(root, "contact_ticks", r->contact_ticks);
    number(root, "contact_sets", r->trials);
    number(root, "seed", r->seed);
    text(root, "bank_error_reference", COMPRESSION_ERROR_REFERENCE);
    text(root, "tick_error_reference", TRADEOFF_TICK_REFERENCE);
    text(root, "solver_error_reference", TRADEOFF_SOLVER_REFERENCE);
    text(root, "mesh_error_reference", TRADEOFF_MESH_REFERENCE);
    number(root, "mesh_error_sites", r->sites);
    number(root, "tool_radius_m", r->tool_radius_m[0]);
    number(root, "wide_tool_radius_m", r->tool_radius_m[1]);
    struct json_object *budget = json_object_new_object();
    number(budget, "bytes", r->budget_bytes);
    number(budget, "instructions", r->budget_instructions);
    number(budget, "force_error", tradeoff_round(r->budget_force_error));
    json_object_object_add(root, "scene_budget", budget);
    json_object_object_add(root, "instructions_reason",
                           r->instructions_known ? NULL : json_object_new_string(r->instructions_reason));
    number(root, "left_out", r->left_out);
    json_object_object_add(root, "left_out_reason", r->left_out > 0 ? json_object_new_string(r->left_out_why) : NULL);
    struct json_object *points = json_object_new_array(), *notes = json_object_new_array();
    for (size_t i = 0; i < r->points; i++)
        json_object_array_add(points, point(&r->point[i]));
    json_object_object_add(root, "points", points);
    json_object_object_add(root, "plots", plots(r));
    json_object_object_add(root, "advice", advices(r));
    for (int k = 0; k < REPORT_NOTES; k++)
        json_object_array_add(notes, json_object_new_string(report_note[k]));
    json_object_object_add(root, "notes", notes);
    fprintf(out, "%s\n",
            json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED | JSON_C_TO_STRING_NOSLASHESCAPE));
    json_object_put(root);
    return STATUS_OK;
}
