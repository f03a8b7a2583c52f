#include "progress.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

static volatile sig_atomic_t interrupt_seen;

static void on_interrupt(int number)
{
    (void)number;
    interrupt_seen = 1;
}

void interrupt_install(void)
{
    struct sigaction action = {.sa_handler = on_interrupt, .sa_flags = (int)SA_RESETHAND};
    sigemptyset(&action.sa_mask); /* reset: a second Ctrl-C ends a step that does not poll */
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

bool interrupted(void)
{
    return interrupt_seen != 0;
}

double seconds_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void progress_start(struct progress *bar, const char *what, bool quiet)
{
    *bar = (struct progress){.what = what, .started_s = seconds_now(), .shown_fraction = -1, .quiet = quiet};
    bar->terminal = isatty(STDERR_FILENO) == 1;
    progress_show(bar, 0);
}

void progress_show(struct progress *bar, double fraction)
{
    double step = bar->terminal ? 0.01 : 0.1;
    if (bar->quiet || (fraction < bar->shown_fraction + step && fraction < 1) || fraction <= bar->shown_fraction)
        return;
    bar->shown_fraction = fraction;
    double elapsed_s = seconds_now() - bar->started_s;
    double left_s = fraction > 0 ? elapsed_s * (1 - fraction) / fraction : 0;
    if (!bar->terminal) {
        fprintf(stderr, "%s: %3.0f %%, %.1f s, %.0f s left\n", bar->what, 100 * fraction, elapsed_s, left_s);
        return;
    }
    int filled = (int)(30 * fraction);
    fprintf(stderr, "\r%-24s [%.*s%*s] %3.0f %%  %5.1f s, %4.0f s left", bar->what, filled,
            "##############################", 30 - filled, "", 100 * fraction, elapsed_s, left_s);
}

void progress_end(struct progress *bar)
{
    if (bar->quiet)
        return;
    if (!interrupted())
        progress_show(bar, 1);
    if (bar->terminal)
        fputc('\n', stderr);
}

int file_replace(const char *path, const void *bytes, size_t length, struct failure *why)
{
    size_t room = strlen(path) + 32;
    char *temporary = malloc(room);
    if (!temporary)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory to write the file");
    snprintf(temporary, room, "%s.%ld.tmp", path, (long)getpid());
    int file = open(temporary, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (file < 0) {
        int code = errno;
        free(temporary);
        return failure_set(why, STATUS_FILE_WRITE, path, NULL, "cannot create the file: %s", strerror(code));
    }
    const char *p = bytes;
    size_t left = length;
    bool good = true;
    while (left > 0 && good && !interrupted()) {
        ssize_t n = write(file, p, left > (1u << 24) ? (1u << 24) : left);
        if (n < 0 && errno == EINTR)
            continue;
        good = n > 0;
        if (good) {
            p += n;
            left -= (size_t)n;
        }
    }
    int code = errno;
    bool stopped = left > 0 && good;
    if (good && !stopped && fsync(file) < 0 && errno != EINVAL && errno != EROFS) {
        good = false;
        code = errno;
    }
    if (close(file) < 0 && good) {
        good = false;
        code = errno;
    }
    if (good && !stopped && rename(temporary, path) < 0) {
        good = false;
        code = errno;
    }
    int status = STATUS_OK;
    if (stopped)
        status = failure_set(why, STATUS_INTERRUPTED, path, NULL, "interrupted while writing");
    else if (!good)
        status = failure_set(why, STATUS_FILE_WRITE, path, NULL, "cannot write the file: %s", strerror(code));
    if (status)
        unlink(temporary);
    free(temporary);
    return status;
}

int file_load(const char *path, unsigned char **bytes, size_t *length, struct failure *why)
{
    *bytes = NULL;
    *length = 0;
    FILE *file = fopen(path, "rb");
    if (!file)
        return failure_set(why, STATUS_FILE_OPEN, path, NULL, "cannot open the file: %s", strerror(errno));
    struct stat info;
    if (fstat(fileno(file), &info) == 0 && S_ISDIR(info.st_mode)) {
        fclose(file);
        return failure_set(why, STATUS_FILE_OPEN, path, "name a file", "this is a directory");
    }
    size_t room = 1 << 16, used = 0;
    unsigned char *buffer = malloc(room + 1);
    while (buffer) {
        used += fread(buffer + used, 1, room - used, file);
        if (used < room)
            break;
        unsigned char *larger = realloc(buffer, 2 * room + 1);
        if (!larger) {
            free(buffer);
            buffer = NULL;
            break;
        }
        room *= 2;
        buffer = larger;
    }
    bool bad = ferror(file) != 0;
    fclose(file);
    if (!buffer)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory to read the file");
    if (bad) {
        free(buffer);
        return failure_set(why, STATUS_FILE_READ, path, NULL, "reading failed after %zu bytes", used);
    }
    buffer[used] = 0;
    *bytes = buffer;
    *length = used;
    return STATUS_OK;
}
