/* What it costs in force that a bank gives a tick less work on rows (CONT row_work) than the image would: contacts that slide
 * onto rows that are not decoded yet stay on their last ones, or wait (contact.h). The same recording of a fast stroke is
 * replayed with the bank's share and with the image's own; the forces of the contact system are compared tick by tick. */
#ifndef TROCAR_ROW_COST_H
#define TROCAR_ROW_COST_H

#include <stdbool.h>
#include <stdint.h>

#include "recording.h"

/* Press 10 mm deep, then across the surface and back. The motion is minimum-jerk: its peak is 15/8 of its mean. */
#define ROW_COST_SPEED_m_s 0.3
#define ROW_COST_STROKE_m  0.04

struct row_cost {
    bool known;
    char reason[200];              /* why it is not */
    struct tick_error error;       /* relative to the largest force */
    uint32_t waits, default_waits; /* contacts held on older rows, or waiting, in all ticks of the recording */
    double ticks;
};

/* `bank_path` holds a factor bank. A stroke that cannot be made on this body is no failure: then it is not known. */
int row_cost_measure(const char *bank_path, struct row_cost *cost, struct failure *why);

#endif
