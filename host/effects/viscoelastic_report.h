/* How well a series fits the measurements that a scene names: branches and residuals as text, measured and fitted curves as a
 * drawing. */
#ifndef TROCAR_VISCOELASTIC_REPORT_H
#define TROCAR_VISCOELASTIC_REPORT_H

#include <stdio.h>

#include "failure.h"
#include "scene.h"

/* To `out` (NULL: nowhere), a few lines; and BANK.viscoelastic.svg beside the bank. Nothing when the scene fits no table. */
int viscoelastic_report(const struct scene *scene, const char *bank_path, FILE *out, struct failure *why);

#endif
