/* A number with its unit: "4 kPa", "0.10..0.23 m", "5 mm", "4 %". In memory SI, shares as fractions.
 *
 * A number is decimal ("1060", "-0.1", "2.5e-3"); the unit follows, with or without a space. Infinity, NaN, hexadecimal
 * and decimal commas are not numbers. The C locale's decimal point is assumed (nothing here calls setlocale). */
#ifndef TROCAR_QUANTITY_H
#define TROCAR_QUANTITY_H

#include <stddef.h>

#include "status.h"

enum dimension {
    DIMENSION_NUMBER,    /* no unit */
    DIMENSION_RATIO,     /* no unit, or % */
    DIMENSION_SHARE,     /* %, in memory 0..1 */
    DIMENSION_LENGTH,    /* m, cm, mm */
    DIMENSION_POSITION,  /* a length whose unit may be left out: metres */
    DIMENSION_PRESSURE,  /* Pa, kPa, MPa, GPa */
    DIMENSION_DENSITY,   /* kg/m3, g/cm3 */
    DIMENSION_STIFFNESS, /* N/m, N/mm, kN/m */
    DIMENSION_DAMPING,   /* N s/m */
    DIMENSION_FORCE,     /* N, mN */
    DIMENSION_TIME,      /* s, ms */
    DIMENSION_BYTES,     /* B, KiB, MiB */
    DIMENSION_ANGLE,     /* rad, deg */
    DIMENSION_VISCOSITY, /* Pa s, kPa s */
};

enum { QUANTITY_TEXT = 64 };

/* STATUS_OK; STATUS_SCENE_VALUE when there is no number; STATUS_SCENE_UNIT when the unit is missing, not known or of
 * another dimension. `message` then says what is expected. */
int quantity_parse(const char *text, enum dimension dimension, double *value, char *message, size_t message_size);

/* "A..B unit" or "A unit..B unit". */
int quantity_parse_range(const char *text, enum dimension dimension, double range[2], char *message,
                         size_t message_size);

/* The shortest text that quantity_parse reads back to exactly `value` (finite). */
void quantity_print(double value, enum dimension dimension, char text[QUANTITY_TEXT]);

#endif
