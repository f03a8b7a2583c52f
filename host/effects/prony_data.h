/* The measurements of prony_fit.h from their table, checked. */
#ifndef TROCAR_PRONY_DATA_H
#define TROCAR_PRONY_DATA_H

#include "prony_fit.h"

/* Fills oscillating, points, x, measured, unit, what. STATUS_TABLE_SYNTAX, STATUS_FIT with the line. */
int prony_data_read(const char *path, struct prony_fit *fit, struct failure *why);

#endif
