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

/* What is reported, and decides whether a limit holds, is drawn from COMPRESSION_SEED; what steers the search for a step from
 * another, so that the step is not fitted to the contacts on which it is judged. */
enum { COMPRESSION_TRIALS = 400, COMPRESSION_SEED = 1, COMPRESSION_SEARCH_SEED = 7001 };

/* What is asked for: all zero is FACT with COMPRESSION_STEP. */
struct compression {
    bool plain;         /* GHLF instead */
    double step;        /* COMPRESSION_STEP_MIN .. COMPRESSION_STEP_MAX; 0: find it, the default without limits */
    double force_error; /* limit of the p95 of a patch (compression_error.h); 0: none */
    double bytes;       /* limit of the whole bank; 0: none */
    double rest_bytes;  /* of the bank beside section FACT, at most */
};

struct compressed {
    struct order order;
    double step; /* relative, as found */
    unsigned char *bytes;
    size_t length; /* of section FACT */
    /* For a limit of bytes, what the default step would take: 0 when there is none. */
    double default_bytes, default_error; /* of the whole bank; p95 of a patch */
};

/* Bytes that a section takes in a bank. */
double compression_padded(size_t length);

/* `position`: 3 per row of G, m. `surface`: row_of numbers the rows of G here. With a limit of bytes: the least
 * force error within it; with one of the force error alone: the least bytes. BANK_LIMIT when limits cannot be met, or not
 * together, or not by the given step; it names the nearest that can. MEMORY, INTERRUPTED, MODEL_FACTOR. Memory: one square of
 * 9 rows^2 doubles beside G. Every try costs a rounding, and a code for bytes or 400 patches for the error. */
int compress_compliance(const struct compliance *G, const double *position, const struct contact_surface *surface,
                        const struct compression *wanted, bool quiet, struct compressed *compressed,
                        struct failure *why);
void compressed_free(struct compressed *compressed);

#endif
