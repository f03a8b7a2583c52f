#include "hand.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gestures.h"
#include "status.h"

/* ---- motion ---- */

/* Where a step starts or ends: at the hand's start, or across and below the touch point. */
struct place {
    int at_start;
    double x, y, depth;
};

static void place_after(struct place *p, const struct hand_step *step)
{
    switch (step->kind) {
    case HAND_APPROACH:
        *p = (struct place){0};
        break;
    case HAND_PRESS:
        p->at_start = 0;
        p->depth = step->value_m[0];
        break;
    case HAND_SLIDE:
        p->at_start = 0;
        p->x += step->value_m[0];
        p->y += step->value_m[1];
        break;
    case HAND_RETRACT:
        *p = (struct place){.at_start = 1};
        break;
    case HAND_POKE:
    case HAND_HOLD:
    case HAND_CLOSE:
    case HAND_OPEN:
        break;
    }
}

static void place_point(const struct hand *hand, const struct place *p, double point[3])
{
    if (p->at_start) {
        memcpy(point, hand->start, 3 * sizeof(double));
        return;
    }
    const double *t = hand->touch;
    double distance = sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
    for (int i = 0; i < 3; i++)
        point[i] = t[i] + (distance > 0 ? p->depth * t[i] / distance : 0);
    point[0] += p->x;
    point[1] += p->y;
}

/* Start of pass n. A pass that approaches or retracts ends at the same place every time; one that only slides goes on.
 */
static struct place pass_start(const struct gesture *g, unsigned n)
{
    struct place p = {.at_start = 1};
    if (n == 0)
        return p;
    int resets = 0;
    for (size_t i = 0; i < g->count; i++) {
        resets |= g->step[i].kind == HAND_APPROACH || g->step[i].kind == HAND_RETRACT;
        place_after(&p, &g->step[i]);
    }
    if (!resets) {
        p.x *= n;
        p.y *= n;
    }
    return p;
}

static double step_duration_s(const struct hand_step *step)
{
    return step->duration_s * (step->kind == HAND_POKE ? step->times : 1);
}

static double pass_duration_s(const struct gesture *g)
{
    double sum = 0;
    for (size_t i = 0; i < g->count; i++)
        sum += step_duration_s(&g->step[i]);
    return sum;
}

double gesture_duration_s(const struct gesture *gesture)
{
    return pass_duration_s(gesture) * gesture->repeat;
}

static double minimum_jerk(double s)
{
    return s * s * s * (10 + s * (-15 + 6 * s));
}

static void between(const double from[3], const double to[3], double s, double point[3])
{
    for (int i = 0; i < 3; i++)
        point[i] = from[i] + s * (to[i] - from[i]);
}

void hand_target(const struct hand *hand, double time_s, double target_m[3])
{
    const struct gesture *g = hand->gesture;
    if (hand->overridden || !g || g->count == 0) {
        memcpy(target_m, hand->overridden ? hand->override_m : hand->start, 3 * sizeof(double));
        return;
    }
    double pass_s = pass_duration_s(g);
    double left = time_s > 0 ? time_s : 0;
    if (left >= pass_s * g->repeat) {
        struct place end = pass_start(g, g->repeat);
        place_point(hand, &end, target_m);
        return;
    }
    unsigned pass = (unsigned)(left / pass_s);
    left -= pass * pass_s;
    struct place p = pass_start(g, pass);
    for (size_t i = 0; i < g->count; i++) {
        const struct hand_step *step = &g->step[i];
        double duration_s = step_duration_s(step), from[3], to[3];
        if (left >= duration_s) {
            left -= duration_s;
            place_after(&p, step);
            continue;
        }
        place_point(hand, &p, from);
        double s = left / step->duration_s;
        if (step->kind == HAND_POKE) {
            struct place bottom = {.x = p.x, .y = p.y, .depth = step->value_m[0]};
            place_point(hand, &bottom, to);
            s -= floor(s);
            s = s < 0.5 ? 2 * s : 2 - 2 * s;
        } else {
            place_after(&p, step);
            place_point(hand, &p, to);
        }
        between(from, to, minimum_jerk(s), target_m);
        return;
    }
    place_point(hand, &p, target_m); /* rounding left a sliver of time behind the last step */
}

