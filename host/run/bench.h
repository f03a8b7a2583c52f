/* The bench: simulated instruments and the hands that hold them, set up in front of the body of a bank. */
#ifndef TROCAR_BENCH_H
#define TROCAR_BENCH_H

#include <stdbool.h>

#include "bank.h"
#include "bank_view.h"
#include "device_node.h"
#include "failure.h"
#include "hand.h"

#define BENCH_DRIVE_m_s 0.5

struct bench_instrument {
    struct gesture gesture;
    struct hand hand;
    struct device_model model; /* the catalogue's mechanics with the bank's calibration */
    struct device_node node;
    bool driven; /* the hand goes to drive_m, trocar's frame */
    double drive_m[3];
};

/* Instrument `tool` of the bank (0 ..) as node `node_id` of a bus, at rest with its hand drawn back. `gesture`: name or file, NULL
 * for press. `device`: name, NULL for the scene's. The struct must stay where it is. STATUS_* of gesture_read, bench_choose, bench_hand. */
int bench_start(struct bench_instrument *instrument, const struct bank_file *bank, uint32_t tool, const char *gesture,
                const char *device, uint8_t node_id, struct failure *why);

/* Somebody drives the hand (`driven`): it goes to `target_m` (trocar's frame) at no more than BENCH_DRIVE_m_s, so a jump of the
 * mouse is none of the hand; let go, it goes back to its gesture in the same way. `time_s`: of the gesture. */
void bench_drive(struct bench_instrument *instrument, bool driven, const double target_m[3], double time_s);
/* One tick's way of a hand that is driven, or on its way back. */
void bench_drive_tick(struct bench_instrument *instrument, double time_s);

/* What bench_start is made of. */

/* The mechanics of the device called `name` (NULL: the reference device) with the calibration of the bank's `tool`:
 * what is simulated is a device that the bank was built for. */
int bench_device(const char *name, const struct bank_tool *tool, struct device_model *model, struct failure *why);

/* The same for instrument `tool`; without a name, its device in the scene that the bank was built from, whether or not the
 * scene's mesh is at hand. */
int bench_choose(const char *name, const struct bank_file *bank, uint32_t tool, struct device_model *model,
                 struct failure *why);

/* A relaxed hand. Its touch point is where the instrument's axis meets the body, less what the leading tool point stands
 * ahead of the tip's centre, so that depth 0 of a gesture is first touch; it starts drawn back, 2 % of the range from the
 * shortest insertion. STATUS_SCENE_VALUE when the axis does not meet the body within the instrument's range. */
int bench_hand(const struct bank_view *bank, uint32_t tool, struct hand *hand, struct failure *why);

/* Down, in the trocar's frame. */
void bench_gravity(const struct bank_tool *tool, double direction[3]);

#endif
