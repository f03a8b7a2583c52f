/* The knobs that trade accuracy for time and bytes, one line of a table each, and the settings that are measured.
 *
 * A knob belongs to a stage: BODY decides the discretisation (the exact compliance), BANK what is stored of it,
 * CONTROLLER what a tick does with it. What comes before a stage is computed once for all settings that share it. */
#ifndef TROCAR_KNOB_H
#define TROCAR_KNOB_H

#include <stdbool.h>
#include <stddef.h>

#include "scene.h"

/* A new knob is a name here, body before bank before controller, and a line of the table in knob.c. */
enum knob {
    KNOB_ORDER,
    KNOB_REFINE,
    KNOB_EFFECTS,
    KNOB_STEP,
    KNOB_POINTS,
    KNOB_STEPS,
    KNOB_SWEEPS,
    KNOB_ROW_WORK,
    KNOB_RATE,
    KNOBS
};
enum stage { STAGE_BODY, STAGE_BANK, STAGE_CONTROLLER };
enum { KNOB_MAX_VALUES = 10 };

struct setting {
    double value[KNOBS];
};

struct knob_info {
    const char *name;   /* one word, for JSON */
    const char *legend; /* of its marks in a plot */
    const char *what;   /* what turning it does, one clause */
    enum stage stage;
    bool best_is_most;  /* the most accurate value is the largest */
    size_t quick, full; /* how many of `value` are measured */
    double value[KNOB_MAX_VALUES];
    double (*of_scene)(const struct scene *scene);    /* what the scene asks for */
    void (*apply)(double value, struct scene *scene); /* NULL: no matter of the scene's */
    const char *format, *at[3];                       /* in words; those of 0, 1, 2 where they differ, else NULL */
};
extern const struct knob_info knob_table[KNOBS];

/* What the scene asks for. */
struct setting knob_scene(const struct scene *scene);
/* The scene with the knobs that it can say set. */
void knob_apply(const struct setting *setting, struct scene *scene);
/* The same with every knob of bank and controller at its most accurate value: the reference of a tick. */
struct setting knob_reference(const struct setting *setting);
/* "7 points", "at most 3 solver steps", ...; at most `room` characters with the NUL. */
void knob_value_text(enum knob knob, double value, char *text, size_t room);
/* All knobs in which `setting` differs from `base`, separated by commas; "as the scene says" when none. */
void knob_name(const struct setting *setting, const struct setting *base, char *text, size_t room);
/* First stage at which two settings differ; STAGE_CONTROLLER + 1 when they are the same. */
int knob_differ(const struct setting *a, const struct setting *b);

/* Whether turning a knob changes anything for this scene: the solver is bounded by factorisations without friction and by sweeps
 * with it; the other of the two is not turned. */
bool knob_acts(enum knob knob, const struct setting *base);

/* The settings to measure, `base` first: every combination of the knobs of body and bank with the controller as in the
 * base; then on the base's bank each knob of the controller alone, and when not `quick` points with steps (or sweeps) together. Those
 * that share a body, and then a bank, follow each other, the base's first. */
struct plan {
    size_t count;
    struct setting *setting; /* malloc */
};
int plan_make(const struct setting *base, bool quick, struct plan *plan, struct failure *why);
void plan_free(struct plan *plan);

#endif
