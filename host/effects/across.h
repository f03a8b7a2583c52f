/* The curve P of the quasi-non-linear correction [C97 3.4.2, eq. 3.22, 3.23] on the field that is shown: of each vertex' displacement the part
 * across the imposed direction gets the amplitude P(x) in place of x, the part along it stays. The imposed direction is that of the
 * contacts' mean displacement; with two tools that push different ways it is neither's, and the field is then left as it is. */
#ifndef TROCAR_ACROSS_H
#define TROCAR_ACROSS_H

#include <stddef.h>

#include "bank_view.h"

/* `displacement`: 3 per contact, m; `u`: 3 per vertex of the bank, changed. Nothing without a curve or a direction. */
void across_apply(const struct bank_view *bank, size_t contacts, const double *displacement, double *u);

#endif
