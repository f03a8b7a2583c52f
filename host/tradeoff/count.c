#include "count.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "ports/lockstep.h"
#include "progress.h"
#include "session.h"

struct process {
    pid_t id;
    FILE *to, *from;
};

static bool on_path(const char *name)
{
    char file[PATH_MAX], *rest = NULL, *all = strdup(getenv("PATH") ? getenv("PATH") : "");
    bool found = false;
    for (char *folder = all ? strtok_r(all, ":", &rest) : NULL; folder && !found; folder = strtok_r(NULL, ":", &rest))
        found = snprintf(file, sizeof file, "%s/%s", folder, name) < (int)sizeof file && access(file, X_OK) == 0;
    free(all);
    return found;
}

/* The image of the native port: the base, or that with every effect for a bank that names one. */
static bool beside_this_program(bool effects, char *path, size_t room)
{
    char own[PATH_MAX - 64];
    ssize_t length = readlink("/proc/self/exe", own, sizeof own - 1);
    if (length <= 0)
        return false;
    own[length] = 0;
    char *slash = strrchr(own, '/');
    if (slash)
        *slash = 0;
    return snprintf(path, room, "%s/firmware/native/%scontroller.elf", own, effects ? "all/" : "") < (int)room &&
           access(path, X_OK) == 0;
}

static bool start(struct process *p, const char *controller, const char *bank_path, const char *out_option)
{
    int down[2], up[2];
    if (pipe2(down, O_CLOEXEC) != 0)
        return false;
    if (pipe2(up, O_CLOEXEC) != 0) {
        close(down[0]);
        close(down[1]);
        return false;
    }
    p->id = fork();
    if (p->id == 0) {
        int quiet = open("/dev/null", O_WRONLY);
        dup2(down[0], 0);
        dup2(up[1], 1);
        dup2(quiet, 2);
        execlp("valgrind", "valgrind", "--tool=callgrind", "--vgdb=no", "--collect-atstart=no", "--toggle-collect=tick",
               "--dump-after=tick", "--combine-dumps=yes", "--dump-line=no", out_option, controller, bank_path,
               (char *)NULL);
        _exit(127);
    }
    close(down[0]);
    close(up[1]);
    p->to = p->id > 0 ? fdopen(down[1], "wb") : NULL;
    p->from = p->id > 0 ? fdopen(up[0], "rb") : NULL;
    if (!p->to)
        close(down[1]);
    if (!p->from)
        close(up[0]);
    return p->id > 0 && p->to && p->from;
}

/* The exit code, or -1 for any other end. */
static int finish(struct process *p, bool kill_it)
{
    int end = -1;
    if (p->to)
        fclose(p->to);
    if (p->from)
        fclose(p->from);
    if (p->id <= 0)
        return -1;
    if (kill_it)
        kill(p->id, SIGKILL);
    while (waitpid(p->id, &end, 0) < 0 && errno == EINTR)
        ;
    return WIFEXITED(end) ? WEXITSTATUS(end) : -1;
}

/* The controller's bus and clock, from the recording. False when the other side has gone. */
static bool play(struct process *p, const struct recording *recording)
{
    size_t next = 0;
    uint64_t end_us = recording->ticks * (uint64_t)SESSION_TICK_US;
    struct lockstep_record r;
    while (fread(&r, sizeof r, 1, p->from) == 1) {
        if (interrupted())
            return false;
        if (r.kind != LOCKSTEP_TIME)
            continue;
        if (r.u.time_us >= end_us)
            return true;
        for (; next < recording->frames && recording->time_us[next] <= r.u.time_us; next++) {
            const struct can_frame_t *f = &recording->frame[next];
            const struct lockstep_record s = lockstep_send(f);
            if (fwrite(&s, sizeof s, 1, p->to) != 1)
                return false;
        }
        if (fwrite(&r, sizeof r, 1, p->to) != 1 || fflush(p->to) != 0)
            return false;
    }
    return false;
}

/* Callgrind's file: one part per tick, each closed by a line "totals: N" or "summary: N". */
static bool read_sums(const char *path, const struct recording *recording, const uint8_t *contacts, struct count *count)
{
    FILE *file = fopen(path, "r");
    char line[512];
    size_t tick = 0, touching = 0;
    double sum = 0;
    if (!file)
        return false;
    while (fgets(line, sizeof line, file)) {
        double total;
        if (sscanf(line, "totals: %lf", &total) != 1)
            continue;
        if (tick < recording->ticks && contacts[tick]) {
            touching++;
            sum += total;
            count->max = fmax(count->max, total);
        }
        tick++;
    }
    fclose(file);
    count->mean = touching ? sum / (double)touching : 0;
    /* the part behind the last tick may be there or not */
    return touching > 0 && sum > 0 && tick + 1 >= recording->ticks;
}

static int unknown(struct count *count, const char *reason)
{
    *count = (struct count){0};
    snprintf(count->reason, sizeof count->reason, "%s", reason);
    return STATUS_OK;
}

int count_instructions(const char *bank_path, bool effects, const struct recording *recording, const uint8_t *contacts,
                       const char *controller, const char *folder, struct count *count, struct failure *why)
{
    char beside[PATH_MAX], file[PATH_MAX], option[PATH_MAX + 32];
    *count = (struct count){0};
    if (!on_path("valgrind"))
        return unknown(count, "valgrind is not installed");
    if (!controller && !beside_this_program(effects, beside, sizeof beside))
        return unknown(count, "the native controller's image is not beside this program; run make");
    snprintf(file, sizeof file, "%s/callgrind.out", folder);
    snprintf(option, sizeof option, "--callgrind-out-file=%s", file);
    struct sigaction ignore = {.sa_handler = SIG_IGN}, before;
    sigaction(SIGPIPE, &ignore, &before);
    struct process p = {0};
    bool good = start(&p, controller ? controller : beside, bank_path, option) && play(&p, recording);
    int code = finish(&p, !good);
    sigaction(SIGPIPE, &before, NULL);
    good = good && code == 0 && read_sums(file, recording, contacts, count);
    unlink(file);
    if (interrupted())
        return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while counting instructions");
    if (!good)
        return unknown(count, "the controller did not run to its end under valgrind");
    count->known = true;
    return STATUS_OK;
}
