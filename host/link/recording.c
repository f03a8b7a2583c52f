#include "recording.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include "progress.h"

static int refuse(struct failure *why, const char *path, const char *what)
{
    return failure_set(why, STATUS_FILE_WRITE, path, NULL, "%s: %s", what, strerror(errno));
}

/* A log that was cut short in a line must not be continued in that line. */
static int check_end(const char *path, struct failure *why)
{
    struct candump_record record;
    long line = 0;
    char last = '\n';
    FILE *in = fopen(path, "rb");
    if (!in)
        return errno == ENOENT ? STATUS_OK : refuse(why, path, "the recording cannot be read");
    int status;
    while ((status = candump_read(in, path, &line, &record, why)) == 1)
        ;
    if (!status && line > 0 && fseek(in, -1, SEEK_END) == 0)
        last = (char)getc(in);
    fclose(in);
    if (!status && last != '\n')
        return failure_at(why, STATUS_BUS_LOG, path, line, "delete that line, or record to another file",
                          "the recording ends in the middle of a line");
    return status;
}

int recording_open(struct recording *recording, const char *path, bool append, struct failure *why)
{
    recording->path = path;
    recording->frames = recording->bytes = recording->length = 0;
    recording->flushed_s = seconds_now();
    recording->descriptor = STDOUT_FILENO;
    if (!strcmp(path, "-"))
        return STATUS_OK;
    const int status = append ? check_end(path, why) : STATUS_OK;
    if (status)
        return status;
    recording->descriptor = open(path, O_WRONLY | O_CREAT | O_CLOEXEC | (append ? O_APPEND : O_EXCL), 0666);
    if (recording->descriptor < 0 && errno == EEXIST)
        return failure_set(why, STATUS_FILE_WRITE, path, "choose another name, or --append",
                           "the file exists; a recording overwrites nothing");
    return recording->descriptor < 0 ? refuse(why, path, "the recording cannot be created") : STATUS_OK;
}

int recording_flush(struct recording *recording, struct failure *why)
{
    size_t done = 0;
    while (done < recording->length) {
        const ssize_t n = write(recording->descriptor, recording->buffer + done, recording->length - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return refuse(why, recording->path, "the recording cannot be written");
        done += (size_t)n;
    }
    recording->bytes += recording->length;
    recording->length = 0;
    recording->flushed_s = seconds_now();
    return STATUS_OK;
}

int recording_frame(struct recording *recording, const char *interface, const struct can_frame_t *frame,
                    uint64_t time_us, struct failure *why)
{
    char line[CANDUMP_LINE];
    const size_t n = candump_format(line, interface, frame, time_us);
    int status = STATUS_OK;
    if (recording->length + n > RECORDING_BUFFER)
        status = recording_flush(recording, why);
    if (status)
        return status;
    memcpy(recording->buffer + recording->length, line, n);
    recording->length += n;
    recording->frames++;
    /* the clock is asked for every 16th frame: a bus carries at most 20 in a millisecond */
    if (recording->frames % 16 == 0 && seconds_now() - recording->flushed_s > 1e-3 * RECORDING_FLUSH_MS)
        status = recording_flush(recording, why);
    return status;
}

int recording_close(struct recording *recording, struct failure *why)
{
    int status = recording_flush(recording, why);
    if (recording->descriptor == STDOUT_FILENO)
        return status;
    /* EINVAL: a pipe or a terminal */
    if (!status && fsync(recording->descriptor) != 0 && errno != EINVAL && errno != EROFS)
        status = refuse(why, recording->path, "the recording cannot be written");
    if (close(recording->descriptor) != 0 && !status)
        status = refuse(why, recording->path, "the recording cannot be written");
    recording->descriptor = -1;
    return status;
}
