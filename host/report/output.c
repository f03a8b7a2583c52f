#include "output.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

int file_head(const char *path, char *head, size_t room, size_t *length, struct failure *why)
{
    struct stat info;
    *length = 0;
    FILE *file = fopen(path, "rb");
    if (!file)
        return failure_set(why, STATUS_FILE_OPEN, path, NULL, "cannot open the file: %s", strerror(errno));
    if (fstat(fileno(file), &info) == 0 && S_ISDIR(info.st_mode)) {
        fclose(file);
        return failure_set(why, STATUS_FILE_OPEN, path, "name a file", "this is a directory");
    }
    *length = fread(head, 1, room, file);
    bool bad = ferror(file) != 0;
    fclose(file);
    return bad ? failure_set(why, STATUS_FILE_READ, path, NULL, "reading failed") : STATUS_OK;
}

int output_is_not_input(const char *output, const char *input, struct failure *why)
{
    struct stat out, in;
    if (stat(output, &out) != 0 || stat(input, &in) != 0 || out.st_dev != in.st_dev || out.st_ino != in.st_ino)
        return STATUS_OK;
    return failure_set(why, STATUS_FILE_WRITE, output, "name another file to write",
                       "this is an input, and would be overwritten");
}

int output_may_replace(const char *output, const char *const *marks, const char *kind, struct failure *why)
{
    struct stat info;
    char head[32];
    size_t length;
    if (stat(output, &info) != 0 || !S_ISREG(info.st_mode) || info.st_size == 0)
        return STATUS_OK;
    int status = file_head(output, head, sizeof head, &length, why);
    if (status)
        return status;
    for (; *marks; marks++)
        if (length >= strlen(*marks) && memcmp(head, *marks, strlen(*marks)) == 0)
            return STATUS_OK;
    return failure_set(why, STATUS_FILE_WRITE, output, "name another file, or remove this one",
                       "a file is there that is not %s, and would be overwritten", kind);
}