double hand_grip(const struct hand *hand, double time_s)
{
    const struct gesture *g = hand->gesture;
    if (!g || g->count == 0)
        return 0;
    double pass_s = pass_duration_s(g), left = time_s > 0 ? time_s : 0, grip = 0;
    unsigned pass = left >= pass_s * g->repeat ? g->repeat : (unsigned)(left / pass_s);
    for (size_t i = 0; i < g->count && pass > 0; i++) /* what the last pass left */
        grip = g->step[i].kind == HAND_CLOSE ? 1 : g->step[i].kind == HAND_OPEN ? 0 : grip;
    if (pass == g->repeat)
        return grip;
    left -= pass * pass_s;
    for (size_t i = 0; i < g->count && left >= 0; i++) {
        double duration_s = step_duration_s(&g->step[i]), s = left < duration_s ? minimum_jerk(left / duration_s) : 1;
        if (g->step[i].kind == HAND_CLOSE)
            grip += s * (1 - grip);
        else if (g->step[i].kind == HAND_OPEN)
            grip -= s * grip;
        left -= duration_s;
    }
    return grip;
}

/* ---- text ---- */

struct reader {
    char *word[10]; /* one more than the longest step has */
    size_t count, next;
    char *message;
    size_t message_size;
};

static int __attribute__((format(printf, 2, 3))) complain(const struct reader *r, const char *format, ...)
{
    if (r->message_size) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(r->message, r->message_size, format, arguments);
        va_end(arguments);
    }
    return STATUS_GESTURE_SYNTAX;
}

/* A number and its unit, in one word ("20mm") or two ("20 mm"). */
static int quantity(struct reader *r, const char *what, int is_time, double limit, double *value)
{
    static const struct {
        const char *name;
        int is_time;
        double factor;
    } units[] = {{"m", 0, 1}, {"cm", 0, 1e-2}, {"mm", 0, 1e-3}, {"s", 1, 1}, {"ms", 1, 1e-3}};
    const char *expected = is_time ? "a time such as 0.3 s" : "a length such as 20 mm";
    if (r->next >= r->count)
        return complain(r, "%s: %s is missing", what, expected);
    const char *word = r->word[r->next++];
    char *end;
    double number = strtod(word, &end);
    if (end == word || !isfinite(number) || strpbrk(word, "xX")) /* strtod would read 0x10 */
        return complain(r, "%s: \"%.40s\" is not %s", what, word, expected);
    const char *unit = *end ? end : r->next < r->count ? r->word[r->next++] : "";
    for (size_t i = 0; i < sizeof units / sizeof units[0]; i++)
        if (units[i].is_time == is_time && !strcmp(units[i].name, unit)) {
            *value = number * units[i].factor;
            if (fabs(*value) > limit || (is_time && *value <= 0))
                return complain(r, "%s: %.20s %.4s is out of range (%s %g %s)", what, word, *end ? "" : unit,
                                is_time ? "above 0, at most" : "at most", limit, is_time ? "s" : "m");
            return STATUS_OK;
        }
    return complain(r, "%s: the unit \"%.20s\" is not one of %s", what, unit, is_time ? "s, ms" : "m, cm, mm");
}

static int keyword(struct reader *r, const char *word)
{
    if (r->next >= r->count || strcmp(r->word[r->next], word))
        return complain(r, "\"%s\" is expected %s", word,
                        r->next < r->count ? "before the duration" : "at the end of the line");
    r->next++;
    return STATUS_OK;
}

static int number_of(struct reader *r, const char *what, unsigned *value)
{
    char *end = NULL;
    long n = r->next < r->count ? strtol(r->word[r->next], &end, 10) : 0;
    if (!end || *end || n < 1 || n > HAND_MAX_REPEAT)
        return complain(r, "%s: a whole number from 1 to %d is expected", what, (int)HAND_MAX_REPEAT);
    r->next++;
    *value = (unsigned)n;
    return STATUS_OK;
}

