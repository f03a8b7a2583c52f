#include "quantity.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* value = number * 10^power * times. The power joins the number's exponent before it is converted, so that it is rounded
 * once: "214 mm" is the same double as "0.214 m", and every double has a text in every unit with times = 1. */
struct unit {
    const char *name;
    enum dimension dimension;
    int power;
    double times;
    bool other_spelling; /* read, but neither listed nor printed */
};

static const double DEGREE_rad = 0.017453292519943295;

static const struct unit units[] = {
    {"%", DIMENSION_SHARE, -2, 1, false},
    {"m", DIMENSION_LENGTH, 0, 1, false},
    {"cm", DIMENSION_LENGTH, -2, 1, false},
    {"mm", DIMENSION_LENGTH, -3, 1, false},
    {"Pa", DIMENSION_PRESSURE, 0, 1, false},
    {"kPa", DIMENSION_PRESSURE, 3, 1, false},
    {"MPa", DIMENSION_PRESSURE, 6, 1, false},
    {"GPa", DIMENSION_PRESSURE, 9, 1, false},
    {"kg/m3", DIMENSION_DENSITY, 0, 1, false},
    {"kg/m^3", DIMENSION_DENSITY, 0, 1, true},
    {"kg/m\xC2\xB3", DIMENSION_DENSITY, 0, 1, true},
    {"g/cm3", DIMENSION_DENSITY, 3, 1, false},
    {"g/cm^3", DIMENSION_DENSITY, 3, 1, true},
    {"g/cm\xC2\xB3", DIMENSION_DENSITY, 3, 1, true},
    {"N/m", DIMENSION_STIFFNESS, 0, 1, false},
    {"N/mm", DIMENSION_STIFFNESS, 3, 1, false},
    {"kN/m", DIMENSION_STIFFNESS, 3, 1, false},
    {"N s/m", DIMENSION_DAMPING, 0, 1, false},
    {"Ns/m", DIMENSION_DAMPING, 0, 1, true},
    {"N*s/m", DIMENSION_DAMPING, 0, 1, true},
    {"N", DIMENSION_FORCE, 0, 1, false},
    {"mN", DIMENSION_FORCE, -3, 1, false},
    {"s", DIMENSION_TIME, 0, 1, false},
    {"ms", DIMENSION_TIME, -3, 1, false},
    {"B", DIMENSION_BYTES, 0, 1, false},
    {"KiB", DIMENSION_BYTES, 0, 1024, false},
    {"MiB", DIMENSION_BYTES, 0, 1048576, false},
    {"rad", DIMENSION_ANGLE, 0, 1, false},
    {"deg", DIMENSION_ANGLE, 0, DEGREE_rad, false},
    {"Pa s", DIMENSION_VISCOSITY, 0, 1, false},
    {"kPa s", DIMENSION_VISCOSITY, 3, 1, false},
};
enum { UNIT_COUNT = sizeof units / sizeof units[0] };

static const char *const dimension_name[] = {
    [DIMENSION_NUMBER] = "a plain number", [DIMENSION_RATIO] = "a ratio",         [DIMENSION_SHARE] = "a share",
    [DIMENSION_LENGTH] = "a length",       [DIMENSION_POSITION] = "a position",   [DIMENSION_PRESSURE] = "a pressure",
    [DIMENSION_DENSITY] = "a density",     [DIMENSION_STIFFNESS] = "a stiffness", [DIMENSION_DAMPING] = "a damping",
    [DIMENSION_FORCE] = "a force",         [DIMENSION_TIME] = "a time",           [DIMENSION_BYTES] = "a size",
    [DIMENSION_ANGLE] = "an angle",        [DIMENSION_VISCOSITY] = "a viscosity",
};

/* The dimension whose units a value may carry. */
static enum dimension carried(enum dimension dimension)
{
    if (dimension == DIMENSION_RATIO)
        return DIMENSION_SHARE;
    if (dimension == DIMENSION_POSITION)
        return DIMENSION_LENGTH;
    return dimension;
}

static bool unit_optional(enum dimension dimension)
{
    return dimension == DIMENSION_NUMBER || dimension == DIMENSION_RATIO || dimension == DIMENSION_POSITION;
}

static const char *skip_spaces(const char *p)
{
    while (*p == ' ' || *p == '\t' || *p == '\n' || *p == '\r')
        p++;
    return p;
}

