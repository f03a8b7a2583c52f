/* A setting made real: the body's exact compliance, the bank that is stored of it, and that bank with another tip or solver
 * bound without building it again. Banks lie in a folder that is gone at the end. */
#ifndef TROCAR_CANDIDATE_H
#define TROCAR_CANDIDATE_H

#include "bank.h"
#include "compression_error.h"
#include "knob.h"

/* Everything of the stage BODY. Not to be moved in memory. */
struct discretisation {
    struct body body;
    struct compliance compliance;
    struct mesh_report mesh;
    double seconds; /* that reading, assembling and the compliance took */
};
/* `scene` with its instruments placed or not; on return of the first call they are, in discretisation.body.scene. */
int discretise(const struct scene *scene, const struct setting *setting, bool quiet, struct discretisation *d,
               struct failure *why);
void discretisation_free(struct discretisation *d);

struct candidate {
    struct bank_file bank;
    struct bank_view view; /* as the controller sees it: rows not decoded */
    char path[300];
    double seconds;                 /* of storing it */
    struct compression_error error; /* of what is stored, against the discretisation's exact compliance */
};
/* The bank of a setting in `folder`, with the errors of `trials` random contact sets of each kind from `seed`; none are
 * measured for 0 trials. */
int candidate_make(struct discretisation *d, const struct setting *setting, const char *folder, size_t trials,
                   uint64_t seed, bool quiet, struct candidate *candidate, struct failure *why);
/* The controller's stage set anew: TOOL and CONT of the bank in memory and in its file. */
int candidate_retool(struct candidate *candidate, struct body *body, const struct setting *setting,
                     struct failure *why);
/* The bound of its worst tick, in instructions (worst_tick.h). */
double candidate_worst_tick(const struct candidate *candidate, const struct body *body, const struct setting *setting);
void candidate_free(struct candidate *candidate);

#endif
