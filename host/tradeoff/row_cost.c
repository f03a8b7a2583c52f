#include "row_cost.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The gesture as a file, since a session reads it from one. */
static int write_stroke(char *path, size_t room, struct failure *why)
{
    const double seconds = 15.0 / 8 * ROW_COST_STROKE_m / ROW_COST_SPEED_m_s;
    const char *folder = getenv("TMPDIR");
    char text[200];
    int length = snprintf(text, sizeof text,
                          "approach 0.3 s\npress 10 mm in 0.3 s\nslide %g mm 0 mm in %.4f s\nslide -%g mm 0 mm in %.4f "
                          "s\nrepeat 1\n",
                          1e3 * ROW_COST_STROKE_m, seconds, 1e3 * ROW_COST_STROKE_m, seconds);
    snprintf(path, room, "%.150s/trocar-stroke-XXXXXX", folder && *folder ? folder : "/tmp");
    int file = mkstemp(path);
    bool good = file >= 0 && write(file, text, (size_t)length) == length;
    if (file >= 0)
        close(file);
    return good ? STATUS_OK : failure_set(why, STATUS_FILE_WRITE, path, "set TMPDIR", "cannot write a gesture");
}

static int compare(const struct bank_file *bank, const struct recording *recording, struct row_cost *cost,
                   struct failure *why)
{
    struct bank_view own = bank->view, standard = bank->view;
    struct bank_contact contact = *bank->view.contact;
    struct replay with = {0}, without = {0};
    contact.row_work = 0;
    standard.contact = &contact;
    int status = replay_run(&own, recording, 1, &with, why);
    if (!status)
        status = replay_run(&standard, recording, 1, &without, why);
    if (!status)
        status = replay_compare(&with, &without, TICK_RATE_HZ, &cost->error, why);
    cost->waits = with.waits;
    cost->default_waits = without.waits;
    cost->ticks = (double)recording->ticks;
    cost->known = !status;
    replay_free(&with);
    replay_free(&without);
    return status;
}

int row_cost_measure(const char *bank_path, struct row_cost *cost, struct failure *why)
{
    struct bank_file bank;
    struct recording recording = {0};
    char path[200];
    *cost = (struct row_cost){0};
    int status = bank_load(bank_path, &bank, why);
    if (status)
        return status;
    status = write_stroke(path, sizeof path, why);
    if (!status)
        status = recording_make(&bank, path, &recording, why);
    unlink(path);
    if (!status)
        status = compare(&bank, &recording, cost, why);
    recording_free(&recording);
    bank_unload(&bank);
    if (status == STATUS_LOOP_SAFE) {
        snprintf(cost->reason, sizeof cost->reason, "a stroke of %g mm at %g m/s cannot be made on this body",
                 1e3 * ROW_COST_STROKE_m, ROW_COST_SPEED_m_s);
        status = STATUS_OK;
    }
    return status;
}
