/* What this machine can do for Trocar, and for what it cannot the exact command. Nothing is changed.
 *
 * A check is about one thing; `needed` says that the default path (build a bank, run, view) stops without it. */
#ifndef TROCAR_DOCTOR_H
#define TROCAR_DOCTOR_H

#include <stdbool.h>
#include <stddef.h>

enum doctor_answer { DOCTOR_YES, DOCTOR_PARTLY, DOCTOR_NO };

struct doctor_check {
    const char *group, *name; /* "bus", "can_raw" */
    const char *use;          /* what it is good for */
    bool needed;
    enum doctor_answer answer;
    char found[240]; /* what was seen */
    char fix[320];   /* the command, "" when nothing is to be done */
};

/* Where it looks: `root` is put before /proc, /sys, /dev and /lib ("" but in tests), `path` is searched for programs (NULL:
 * $PATH), `program` is the program itself, beside which the mesher stands. */
struct doctor_place {
    const char *root, *path, *program;
};

enum { DOCTOR_CHECKS = 40 };

struct doctor {
    struct doctor_place place;
    size_t count;
    struct doctor_check check[DOCTOR_CHECKS];
};

/* All checks, in the order of the groups: base, bus, time, rig. */
void doctor_look(struct doctor *doctor, const struct doctor_place *place);

/* For the groups: a new check, whose answer is DOCTOR_NO until it is set. */
struct doctor_check *doctor_add(struct doctor *doctor, const char *group, const char *name, const char *use,
                                bool needed);
/* found = text, answer = yes. */
void doctor_yes(struct doctor_check *check, const char *text, ...) __attribute__((format(printf, 2, 3)));
/* A program of the search path; a missing one is answered with "as root: apt-get install -y PACKAGE". */
void doctor_program(struct doctor *doctor, const char *group, const char *name, const char *package, const char *use);
/* Full path of a program of the search path, or false. */
bool doctor_find(const struct doctor *doctor, const char *name, char *found, size_t room);
/* The first line of root/path without its end; false when it cannot be read. */
bool doctor_line(const struct doctor *doctor, const char *path, char *line, size_t room);

void doctor_base(struct doctor *doctor);
void doctor_bus(struct doctor *doctor);
void doctor_time(struct doctor *doctor);
void doctor_rig(struct doctor *doctor);

#endif
