/* What accuracy costs in time and bytes, measured: for every setting of the plan (knob.h) the errors, the work of a tick, the
 * bank's size and the time to build it, on one recording of one gesture.
 *
 * Errors are relative and each says its reference:
 *   bank    forces of random contact sets, and the displacement field, of what is stored: against the exact solve of the
 *           same discretisation in double precision (compression_error.h)
 *   tick    the force of every tick of the recording: against the controller with every knob at its most accurate value on
 *           the plain bank (float32) of the same discretisation; relative to the largest force
 *   solver  the force of every tick: against the same tick with a solver that goes on to its rest (solver_error.h)
 *   mesh    the stiffness under a tool of the scene's radius, and of 20 mm: against the scene's mesh refined once, quadratic (mesh_error.h)
 * No error of one reference is added to another's. */
#ifndef TROCAR_TRADEOFF_H
#define TROCAR_TRADEOFF_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "compression_error.h"
#include "knob.h"
#include "mesh_error.h"

#define TRADEOFF_TICK_REFERENCE                                                                                        \
    "the same discretisation's plain bank with the controller at its most accurate setting, tick by tick"

#define TRADEOFF_SOLVER_REFERENCE                                                                                      \
    "the same tick, from the same state and on the same bank, with a contact solver that goes on to its rest"

#define TRADEOFF_MESH_REFERENCE                                                                                        \
    "the scene's mesh with every tetrahedron cut into eight, quadratic, under a tool of the scene's radius at random " \
    "sites"

#define TRADEOFF_WIDE_TOOL_m 0.02

struct tradeoff_options {
    bool quick, quiet;
    double limit_s;         /* after so long the settings that are left are left out; 0: no limit */
    const char *gesture;    /* NULL: slide */
    const char *controller; /* NULL: beside this program */
    uint64_t seed;
};

struct section_size {
    char tag[5];
    double bytes;
};

/* Numbers that were not measured are NAN. All are rounded to four significant digits, so that what is shown, what is
 * written and what is advised are the same numbers. */
struct tradeoff_point {
    struct setting setting;
    char name[160];
    double surface_nodes, bytes, bytes_per_node, build_s, store_s;
    size_t sections;
    struct section_size section[BANK_MAX_SECTIONS];
    struct error_figures bank[COMPRESSION_ERROR_KINDS];
    double tick_p95, tick_max, solver_p95, solver_max;
    struct mesh_error
        mesh[MESH_ERROR_RADII]; /* under the scene's tool and a wide one; NAN too for the reference itself */
    double worst_bound;         /* instructions of a Cortex-M7's worst tick at most: worst_tick.h */
    double instructions_mean, instructions_max; /* per tick in contact */
    double load_mean, load_max;                 /* instructions per millisecond: the same times the rate */
    double ns_mean, ns_max;
    double contacts, factors; /* largest of a tick */
    double waits;             /* contacts that waited for their rows, in the whole recording */
    double state_bytes;       /* that the controller keeps in RAM: its state and the memory for rows */
    double cut;               /* ticks in which the solver stopped at its bound */
    bool front_time,
        front_bytes; /* on the Pareto front of load_max (or ns_max) and tick_p95; of bytes and the patch error */
};

enum tradeoff_budget { BUDGET_BYTES, BUDGET_INSTRUCTIONS, BUDGET_SCENE };

struct tradeoff_advice {
    enum tradeoff_budget of; /* BUDGET_SCENE: all that the scene's budget says */
    double limit;
    size_t pick; /* a point; `points` of the result when none is within */
    char text[400];
};
enum { TRADEOFF_MAX_ADVICE = 16 };

struct tradeoff {
    char scene[64], mesh[256], gesture[64], instructions_reason[200];
    bool quick, instructions_known;
    double seconds, ticks, contact_ticks, trials, left_out, seed;
    double tool_radius_m[MESH_ERROR_RADII], sites;                /* of the mesh error; 0 sites: not measured */
    double budget_bytes, budget_instructions, budget_force_error; /* of the scene; 0: none */
    char left_out_why[600];                                       /* of the first setting that was left out */
    size_t points;
    struct tradeoff_point *point; /* malloc; the first is what the scene says */
    size_t advices;
    struct tradeoff_advice advice[TRADEOFF_MAX_ADVICE];
};

/* Measure. STATUS_INTERRUPTED when interrupted; nothing is left behind. */
int tradeoff_measure(const struct scene *scene, const struct tradeoff_options *options, struct tradeoff *result,
                     struct failure *why);
void tradeoff_free(struct tradeoff *result);

/* Fronts and advice from the points (also for synthetic ones, in tests). */
int tradeoff_judge(struct tradeoff *result, struct failure *why);

/* To four significant digits; NAN stays. */
double tradeoff_round(double value);

#endif
