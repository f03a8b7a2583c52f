#include "doctor.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct doctor_check *doctor_add(struct doctor *doctor, const char *group, const char *name, const char *use,
                                bool needed)
{
    static struct doctor_check none; /* written, never read: more checks than there is room for is a mistake of ours */
    if (doctor->count == DOCTOR_CHECKS)
        return &none;
    struct doctor_check *check = &doctor->check[doctor->count++];
    *check = (struct doctor_check){.group = group, .name = name, .use = use, .needed = needed, .answer = DOCTOR_NO};
    return check;
}

void doctor_yes(struct doctor_check *check, const char *text, ...)
{
    va_list arguments;
    va_start(arguments, text);
    vsnprintf(check->found, sizeof check->found, text, arguments);
    va_end(arguments);
    check->answer = DOCTOR_YES;
}

bool doctor_find(const struct doctor *doctor, const char *name, char *found, size_t room)
{
    const char *path = doctor->place.path;
    while (path && *path) {
        const size_t n = strcspn(path, ":");
        struct stat status;
        if (snprintf(found, room, "%.*s/%s", (int)n, path, name) < (int)room && stat(found, &status) == 0 &&
            S_ISREG(status.st_mode) && access(found, X_OK) == 0)
            return true;
        path += n + (path[n] == ':');
    }
    return false;
}

void doctor_program(struct doctor *doctor, const char *group, const char *name, const char *package, const char *use)
{
    char found[200];
    struct doctor_check *check = doctor_add(doctor, group, name, use, false);
    if (doctor_find(doctor, name, found, sizeof found)) {
        doctor_yes(check, "%s", found);
        return;
    }
    snprintf(check->found, sizeof check->found, "not in the search path");
    snprintf(check->fix, sizeof check->fix, "as root: apt-get install -y %s", package);
}

bool doctor_line(const struct doctor *doctor, const char *path, char *line, size_t room)
{
    char whole[400];
    snprintf(whole, sizeof whole, "%s%s", doctor->place.root, path);
    FILE *file = fopen(whole, "r");
    if (!file)
        return false;
    const bool good = fgets(line, (int)room, file) != NULL;
    fclose(file);
    if (good)
        line[strcspn(line, "\n")] = 0;
    return good;
}

void doctor_look(struct doctor *doctor, const struct doctor_place *place)
{
    *doctor = (struct doctor){.place = *place};
    if (!doctor->place.root)
        doctor->place.root = "";
    if (!doctor->place.path)
        doctor->place.path = getenv("PATH");
    doctor_base(doctor);
    doctor_bus(doctor);
    doctor_time(doctor);
    doctor_rig(doctor);
}
