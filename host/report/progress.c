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

static int write_failure(const struct file_writer *w, int code, struct failure *why)
{
    return failure_set(why, STATUS_FILE_WRITE, w->path, NULL, "cannot write the file: %s", strerror(code));
}

/* A file without a name in the folder of `path`, or -1. Its name is given through /proc, which must be there. */
static int open_nameless(const char *path)
{
    char *folder = strdup(path);
    if (!folder)
        return -1;
    char *slash = strrchr(folder, '/');
    if (slash)
        slash[slash == folder] = 0;
    int file = open(slash ? folder : ".", O_RDWR | O_TMPFILE | O_CLOEXEC, 0666);
    free(folder);
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    if (file >= 0 && access(link, F_OK) != 0) {
        close(file);
        return -1;
    }
    return file;
}

int file_begin(struct file_writer *w, const char *path, struct failure *why)
{
    *w = (struct file_writer){.descriptor = -1};
    struct stat info;
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode))
        return failure_set(why, STATUS_FILE_WRITE, path, "name a file",
                           S_ISDIR(info.st_mode) ? "this is a directory" : "this is not a regular file");
    w->path = strdup(path);
    w->temporary = malloc(strlen(path) + 32);
    if (!w->path || !w->temporary) {
        file_abandon(w);
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory to write the file");
    }
    sprintf(w->temporary, "%s.%ld.tmp", path, (long)getpid());
    w->descriptor = open_nameless(path);
    w->named = w->descriptor < 0;
    if (w->named)
        w->descriptor = open(w->temporary, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (w->descriptor < 0) {
        int code = errno;
        w->named = false;
        file_abandon(w);
        return failure_set(why, STATUS_FILE_WRITE, path, NULL, "cannot create the file: %s", strerror(code));
    }
    return STATUS_OK;
}

int file_patch(struct file_writer *w, size_t offset, const void *bytes, size_t length, struct failure *why)
{
    const char *p = bytes;
    for (size_t done = 0; done < length;) {
        if (interrupted())
            return failure_set(why, STATUS_INTERRUPTED, w->path, NULL, "interrupted while writing");
        size_t piece = length - done > (1u << 24) ? 1u << 24 : length - done;
        ssize_t n = pwrite(w->descriptor, p + done, piece, (off_t)(offset + done));
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return write_failure(w, n < 0 ? errno : ENOSPC, why);
        done += (size_t)n;
    }
    return STATUS_OK;
}

int file_append(struct file_writer *w, const void *bytes, size_t length, struct failure *why)
{
    int status = file_patch(w, w->length, bytes, length, why);
    if (!status)
        w->length += length;
    return status;
}

int file_commit(struct file_writer *w, struct failure *why)
{
    if (fsync(w->descriptor) < 0 && errno != EINVAL && errno != EROFS)
        return write_failure(w, errno, why);
    if (interrupted())
        return failure_set(why, STATUS_INTERRUPTED, w->path, NULL, "interrupted while writing");
    if (!w->named) {
        char link[64];
        snprintf(link, sizeof link, "/proc/self/fd/%d", w->descriptor);
        unlink(w->temporary); /* of an earlier process with the same number */
        if (linkat(AT_FDCWD, link, AT_FDCWD, w->temporary, AT_SYMLINK_FOLLOW) < 0)
            return write_failure(w, errno, why);
        w->named = true;
    }
    if (rename(w->temporary, w->path) < 0)
        return write_failure(w, errno, why);
    w->named = false;
    int code = close(w->descriptor) < 0 ? errno : 0;
    w->descriptor = -1;
    int status = code ? write_failure(w, code, why) : STATUS_OK;
    file_abandon(w);
    return status;
}

void file_abandon(struct file_writer *w)
{
    if (w->descriptor >= 0)
        close(w->descriptor);
    if (w->named)
        unlink(w->temporary);
    free(w->path);
    free(w->temporary);
    *w = (struct file_writer){.descriptor = -1};
}

int file_replace(const char *path, const void *bytes, size_t length, struct failure *why)
{
    struct file_writer writer;
    int status = file_begin(&writer, path, why);
    if (!status)
        status = file_append(&writer, bytes, length, why);
    if (!status)
        status = file_commit(&writer, why);
    file_abandon(&writer);
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
