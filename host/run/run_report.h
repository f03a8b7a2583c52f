/* A run's result, for people (a table) and for machines (one JSON object on one line). */
#ifndef TROCAR_RUN_REPORT_H
#define TROCAR_RUN_REPORT_H

#include <stdio.h>

#include "session.h"

void run_report_table(FILE *out, const struct session_result *result);
/* Keys: ticks, missed, peak_force_N, force_error_vs_fem (null when not known, then fem_reason says why),
 * torque_log_sha256, and the rest of struct session_result under its own names, with `instruments`, a list of the same per
 * instrument. STATUS_MEMORY. */
int run_report_json(FILE *out, const struct session_result *result, struct failure *why);

#endif
