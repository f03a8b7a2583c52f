#include "tradeoff.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "candidate.h"
#include "count.h"
#include "mesh_error.h"
#include "node.h"
#include "progress.h"
#include "recording.h"
#include "solver_error.h"

enum { QUICK_TRIALS = 60, FULL_TRIALS = 400, QUICK_RUNS = 3, FULL_RUNS = 9 };

/* Weights for the time left: what a step takes, in units of a replay, on the bodies that this is made for. */
static const double step_weight[] = {[STAGE_BODY] = 6, [STAGE_BANK] = 4, [STAGE_CONTROLLER] = 3};

struct bench {
    const struct tradeoff_options *options;
    struct tradeoff *result;
    struct scene scene; /* instruments placed once the first body was made */
    struct plan plan;
    char folder[200];
    struct progress bar;
    double done, total, started_s;
    struct discretisation body;
    bool body_open, bank_open, recorded, reference_open;
    struct candidate bank;
    struct recording recording;
    struct replay reference; /* of the body at hand */
    struct mesh_truth truth;
    struct mesh_error mesh_error[MESH_ERROR_RADII]; /* of the body at hand */
};

double tradeoff_round(double value)
{
    char text[40];
    if (!isfinite(value))
        return NAN;
    snprintf(text, sizeof text, "%.3e", value);
    return strtod(text, NULL);
}

static void step_done(struct bench *b, enum stage stage)
{
    b->done += step_weight[stage];
    progress_show(&b->bar, b->total > 0 ? fmin(b->done / b->total, 1) : 1);
}

static double plan_weight(const struct plan *plan)
{
    double sum = 0;
    for (size_t s = 0; s < plan->count; s++) {
        int from = s ? knob_differ(&plan->setting[s - 1], &plan->setting[s]) : STAGE_BODY;
        for (int stage = from; stage <= STAGE_CONTROLLER; stage++)
            sum += step_weight[stage];
    }
    return sum;
}

/* What the quick form measures: one short stroke. */
static const char stroke[] = "approach 0.06 s\npress 8 mm in 0.1 s\nslide 6 mm 0 mm in 0.1 s\n";

static int make_recording(struct bench *b, const struct candidate *plain, struct failure *why)
{
    char file[220];
    snprintf(file, sizeof file, "%s/stroke", b->folder);
    bool own = b->options->quick && !b->options->gesture;
    int status = own ? file_replace(file, stroke, strlen(stroke), why) : STATUS_OK;
    const char *gesture = own ? file : b->options->gesture ? b->options->gesture : "slide";
    if (!status)
        status = recording_make(&plain->bank, gesture, &b->recording, why);
    if (own)
        unlink(file);
    if (own && !status)
        snprintf(b->recording.gesture, sizeof b->recording.gesture, "stroke");
    b->recorded = !status;
    return status;
}

/* The force that everything else is compared with, on the plain bank of the body at hand; the first also makes the
 * recording. */
static int make_reference(struct bench *b, struct failure *why)
{
    struct setting reference = knob_reference(&b->plan.setting[0]);
    struct candidate plain;
    int status = candidate_make(&b->body, &reference, b->folder, 0, 0, true, &plain, why);
    if (status)
        return status;
    if (!b->recorded)
        status = make_recording(b, &plain, why);
    if (!status)
        status = replay_run(&plain.view, &b->recording, 1, &b->reference, why);
    b->reference_open = !status;
    candidate_free(&plain);
    return status;
}

/* The truth is that of the first body's mesh, which is the scene's. */
static int judge_mesh(struct bench *b, const struct setting *setting, struct failure *why)
{
    struct body *body = &b->body.body;
    for (int r = 0; r < MESH_ERROR_RADII; r++)
        b->mesh_error[r] = (struct mesh_error){NAN, NAN};
    const double radius_m[MESH_ERROR_RADII] = {b->scene.instrument[0].tip_radius_m, TRADEOFF_WIDE_TOOL_m};
    int status = STATUS_OK;
    if (b->truth.radius_m[0] == 0)
        status = mesh_truth_make(body, radius_m, b->options->seed, &b->truth, why);
    if (status == STATUS_MEMORY) { /* then it is not known */
        b->truth.sites = 0;
        return STATUS_OK;
    }
    bool is_the_truth = setting->value[KNOB_REFINE] == 1 && setting->value[KNOB_ORDER] == 2;
    return status || is_the_truth ? status : mesh_error_measure(&b->truth, body, b->mesh_error, why);
}

static int enter_body(struct bench *b, const struct setting *setting, struct failure *why)
{
    if (b->reference_open)
        replay_free(&b->reference);
    if (b->body_open)
        discretisation_free(&b->body);
    b->reference_open = b->body_open = false;
    int status = discretise(&b->scene, setting, true, &b->body, why);
    if (status)
        return status;
    b->body_open = true;
    if (!b->recorded) /* the first body places the instruments */
        b->scene = b->body.body.scene;
    status = judge_mesh(b, setting, why);
    if (!status)
        status = make_reference(b, why);
    step_done(b, STAGE_BODY);
    return status;
}

