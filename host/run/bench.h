/* The bench: a simulated instrument and its hand set up in front of the body of a bank. */
#ifndef TROCAR_BENCH_H
#define TROCAR_BENCH_H

#include "bank.h"
#include "bank_view.h"
#include "device.h"
#include "failure.h"
#include "hand.h"

/* The mechanics of the device called `name` (NULL: the reference device) with the calibration of the bank's `tool`:
 * what is simulated is a device that the bank was built for. */
int bench_device(const char *name, const struct bank_tool *tool, struct device_model *model, struct failure *why);

/* The same; without a name, the device of the scene that the bank was built from, whether or not its mesh is at hand. */
int bench_choose(const char *name, const struct bank_file *bank, struct device_model *model, struct failure *why);

/* A relaxed hand. Its touch point is where the instrument's axis meets the body, less what the leading tool point stands
 * ahead of the tip's centre, so that depth 0 of a gesture is first touch; it starts drawn back, 2 % of the range from the
 * shortest insertion. STATUS_SCENE_VALUE when the axis does not meet the body within the instrument's range. */
int bench_hand(const struct bank_view *bank, struct hand *hand, struct failure *why);

/* Down, in the trocar's frame. */
void bench_gravity(const struct bank_tool *tool, double direction[3]);

#endif
