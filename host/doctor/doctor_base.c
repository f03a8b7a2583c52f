/* What building, running and looking need: room, the mesher, a browser. */
#include "doctor.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/statvfs.h>
#include <unistd.h>

enum { MEMORY_MiB = 300, FOLDER_MiB = 64 }; /* the demo's build peaks at 82 MB; its bank is 0.3 MB */

static void memory(struct doctor *doctor)
{
    char path[300], line[200];
    unsigned long long free_KiB = 0;
    struct doctor_check *check = doctor_add(doctor, "base", "memory", "building banks", true);
    snprintf(path, sizeof path, "%s/proc/meminfo", doctor->place.root);
    FILE *file = fopen(path, "r");
    while (file && fgets(line, sizeof line, file))
        if (sscanf(line, "MemAvailable: %llu", &free_KiB) == 1)
            break;
    if (file)
        fclose(file);
    doctor_yes(check, "%llu MiB free", free_KiB / 1024);
    if (free_KiB / 1024 < MEMORY_MiB) {
        check->answer = DOCTOR_NO;
        snprintf(check->fix, sizeof check->fix, "end other programs; a small bank needs %d MiB", (int)MEMORY_MiB);
    }
}

static void temporary(struct doctor *doctor)
{
    const char *folder = getenv("TMPDIR");
    struct statvfs room;
    folder = folder && *folder ? folder : "/tmp";
    struct doctor_check *check = doctor_add(doctor, "base", "temporary_folder", "banks of scenes without -o", true);
    if (access(folder, W_OK | X_OK) != 0 || statvfs(folder, &room) != 0) {
        snprintf(check->found, sizeof check->found, "%.200s cannot be written", folder);
        snprintf(check->fix, sizeof check->fix, "export TMPDIR=$HOME");
        return;
    }
    const unsigned long long free_MiB = (unsigned long long)room.f_bavail * room.f_frsize >> 20;
    doctor_yes(check, "%.150s, %llu MiB free", folder, free_MiB);
    if (free_MiB < FOLDER_MiB) {
        check->answer = DOCTOR_NO;
        snprintf(check->fix, sizeof check->fix, "export TMPDIR=A_FOLDER_WITH_ROOM");
    }
}

static void mesher(struct doctor *doctor)
{
    char path[400];
    const char *given = getenv("TROCAR_MESHER"), *program = doctor->place.program;
    const char *slash = program ? strrchr(program, '/') : NULL;
    struct doctor_check *check = doctor_add(doctor, "base", "trocar-mesher", "scenes from surfaces and geometry", true);
    if (given && *given)
        snprintf(path, sizeof path, "%s", given);
    else
        snprintf(path, sizeof path, "%.*strocar-mesher", slash ? (int)(slash + 1 - program) : 0,
                 program ? program : "");
    if (access(path, X_OK) == 0) {
        doctor_yes(check, "%.230s", path);
        return;
    }
    snprintf(check->found, sizeof check->found, "%.200s is not there", path);
    snprintf(check->fix, sizeof check->fix, "make all, or export TROCAR_MESHER=WHERE_IT_IS");
}

static void browser(struct doctor *doctor)
{
    static const char *const names[] = {"chromium", "firefox", "firefox-esr", "google-chrome", "xdg-open"};
    char found[200];
    struct doctor_check *check = doctor_add(doctor, "base", "browser", "the live page", false);
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (doctor_find(doctor, names[i], found, sizeof found)) {
            doctor_yes(check, "%s", found);
            return;
        }
    snprintf(check->found, sizeof check->found, "none in the search path");
    snprintf(check->fix, sizeof check->fix,
             "as root: apt-get install -y chromium; or from another machine: ssh -L 8471:127.0.0.1:8471 THIS_MACHINE");
}

/* In a checkout: the packages that make needs, by the script that make asks. */
static void packages(struct doctor *doctor, const char *group, const char *use)
{
    char command[80], line[320] = "";
    if (*doctor->place.root || access("host/dependencies.sh", X_OK) != 0)
        return;
    struct doctor_check *check = doctor_add(doctor, "base", group, use, false);
    snprintf(command, sizeof command, "host/dependencies.sh --check %s 2>&1", group);
    FILE *pipe = popen(command, "r");
    if (pipe && !fgets(line, sizeof line, pipe))
        line[0] = 0;
    const int status = pipe ? pclose(pipe) : -1;
    line[strcspn(line, "\n")] = 0;
    if (status == 0) {
        doctor_yes(check, "all are installed");
        return;
    }
    const char *run = strstr(line, "run: ");
    snprintf(check->found, sizeof check->found, "some are missing");
    snprintf(check->fix, sizeof check->fix, "as root: %.300s", run ? run + 5 : "make deps");
}

void doctor_base(struct doctor *doctor)
{
    memory(doctor);
    temporary(doctor);
    mesher(doctor);
    browser(doctor);
    packages(doctor, "build", "make");
    packages(doctor, "test", "make test");
}
