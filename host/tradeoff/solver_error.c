#include "solver_error.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "progress.h"

enum {
    AS_LONG_AS_IT_TAKES = 10000
}; /* sweeps: a force that then moves does so by less than the solver's own tolerance */

/* The bank with the bounds of its solvers taken away: what they depend on is read through the view. */
struct unbounded {
    struct bank_view view;
    struct bank_contact contact;
    struct bank_friction friction;
    struct bank_grasp grasp;
};

static void unbind(struct unbounded *u, const struct bank_view *bank)
{
    u->view = *bank;
    u->contact = *bank->contact;
    u->contact.solver_steps = BANK_MAX_SOLVER_STEPS; /* more than the active-set method takes */
    u->view.contact = &u->contact;
    if (bank->friction) {
        u->friction = *bank->friction;
        u->friction.sweeps = AS_LONG_AS_IT_TAKES;
        u->view.friction = &u->friction;
    }
    if (bank->grasp) {
        u->grasp = *bank->grasp;
        u->grasp.sweeps = AS_LONG_AS_IT_TAKES;
        u->view.grasp = &u->grasp;
    }
}

/* Two controllers in one place in memory, their state and their rows, which hold each other's addresses. */
struct state {
    struct controller controller;
    size_t bytes;
    unsigned char rows[];
};

static double distance(const float a[3], const float b[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += ((double)a[k] - (double)b[k]) * ((double)a[k] - (double)b[k]);
    return sqrt(sum);
}

static bool measure(const struct bank_view *bank, const struct recording *recording, struct state *now,
                    struct state *before, double *found, struct tick_error *error)
{
    static const float zero[3];
    struct unbounded rest;
    struct tick_output out[TICK_INSTRUMENTS];
    double peak = 0;
    size_t count = 0, size = sizeof *now + now->bytes;
    unbind(&rest, bank);
    if (controller_start(&now->controller, bank, now->rows, now->bytes) != STATUS_OK)
        return false;
    for (size_t t = 0; t < recording->ticks; t++) {
        float f[3];
        memcpy(before, now, size);
        tick(&now->controller, &rest.view, recording->input[t], out);
        memcpy(f, now->controller.contact.force_N[0], sizeof f);
        memcpy(now, before, size);
        tick(&now->controller, bank, recording->input[t], out);
        if (now->controller.contact.count == 0)
            continue;
        found[count++] = distance(now->controller.contact.force_N[0], f);
        peak = fmax(peak, distance(f, zero));
    }
    *error = tick_error_of(found, count, peak);
    return true;
}

int solver_error_measure(const struct bank_view *bank, const struct recording *recording, struct tick_error *error,
                         struct failure *why)
{
    size_t bytes = row_cache_memory(bank);
    struct state *now = calloc(1, sizeof *now + bytes), *before = malloc(sizeof *before + bytes);
    double *found = malloc((recording->ticks + 1) * sizeof *found);
    int status = STATUS_OK;
    *error = (struct tick_error){0};
    if (!now || !before || !found)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to replay the recording");
    if (!status) {
        now->bytes = bytes;
        if (!measure(bank, recording, now, before, found, error))
            status = failure_set(why, STATUS_BANK_MEMORY, NULL, NULL, "the controller does not start on the bank");
    }
    if (!status && interrupted())
        status = failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while replaying the recording");
    free(now);
    free(before);
    free(found);
    return status;
}
