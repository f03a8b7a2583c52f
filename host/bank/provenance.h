/* Section PROV: how a bank was made, as a YAML document of one mapping. The scene's text in it is a literal block whose
 * value is exactly the text that the header's scene_hash sums. Keys that are not known are skipped. */
#ifndef TROCAR_PROVENANCE_H
#define TROCAR_PROVENANCE_H

#include <stddef.h>
#include <stdint.h>

#include "failure.h"

struct provenance {
    char *scene;               /* the scene's text; malloc, NULL when absent */
    char program[64];          /* "trocar 0.1.0" */
    char mesh_path[1024];      /* as the user gave it */
    char mesh_from_bank[1024]; /* the same file, relative to the folder that the bank was written to; "" when unknown */
    char discretisation[64];
    uint64_t nodes, tetrahedra;
    double build_seconds;
    double force_error_p95, force_error_max; /* relative, of a patch (compression_error.h); negative: not measured */
    double step;                             /* of the compression (compression.h); 0: none */
    char measured[200];                      /* of every kind, in per cent: p95 and maximum (compression_error_print) */
};

/* YAML text (malloc) and its length. */
int provenance_print(const struct provenance *provenance, char **text, size_t *length, struct failure *why);
/* Read `length` bytes back; `place` names the file in messages. STATUS_BANK_SECTION when it is not such a document. */
int provenance_parse(const char *text, size_t length, const char *place, struct provenance *provenance,
                     struct failure *why);
void provenance_free(struct provenance *provenance);

#endif
