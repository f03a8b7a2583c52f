/* How well the curves of the quasi-non-linear correction fit the table that a scene names: degrees, ranges and residuals as text, and a
 * drawing of measured, fitted and linear force and bulge. */
#ifndef TROCAR_QUASI_NONLINEAR_REPORT_H
#define TROCAR_QUASI_NONLINEAR_REPORT_H

#include <stdio.h>

#include "failure.h"
#include "scene.h"

/* To `out` (NULL: nowhere), a few lines; and BANK.quasi_nonlinear.svg beside the bank. Nothing when the scene fits no table. */
int quasi_nonlinear_report(const struct scene *scene, const char *bank_path, FILE *out, struct failure *why);

#endif
