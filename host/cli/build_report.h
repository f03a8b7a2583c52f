/* What a build made, in words and as one JSON object: sizes, errors, and for each limit what was reached and what it cost. */
#ifndef TROCAR_BUILD_REPORT_H
#define TROCAR_BUILD_REPORT_H

#include <stdio.h>

#include "bank.h"
#include "row_cost.h"

struct build_report {
    const char *path;
    const struct build_result *result;
    const struct row_cost *cost;                         /* measured when result->row_work is not 0 */
    double max_bytes, max_instructions, max_force_error; /* 0: none */
};

void build_report_json(FILE *out, const struct build_report *report);
void build_report_text(FILE *out, const struct build_report *report);

#endif
