#include "open_bank.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "output.h"

bool is_scene(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot && (!strcasecmp(dot, ".yaml") || !strcasecmp(dot, ".yml"));
}

int check_bank_output(const char *out_path, const char *input, const struct scene *scene, struct failure *why)
{
    static const char *const marks[] = {"TRCB", NULL};
    char pair[sizeof scene->mesh_path + 8];
    size_t n = strlen(scene->mesh_path);
    int status = output_is_not_input(out_path, input, why);
    if (!status)
        status = output_is_not_input(out_path, scene->mesh_path, why);
    static const char *const tetgen[2] = {".node", ".ele"};
    for (int k = 0; k < 2 && !status; k++) {
        const char *dot = strrchr(scene->mesh_path, '.');
        if (!dot || strcasecmp(dot, tetgen[k]) != 0)
            continue;
        snprintf(pair, sizeof pair, "%.*s%s", (int)(n - strlen(dot)), scene->mesh_path, tetgen[!k]);
        status = output_is_not_input(out_path, pair, why);
    }
    return status ? status : output_may_replace(out_path, marks, "a bank", why);
}

/* `text` as one word of a shell's command line. */
static void shell_word(const char *text, char *word, size_t room)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-/+,:@%=";
    size_t used = 0;
    if (*text && strspn(text, plain) == strlen(text)) {
        snprintf(word, room, "%s", text);
        return;
    }
    word[used++] = '\'';
    for (; *text && used + 6 < room; text++)
        used += (size_t)snprintf(word + used, room - used, *text == '\'' ? "'\\''" : "%c", *text);
    snprintf(word + used, room - used, "'");
}

int load_bank(const char *path, struct bank_file *bank, struct failure *why)
{
    bool scene = is_scene(path);
    int status = bank_load(path, bank, why);
    if ((status != STATUS_BANK_MAGIC && status != STATUS_BANK_LENGTH) || (!scene && !mesh_is_known(path)))
        return status;
    char out[80], in_word[150], out_word[90], remedy[sizeof why->remedy];
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path, *dot = strrchr(name, '.');
    snprintf(out, sizeof out, "%.*s.bank", dot && dot > name ? (int)(dot - name) : (int)strlen(name), name);
    shell_word(path, in_word, sizeof in_word);
    shell_word(out, out_word, sizeof out_word);
    bool fits = strlen(in_word) + 1 < sizeof in_word && strlen(name) + 6 < sizeof out;
    snprintf(remedy, sizeof remedy, "build its bank first: trocar build %s%s -o %s", fits ? in_word : "FILE",
             scene ? "" : " --extent METRES", fits ? out_word : "BANK");
    return failure_set(why, STATUS_BANK_MAGIC, path, remedy, "this is a %s, not a bank", scene ? "scene" : "mesh");
}

static int build(const char *path, const char *out_path, struct bank_file *bank, struct failure *why)
{
    struct build_result result;
    struct scene *scene = calloc(1, sizeof *scene);
    if (!scene)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the scene");
    int status = scene_read(path, scene, why);
    if (!status)
        status = check_bank_output(out_path, path, scene, why);
    if (!status)
        status = bank_build(scene, out_path, NULL, BANK_KEEP_AFTER_S, !isatty(STDERR_FILENO), &result, why);
    if (!status)
        status = bank_load(out_path, bank, why);
    free(scene);
    return status;
}

int open_bank(const char *path, const char *out_path, struct bank_file *bank, struct failure *why)
{
    if (!is_scene(path))
        return load_bank(path, bank, why);
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
