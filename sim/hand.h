/* The hand that holds the simulated instrument: a spring-damper from the tip to a target that follows a gesture.
 *
 * A gesture is a small text file, one step per line, '#' starts a comment:
 *
 *   approach 0.3 s            from where the tip is to the touch point (where the axis meets the body)
 *   press 20 mm in 0.5 s      move along the instrument's axis to this depth below the touch point
 *   slide 15 mm -5 mm in 1 s  move across by so much along the trocar frame's x and y, from where it is
 *   poke 10 mm in 0.05 s      there and back, so many times as `times N` says (default 1)
 *   hold 0.5 s
 *   close 0.2 s               the jaws, where the tip is; and
 *   open 0.2 s
 *   retract 0.3 s             back to the start
 *   repeat N                  the whole gesture again, N times in all; last line
 *
 * Depths are absolute below the touch point, along the line from the trocar through it (negative: above the body);
 * motion between is minimum-jerk (Flash and Hogan 1985). After the last step the target stays where it is. Lengths in m,
 * cm or mm (at most 0.5 m), times in s or ms (above 0, at most an hour). */
#ifndef TROCAR_HAND_H
#define TROCAR_HAND_H

#include <stddef.h>

#include "device.h"

enum { HAND_MAX_STEPS = 256, HAND_MAX_REPEAT = 100000 };
#define HAND_STIFFNESS_N_M 400.0 /* a relaxed grip */
#define HAND_DAMPING_NS_M  8.0

enum hand_step_kind {
    HAND_APPROACH,
    HAND_PRESS,
    HAND_SLIDE,
    HAND_POKE,
    HAND_HOLD,
    HAND_CLOSE,
    HAND_OPEN,
    HAND_RETRACT
};

struct hand_step {
    enum hand_step_kind kind;
    double value_m[2]; /* depth; or x, y of slide */
    double duration_s; /* of the step (poke: of one poke) */
    unsigned times;    /* poke */
};

struct gesture {
    char name[64];
    size_t count;
    struct hand_step step[HAND_MAX_STEPS];
    unsigned repeat;
};

/* `name` is one of the built-in gestures (gesture_names) or a file. Errors name file and line in `message`
 * and return a negative status (STATUS_FILE_OPEN, STATUS_GESTURE_SYNTAX). */
int gesture_read(const char *name, struct gesture *gesture, char *message, size_t message_size, long *line);
int gesture_parse(const char *text, const char *name, struct gesture *gesture, char *message, size_t message_size,
                  long *line);
const char *gesture_names(void);
double gesture_duration_s(const struct gesture *gesture);

struct hand {
    double stiffness_N_m, damping_Ns_m; /* HAND_STIFFNESS_N_M, HAND_DAMPING_NS_M */
    double start[3], touch[3];     /* tip targets in the trocar's frame: at rest, and where the axis meets the body */
    const struct gesture *gesture; /* NULL: stay at `start` */
    double override_m[3];          /* target from keyboard or mouse, trocar's frame, while `overridden` */
    int overridden;
};

/* Target of the tip in the trocar's frame (Z into the body) at a time of the gesture. */
void hand_target(const struct hand *hand, double time_s, double target_m[3]);
/* How far the jaws are closed then, 0 .. 1; open at first. */
double hand_grip(const struct hand *hand, double time_s);

#endif
