#include "torque_log.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <openssl/evp.h>

#include "candump.h"

void torque_log_discard(struct torque_log *log)
{
    if (log->file)
        fclose(log->file);
    if (log->temporary)
        unlink(log->temporary);
    free(log->temporary);
    free(log->path);
    EVP_MD_CTX_free(log->digest);
    *log = (struct torque_log){0};
}

int torque_log_open(struct torque_log *log, const char *path, struct failure *why)
{
    *log = (struct torque_log){.digest = EVP_MD_CTX_new()};
    if (!log->digest || EVP_DigestInit_ex(log->digest, EVP_sha256(), NULL) != 1) {
        torque_log_discard(log);
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the log's SHA-256");
    }
    if (!path)
        return STATUS_OK;
    size_t room = strlen(path) + 32;
    log->path = strdup(path);
    log->temporary = malloc(room);
    if (!log->path || !log->temporary) {
        torque_log_discard(log);
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the log");
    }
    snprintf(log->temporary, room, "%s.%ld.tmp", path, (long)getpid());
    log->file = fopen(log->temporary, "wb");
    if (!log->file) {
        int code = errno;
        free(log->temporary);
        log->temporary = NULL; /* not ours to remove */
        torque_log_discard(log);
        return failure_set(why, STATUS_FILE_WRITE, path, NULL, "cannot create the torque log: %s", strerror(code));
    }
    return STATUS_OK;
}

void torque_log_frame(struct torque_log *log, const struct can_frame_t *frame, uint64_t time_us)
{
    if (!log->digest)
        return; /* closed */
    char line[CANDUMP_LINE];
    size_t length = candump_format(line, log->interface ? log->interface : "soft", frame, time_us);
    EVP_DigestUpdate(log->digest, line, length);
    log->frames++;
    if (log->file && !log->error && fwrite(line, 1, length, log->file) != length)
        log->error = errno ? errno : EIO;
}

int torque_log_close(struct torque_log *log, char sha256[65], struct failure *why)
{
    unsigned char digest[EVP_MAX_MD_SIZE];
    unsigned length = 0;
    EVP_DigestFinal_ex(log->digest, digest, &length);
    for (unsigned i = 0; i < 32 && i < length; i++)
        snprintf(sha256 + 2 * i, 3, "%02x", digest[i]);
    int status = STATUS_OK;
    if (log->file) {
        int code = log->error;
        if (fclose(log->file) != 0 && !code)
            code = errno;
        log->file = NULL;
        if (!code && rename(log->temporary, log->path) < 0)
            code = errno;
        if (code)
            status =
                failure_set(why, STATUS_FILE_WRITE, log->path, NULL, "cannot write the torque log: %s", strerror(code));
        else {
            free(log->temporary);
            log->temporary = NULL;
        }
    }
    torque_log_discard(log);
    return status;
}