static int enter_bank(struct bench *b, const struct setting *setting, struct failure *why)
{
    if (b->bank_open)
        candidate_free(&b->bank);
    b->bank_open = false;
    size_t trials = b->options->quick ? QUICK_TRIALS : FULL_TRIALS;
    int status = candidate_make(&b->body, setting, b->folder, trials, b->options->seed, true, &b->bank, why);
    if (status)
        return status;
    b->bank_open = true;
    b->result->trials = (double)b->bank.error.trials;
    step_done(b, STAGE_BANK);
    return STATUS_OK;
}

static void describe_bank(const struct bench *b, struct tradeoff_point *p)
{
    const struct bank_view *v = &b->bank.view;
    p->surface_nodes = v->vertex_count;
    p->bytes = v->header->total_bytes;
    p->bytes_per_node = tradeoff_round(p->bytes / p->surface_nodes);
    p->build_s = tradeoff_round(b->body.seconds + b->bank.seconds);
    p->store_s = tradeoff_round(b->bank.seconds);
    p->sections = v->header->section_count;
    for (size_t k = 0; k < p->sections; k++) {
        for (int c = 0; c < 4; c++)
            p->section[k].tag[c] = (char)(v->sections[k].tag >> (8 * c));
        p->section[k].bytes = v->sections[k].length;
    }
    for (int k = 0; k < MESH_ERROR_RADII; k++) {
        p->mesh[k].mean = tradeoff_round(b->mesh_error[k].mean);
        p->mesh[k].max = tradeoff_round(b->mesh_error[k].max);
    }
    for (int k = 0; k < COMPRESSION_ERROR_KINDS; k++) {
        p->bank[k].p95 = tradeoff_round(b->bank.error.of[k].p95);
        p->bank[k].max = tradeoff_round(b->bank.error.of[k].max);
    }
}

/* The rate changes no tick: a count of the same controller serves. */
static bool counted_before(const struct tradeoff *r, const struct setting *setting, struct count *count)
{
    struct setting other = *setting;
    for (size_t i = 0; i < r->points; i++) {
        other.value[KNOB_RATE] = r->point[i].setting.value[KNOB_RATE];
        if (knob_differ(&other, &r->point[i].setting) <= STAGE_CONTROLLER || !isfinite(r->point[i].instructions_max))
            continue;
        *count =
            (struct count){.known = true, .mean = r->point[i].instructions_mean, .max = r->point[i].instructions_max};
        return true;
    }
    return false;
}

static int measure_ticks(struct bench *b, const struct setting *setting, struct tradeoff_point *p, struct failure *why)
{
    struct replay replay;
    struct tick_error error, solver;
    struct count count;
    int status = candidate_retool(&b->bank, &b->body.body, setting, why);
    if (status)
        return status;
    status = replay_run(&b->bank.view, &b->recording, b->options->quick ? QUICK_RUNS : FULL_RUNS, &replay, why);
    if (status)
        return status;
    status = replay_compare(&replay, &b->reference, (unsigned)setting->value[KNOB_RATE], &error, why);
    if (!status)
        status = solver_error_measure(&b->bank.view, &b->recording, &solver, why);
    if (!status && !counted_before(b->result, setting, &count))
        status = count_instructions(b->bank.path, b->bank.view.header->effects != 0, &b->recording, replay.contacts,
                                    b->options->controller, b->folder, &count, why);
    if (!status) {
        p->tick_p95 = tradeoff_round(error.p95);
        p->tick_max = tradeoff_round(error.max);
        p->solver_p95 = tradeoff_round(solver.p95);
        p->solver_max = tradeoff_round(solver.max);
        p->ns_mean = tradeoff_round(replay.ns_mean);
        p->ns_max = tradeoff_round(replay.ns_max);
        p->contacts = replay.contacts_max;
        p->factors = replay.factors_max;
        p->cut = replay.solver_cuts;
        p->waits = replay.waits;
        p->worst_bound = tradeoff_round(candidate_worst_tick(&b->bank, &b->body.body, setting));
        p->state_bytes = (double)(sizeof(struct node) + row_cache_memory(&b->bank.view));
        double per_ms = setting->value[KNOB_RATE] / 1000;
        p->instructions_mean = count.known ? tradeoff_round(count.mean) : NAN;
        p->instructions_max = count.known ? tradeoff_round(count.max) : NAN;
        p->load_mean = tradeoff_round(p->instructions_mean * per_ms);
        p->load_max = tradeoff_round(p->instructions_max * per_ms);
        b->result->instructions_known |= count.known;
        if (!count.known)
            snprintf(b->result->instructions_reason, sizeof b->result->instructions_reason, "%s", count.reason);
    }
    replay_free(&replay);
    return status;
}

/* What another setting may fail at, the others need not: too large for the format or for memory. */
static bool may_be_left_out(int status)
{
    return status == STATUS_MEMORY || status == STATUS_MESH_TOO_LARGE;
}