static bool digit(char c)
{
    return c >= '0' && c <= '9';
}

/* A number as it is written: mantissa * 10^exponent. */
struct decimal {
    char mantissa[QUANTITY_TEXT];
    int exponent;
};

/* Behind the number at p, or NULL. "0.10..0.23": a point before a point is not a decimal point. */
static const char *scan_number(const char *p, struct decimal *number)
{
    const char *start = p;
    size_t digits = 0;
    if (*p == '+' || *p == '-')
        p++;
    for (; digit(*p); p++)
        digits++;
    if (*p == '.' && p[1] != '.')
        for (p++; digit(*p); p++)
            digits++;
    size_t length = (size_t)(p - start);
    if (!digits || length >= sizeof number->mantissa)
        return NULL;
    memcpy(number->mantissa, start, length);
    number->mantissa[length] = 0;
    number->exponent = 0;
    if ((*p == 'e' || *p == 'E') && (digit(p[1]) || ((p[1] == '+' || p[1] == '-') && digit(p[2])))) {
        bool negative = *++p == '-';
        if (!digit(*p))
            p++;
        for (; digit(*p); p++)
            if (number->exponent < 9999) /* more is 0 or infinite anyway */
                number->exponent = 10 * number->exponent + (*p - '0');
        if (negative)
            number->exponent = -number->exponent;
    }
    return p;
}

static double number_value(const struct decimal *number, int power)
{
    char text[QUANTITY_TEXT + 16];
    snprintf(text, sizeof text, "%se%d", number->mantissa, number->exponent + power);
    return strtod(text, NULL);
}

static void expected(enum dimension dimension, char *text, size_t size)
{
    size_t used = (size_t)snprintf(text, size, "%s is expected here", dimension_name[dimension]);
    const char *separator = " (";
    for (int i = 0; i < UNIT_COUNT; i++)
        if (units[i].dimension == carried(dimension) && !units[i].other_spelling && used < size) {
            used += (size_t)snprintf(text + used, size - used, "%s%s", separator, units[i].name);
            separator = ", ";
        }
    if (*separator == ',' && used < size)
        snprintf(text + used, size - used, ")");
}

static const struct unit *find_unit(const char *text, size_t length, bool ignore_case)
{
    for (int i = 0; i < UNIT_COUNT; i++)
        if (strlen(units[i].name) == length &&
            (ignore_case ? strncasecmp(units[i].name, text, length) : strncmp(units[i].name, text, length)) == 0)
            return &units[i];
    return NULL;
}

/* Apply the unit of `length` characters at `text` (0: none). */
static int apply_unit(const struct decimal *number, const char *text, size_t length, enum dimension dimension,
                      double *value, char *message, size_t message_size)
{
    char wanted[120];
    expected(dimension, wanted, sizeof wanted);
    static const struct unit none = {.times = 1};
    if (length == 0 && !unit_optional(dimension)) {
        snprintf(message, message_size, "%g has no unit; %s", number_value(number, 0), wanted);
        return STATUS_SCENE_UNIT;
    }
    int shown = length > 24 ? 24 : (int)length;
    const struct unit *unit = length ? find_unit(text, length, false) : &none;
    if (!unit) {
        const struct unit *near = find_unit(text, length, true);
        if (near)
            snprintf(message, message_size, "the unit '%.*s' is not known (capitals matter: %s); %s", shown, text,
                     near->name, wanted);
        else
            snprintf(message, message_size, "the unit '%.*s' is not known; %s", shown, text, wanted);
        return STATUS_SCENE_UNIT;
    }
    if (length && unit->dimension != carried(dimension)) {
        snprintf(message, message_size, "'%.*s' is the unit of %s; %s", shown, text, dimension_name[unit->dimension],
                 wanted);
        return STATUS_SCENE_UNIT;
    }
    *value = number_value(number, unit->power) * unit->times + 0.0; /* + 0.0: there is one zero, not -0 */
    if (isfinite(*value))
        return STATUS_OK;
    snprintf(message, message_size, "the number is too large");
    return STATUS_SCENE_VALUE;
}

static size_t trimmed(const char *text, size_t length)
{
    while (length && strchr(" \t\n\r", text[length - 1]))
        length--;
    return length;
}

