/* CAN: the kernel, its interfaces, adapters on serial lines, can-utils. */
#include "doctor.h"

#include <dirent.h>
#include <errno.h>
#include <fnmatch.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <linux/can.h>

enum { ARPHRD_CAN_TYPE = 280, NAMES = 160 };

/* Is root/path there? */
static bool there(const struct doctor *doctor, const char *path)
{
    char whole[400];
    snprintf(whole, sizeof whole, "%s%s", doctor->place.root, path);
    return access(whole, F_OK) == 0;
}

static bool module_file(const struct doctor *doctor, const char *release, const char *name)
{
    static const char *const ends[] = {"", ".xz", ".gz", ".zst"};
    char path[300];
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        snprintf(path, sizeof path, "/lib/modules/%.100s/kernel/%s.ko%s", release, name, ends[i]);
        if (there(doctor, path))
            return true;
    }
    return false;
}

static bool kernel(struct doctor *doctor)
{
    struct utsname system = {0};
    struct doctor_check *check = doctor_add(doctor, "bus", "socketcan", "--bus socketcan:IF", false);
    uname(&system);
    /* The protocol's list is there once can_raw is loaded; opening a socket makes the kernel load it where it may. */
    const int end = *doctor->place.root ? -1 : socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (end >= 0)
        close(end);
    if (end >= 0 || there(doctor, "/proc/net/can")) {
        doctor_yes(check, "Linux %.100s has it", system.release);
        return true;
    }
    snprintf(check->found, sizeof check->found, "Linux %.100s has no CAN protocol loaded", system.release);
    if (module_file(doctor, system.release, "net/can/can-raw"))
        snprintf(check->fix, sizeof check->fix, "as root: modprobe can_raw");
    else
        snprintf(check->fix, sizeof check->fix,
                 "this kernel comes without CAN modules; as root: apt-get install -y linux-image-amd64, then boot it; "
                 "without it use soft or slcan:TTY");
    return false;
}

/* Interfaces of type CAN, with their state. */
static void interfaces(struct doctor *doctor, bool kernel_has_it)
{
    char path[400], line[40], up[NAMES] = "", down[NAMES] = "", first_down[NAME_MAX + 1] = "";
    struct doctor_check *check = doctor_add(doctor, "bus", "interfaces", "a real or virtual bus", false);
    snprintf(path, sizeof path, "%s/sys/class/net", doctor->place.root);
    DIR *folder = opendir(path);
    for (struct dirent *entry; folder && (entry = readdir(folder));) {
        int type = 0;
        unsigned flags = 0;
        snprintf(path, sizeof path, "/sys/class/net/%s/type", entry->d_name);
        if (entry->d_name[0] == '.' || !doctor_line(doctor, path, line, sizeof line) ||
            sscanf(line, "%d", &type) != 1 || type != ARPHRD_CAN_TYPE)
            continue;
        snprintf(path, sizeof path, "/sys/class/net/%s/flags", entry->d_name);
        if (doctor_line(doctor, path, line, sizeof line))
            sscanf(line, "%x", &flags);
        char *list = flags & 1 ? up : down; /* IFF_UP */
        snprintf(list + strlen(list), NAMES - strlen(list), "%s%.15s", *list ? " " : "", entry->d_name);
        if (list == down && !*first_down)
            snprintf(first_down, sizeof first_down, "%s", entry->d_name);
    }
    if (folder)
        closedir(folder);
    if (*up)
        doctor_yes(check, "up: %s%s%s", up, *down ? "; down: " : "", down);
    else
        snprintf(check->found, sizeof check->found, *down ? "down: %s" : "there is none", down);
    if (*down && !*up)
        check->answer = DOCTOR_PARTLY;
    if (*down)
        snprintf(check->fix, sizeof check->fix,
                 strncmp(first_down, "vcan", 4) ? "as root: ip link set %.15s up type can bitrate 1000000"
                                                : "as root: ip link set %.15s up",
                 first_down);
    else if (!*up && !kernel_has_it)
        snprintf(check->fix, sizeof check->fix, "first the kernel, as said above");
    else if (!*up)
        snprintf(
            check->fix, sizeof check->fix,
            "plug an adapter in; or for a virtual one, as root: modprobe vcan; ip link add vcan0 type vcan; ip link "
            "set vcan0 up");
}

static void serial(struct doctor *doctor)
{
    char path[400], names[NAMES] = "", closed[NAME_MAX + 1] = "";
    struct doctor_check *check = doctor_add(doctor, "bus", "serial_adapters", "--bus slcan:TTY", false);
    snprintf(path, sizeof path, "%s/dev", doctor->place.root);
    DIR *folder = opendir(path);
    for (struct dirent *entry; folder && (entry = readdir(folder));) {
        if (fnmatch("ttyACM[0-9]*", entry->d_name, 0) != 0 && fnmatch("ttyUSB[0-9]*", entry->d_name, 0) != 0)
            continue;
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s/dev/%.20s", *names ? " " : "", entry->d_name);
        snprintf(path, sizeof path, "%s/dev/%s", doctor->place.root, entry->d_name);
        if (access(path, R_OK | W_OK) != 0)
            snprintf(closed, sizeof closed, "%s", entry->d_name);
    }
    if (folder)
        closedir(folder);
    if (!*names) {
        snprintf(check->found, sizeof check->found, "there is none");
        snprintf(check->fix, sizeof check->fix, "plug an SLCAN adapter in");
        return;
    }
    doctor_yes(check, "%s", names);
    if (*closed) {
        check->answer = DOCTOR_NO;
        snprintf(check->found, sizeof check->found, "%s; /dev/%.60s may not be used", names, closed);
        snprintf(check->fix, sizeof check->fix, "as root: usermod -aG dialout $USER; then log in again");
    }
}

void doctor_bus(struct doctor *doctor)
{
    const bool has_can = kernel(doctor);
    interfaces(doctor, has_can);
    serial(doctor);
    doctor_program(doctor, "bus", "candump", "can-utils", "looking at a bus with other tools");
    doctor_program(doctor, "bus", "tshark", "tshark", "decoding with another program");
}