static int step_parse(struct reader *r, struct hand_step *step)
{
    static const struct {
        const char *name;
        enum hand_step_kind kind;
        int lengths;
    } kinds[] = {{"approach", HAND_APPROACH, 0}, {"press", HAND_PRESS, 1},    {"slide", HAND_SLIDE, 2},
                 {"poke", HAND_POKE, 1},         {"hold", HAND_HOLD, 0},      {"close", HAND_CLOSE, 0},
                 {"open", HAND_OPEN, 0},         {"retract", HAND_RETRACT, 0}};
    const char *what = r->word[r->next++];
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        if (strcmp(kinds[i].name, what))
            continue;
        *step = (struct hand_step){.kind = kinds[i].kind, .times = 1};
        int status = STATUS_OK;
        for (int k = 0; k < kinds[i].lengths && !status; k++)
            status = quantity(r, what, 0, 0.5, &step->value_m[k]);
        if (!status && kinds[i].lengths)
            status = keyword(r, "in");
        if (!status)
            status = quantity(r, what, 1, 3600, &step->duration_s);
        if (!status && step->kind == HAND_POKE && r->next < r->count) {
            status = keyword(r, "times");
            if (!status)
                status = number_of(r, "times", &step->times);
        }
        if (!status && r->next < r->count)
            return complain(r, "%s: \"%.40s\" at the end of the line is too much", what, r->word[r->next]);
        return status;
    }
    return complain(r, "\"%.40s\" is not a step (approach, press, slide, poke, hold, retract, repeat)", what);
}

/* One line: comments off, split into words. */
static void split(struct reader *r, char *line)
{
    line[strcspn(line, "#")] = 0;
    char *rest = NULL;
    r->count = r->next = 0;
    for (char *w = strtok_r(line, " \t\r", &rest); w && r->count < sizeof r->word / sizeof r->word[0];
         w = strtok_r(NULL, " \t\r", &rest))
        r->word[r->count++] = w;
}

int gesture_parse(const char *text, const char *name, struct gesture *gesture, char *message, size_t message_size,
                  long *line)
{
    struct reader r = {.message = message, .message_size = message_size};
    *gesture = (struct gesture){.repeat = 1};
    snprintf(gesture->name, sizeof gesture->name, "%s", name);
    int repeated = 0;
    *line = 0;
    while (*text) {
        char buffer[256];
        size_t length = strcspn(text, "\n");
        ++*line;
        if (length >= sizeof buffer)
            return complain(&r, "the line is longer than %zu characters", sizeof buffer - 1);
        memcpy(buffer, text, length);
        buffer[length] = 0;
        text += length + (text[length] == '\n');
        split(&r, buffer);
        if (r.count == 0)
            continue;
        if (repeated)
            return complain(&r, "repeat must be the last line");
        int status;
        if (!strcmp(r.word[0], "repeat")) {
            repeated = 1;
            r.next = 1;
            status = number_of(&r, "repeat", &gesture->repeat);
            if (!status && r.next < r.count)
                status = complain(&r, "repeat: \"%.40s\" at the end of the line is too much", r.word[r.next]);
        } else if (gesture->count == HAND_MAX_STEPS) {
            status = complain(&r, "more than %d steps", (int)HAND_MAX_STEPS);
        } else {
            status = step_parse(&r, &gesture->step[gesture->count]);
            gesture->count += !status;
        }
        if (status)
            return status;
    }
    if (gesture->count == 0)
        return complain(&r, "there is no step in it");
    return STATUS_OK;
}

const char *gesture_names(void)
{
    static char names[200]; /* the same text every time */
    size_t used = 0;
    for (size_t i = 0; gesture_builtin_name(i); i++)
        used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", i ? ", " : "", gesture_builtin_name(i));
    return names;
}

int gesture_read(const char *name, struct gesture *gesture, char *message, size_t message_size, long *line)
{
    *line = 0;
    const char *builtin = gesture_builtin(name);
    if (builtin)
        return gesture_parse(builtin, name, gesture, message, message_size, line);
    FILE *file = fopen(name, "r");
    char text[65536];
    size_t length = file ? fread(text, 1, sizeof text, file) : 0;
    int bad = !file || ferror(file);
    int code = errno;
    if (file)
        fclose(file);
    if (bad) {
        snprintf(message, message_size, "neither a gesture (%s) nor a file that can be read: %s", gesture_names(),
                 strerror(code));
        return STATUS_FILE_OPEN;
    }
    if (length == sizeof text || memchr(text, 0, length)) {
        snprintf(message, message_size, "not a gesture: %s", length == sizeof text ? "longer than 64 KiB" : "binary");
        return STATUS_GESTURE_SYNTAX;
    }
    text[length] = 0;
    return gesture_parse(text, name, gesture, message, message_size, line);
}