static void leave_out(struct bench *b, const char *name, const char *reason)
{
    if (b->result->left_out == 0)
        snprintf(b->result->left_out_why, sizeof b->result->left_out_why, "%s: %s", name, reason);
    b->result->left_out++;
}

static int measure_all(struct bench *b, struct failure *why)
{
    struct tradeoff *r = b->result;
    const struct setting *base = &b->plan.setting[0], *last = NULL;
    for (size_t s = 0; s < b->plan.count; s++) {
        const struct setting *setting = &b->plan.setting[s];
        struct tradeoff_point *p = &r->point[r->points];
        struct failure reason = {0};
        *p = (struct tradeoff_point){.setting = *setting};
        knob_name(setting, base, p->name, sizeof p->name);
        if (interrupted())
            return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted after %zu of %zu settings", s,
                               b->plan.count);
        if (s && b->options->limit_s > 0 && seconds_now() - b->started_s > b->options->limit_s) {
            leave_out(b, p->name, "the time limit was reached");
            continue;
        }
        int from = last ? knob_differ(last, setting) : STAGE_BODY, status = STATUS_OK;
        if (from == STAGE_BODY)
            status = enter_body(b, setting, &reason);
        if (!status && from <= STAGE_BANK)
            status = enter_bank(b, setting, &reason);
        last = status ? NULL : setting;
        if (!status) {
            describe_bank(b, p);
            status = measure_ticks(b, setting, p, &reason);
            step_done(b, STAGE_CONTROLLER);
        }
        if (status && s && may_be_left_out(status)) {
            leave_out(b, p->name, reason.cause);
            continue;
        }
        if (status) {
            *why = reason;
            return status;
        }
        r->points++;
    }
    return STATUS_OK;
}

static void describe(struct bench *b)
{
    struct tradeoff *r = b->result;
    const char *slash = strrchr(b->scene.mesh_path, '/');
    snprintf(r->scene, sizeof r->scene, "%s", b->scene.name);
    snprintf(r->mesh, sizeof r->mesh, "%.255s", slash ? slash + 1 : b->scene.mesh_path);
    snprintf(r->gesture, sizeof r->gesture, "%s", b->recording.gesture);
    r->quick = b->options->quick;
    r->ticks = (double)b->recording.ticks;
    for (size_t t = 0; t < b->reference.ticks; t++)
        r->contact_ticks += b->reference.contacts[t] > 0;
    r->seed = (double)b->options->seed;
    r->sites = (double)b->truth.sites;
    for (int k = 0; k < MESH_ERROR_RADII; k++)
        r->tool_radius_m[k] = tradeoff_round(b->truth.radius_m[k]);
    r->budget_bytes = b->scene.budget_bank_bytes;
    r->budget_instructions = b->scene.budget_instructions;
    r->budget_force_error = b->scene.budget_force_error;
    r->seconds = tradeoff_round(seconds_now() - b->started_s);
}

static int make_folder(struct bench *b, struct failure *why)
{
    const char *base = getenv("TMPDIR");
    snprintf(b->folder, sizeof b->folder, "%.150s/trocar-XXXXXX", base && *base ? base : "/tmp");
    if (!mkdtemp(b->folder)) {
        *b->folder = 0;
        return failure_set(why, STATUS_FILE_WRITE, base ? base : "/tmp", "set TMPDIR",
                           "cannot make a temporary folder");
    }
    return STATUS_OK;
}

int tradeoff_measure(const struct scene *scene, const struct tradeoff_options *options, struct tradeoff *result,
                     struct failure *why)
{
    *result = (struct tradeoff){0};
    struct bench *b = calloc(1, sizeof *b);
    if (!b)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the measurement");
    b->options = options;
    b->result = result;
    b->scene = *scene;
    b->started_s = seconds_now();
    struct setting base = knob_scene(scene);
    progress_start(&b->bar, "measuring", options->quiet);
    int status = make_folder(b, why);
    if (!status)
        status = plan_make(&base, options->quick, &b->plan, why);
    b->total = plan_weight(&b->plan);
    result->point = calloc(b->plan.count + 1, sizeof *result->point);
    if (!status && !result->point)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for %zu settings", b->plan.count);
    if (!status)
        status = measure_all(b, why);
    progress_end(&b->bar);
    if (!status) {
        describe(b);
        status = tradeoff_judge(result, why);
    }
    if (b->reference_open)
        replay_free(&b->reference);
    if (b->recorded)
        recording_free(&b->recording);
    if (b->bank_open)
        candidate_free(&b->bank);
    if (b->body_open)
        discretisation_free(&b->body);
    plan_free(&b->plan);
    if (*b->folder)
        rmdir(b->folder);
    free(b);
    if (status)
        tradeoff_free(result);
    return status;
}

void tradeoff_free(struct tradeoff *result)
{
    free(result->point);
    *result = (struct tradeoff){0};
}
