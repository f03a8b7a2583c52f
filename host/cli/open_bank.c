#include "open_bank.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

bool is_scene(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot && (!strcmp(dot, ".yaml") || !strcmp(dot, ".yml"));
}

static int build(const char *path, const char *out_path, struct bank_file *bank, struct failure *why)
{
    struct build_result result;
    struct scene *scene = calloc(1, sizeof *scene);
    if (!scene)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the scene");
    int status = scene_read(path, scene, why);
    if (!status)
        status = bank_build(scene, out_path, NULL, !isatty(STDERR_FILENO), &result, why);
    if (!status)
        status = bank_load(out_path, bank, why);
    free(scene);
    return status;
}

int open_bank(const char *path, const char *out_path, struct bank_file *bank, struct failure *why)
{
    if (!is_scene(path))
        return bank_load(path, bank, why);
    if (out_path)
        return build(path, out_path, bank, why);

    char folder[300], file[340];
    const char *base = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%.250s/trocar-XXXXXX", base && *base ? base : "/tmp");
    if (!mkdtemp(folder))
        return failure_set(why, STATUS_FILE_WRITE, folder, "set TMPDIR, or name a file with -o",
                           "cannot make a temporary folder for the bank");
    snprintf(file, sizeof file, "%s/scene.bank", folder);
    int status = build(path, file, bank, why);
    unlink(file);
    rmdir(folder);
    return status;
}