static int not_a_number(const char *text, enum dimension dimension, char *message, size_t message_size)
{
    char wanted[120];
    expected(dimension, wanted, sizeof wanted);
    snprintf(message, message_size, "'%.40s' is not a number that is understood; %s", text, wanted);
    return STATUS_SCENE_VALUE;
}

int quantity_parse(const char *text, enum dimension dimension, double *value, char *message, size_t message_size)
{
    struct decimal number;
    const char *rest = scan_number(skip_spaces(text), &number);
    if (!rest)
        return not_a_number(text, dimension, message, message_size);
    rest = skip_spaces(rest);
    return apply_unit(&number, rest, trimmed(rest, strlen(rest)), dimension, value, message, message_size);
}

int quantity_parse_range(const char *text, enum dimension dimension, double range[2], char *message,
                         size_t message_size)
{
    struct decimal first, second;
    const char *rest = scan_number(skip_spaces(text), &first);
    if (!rest)
        return not_a_number(text, dimension, message, message_size);
    const char *first_unit = skip_spaces(rest), *dots = strstr(rest, "..");
    if (!dots) {
        snprintf(message, message_size, "'%.40s' is one value; a range A..B is expected", text);
        return STATUS_SCENE_VALUE;
    }
    size_t first_length = dots > first_unit ? trimmed(first_unit, (size_t)(dots - first_unit)) : 0;
    rest = scan_number(skip_spaces(dots + 2), &second);
    if (!rest)
        return not_a_number(text, dimension, message, message_size);
    const char *unit = skip_spaces(rest);
    size_t length = trimmed(unit, strlen(unit));
    int status = apply_unit(&second, unit, length, dimension, &range[1], message, message_size);
    if (status)
        return status;
    if (first_length)
        return apply_unit(&first, first_unit, first_length, dimension, &range[0], message, message_size);
    return apply_unit(&first, unit, length, dimension, &range[0], message, message_size);
}

/* value / 10^power with the fewest digits that read back to the same double (17 always do), without an exponent where that
 * stays readable. */
static void print_number(double value, int power, char *text, size_t size)
{
    char scientific[32], digits[19] = ""; /* at most 17 digits */
    static const char zeros[] = "000000000000000";
    int count = 0, kept = 0;
    do
        snprintf(scientific, sizeof scientific, "%.*e", count++, fabs(value));
    while (count < 17 && strtod(scientific, NULL) != fabs(value));
    for (const char *p = scientific; *p && *p != 'e'; p++)
        if (digit(*p) && kept < 18)
            digits[kept++] = *p;
    while (kept > 1 && digits[kept - 1] == '0')
        kept--;
    digits[kept] = 0;
    int point = atoi(strchr(scientific, 'e') + 1) - power; /* the value is D.DDD * 10^point */
    const char *sign = value < 0 ? "-" : "";
    if (value == 0)
        snprintf(text, size, "0");
    else if (point < -6 || point >= 15)
        snprintf(text, size, "%s%c%s%se%d", sign, digits[0], kept > 1 ? "." : "", digits + 1, point);
    else if (point < 0)
        snprintf(text, size, "%s0.%.*s%s", sign, -point - 1, zeros, digits);
    else if (kept <= point + 1)
        snprintf(text, size, "%s%s%.*s", sign, digits, point + 1 - kept, zeros);
    else
        snprintf(text, size, "%s%.*s.%s", sign, point + 1, digits, digits + point + 1);
}

void quantity_print(double value, enum dimension dimension, char text[QUANTITY_TEXT])
{
    char candidate[QUANTITY_TEXT], number[QUANTITY_TEXT], message[200];
    text[0] = 0;
    if (unit_optional(dimension))
        print_number(value, 0, text, QUANTITY_TEXT);
    if (dimension == DIMENSION_POSITION)
        return; /* all coordinates in one unit read better than the shortest of each */
    for (int i = 0; i < UNIT_COUNT; i++) {
        if (units[i].dimension != carried(dimension) || units[i].other_spelling)
            continue;
        print_number(value / units[i].times, units[i].power, number, sizeof number);
        snprintf(candidate, sizeof candidate, "%.40s %s", number, units[i].name);
        double back; /* may differ where `times` rounds: then another unit is taken */
        if (quantity_parse(candidate, dimension, &back, message, sizeof message) == STATUS_OK && back == value &&
            (!text[0] || strlen(candidate) < strlen(text)))
            memcpy(text, candidate, sizeof candidate);
    }
}
