/* From the compliance to section FACT: order, factor, rounding, code; and the search for the coarsest rounding whose forces
 * are still good enough. */
#ifndef TROCAR_COMPRESSION_H
#define TROCAR_COMPRESSION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "compression_error.h"
#include "failure.h"
#include "model.h"
#include "order.h"
#include "rounding.h"

/* Rounding of neighbouring blocks relative to the median diagonal of the factor, when nothing else is asked for: about
 * 0.5 % of the forces of a patch (p95) on livers of 1000 to 3000 surface nodes. */
#define COMPRESSION_STEP     1.25e-3
#define COMPRESSION_STEP_MIN 2e-5
#define COMPRESSION_STEP_MAX 0.05

enum { COMPRESSION_TRIALS = 400, COMPRESSION_SEED = 1 };

/* What is asked for: all zero is the default, FACT with COMPRESSION_STEP. */
struct compression {
    bool plain;         /* GHLF instead */
    double step;        /* COMPRESSION_STEP_MIN .. COMPRESSION_STEP_MAX; 0: the default */
    double force_error; /* find the step for this p95 of a patch (compression_error.h); 0: do not */
};

struct compressed {
    struct order order;
    double step; /* relative, as found */
    unsigned char *bytes;
    size_t length; /* of section FACT */
};

/* `position`: 3 per row of G, m. `surface`: row_of numbers the rows of G here. CHECK_FAILED when the force error cannot be
 * reached, naming the nearest; MEMORY, INTERRUPTED, MODEL_FACTOR. Memory: one square of 9 rows^2 doubles beside G. */
int compress_compliance(const struct compliance *G, const double *position, const struct contact_surface *surface,
                        const struct compression *wanted, bool quiet, struct compressed *compressed,
                        struct failure *why);
void compressed_free(struct compressed *compressed);

#endif
