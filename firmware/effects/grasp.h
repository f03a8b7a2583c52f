/* Grasping: while the jaws are closed, points that pushed when they closed hold the tissue from both sides, until the jaws open.
 *
 * A held point keeps its place on the surface, whatever the collision says of it since, and its force is free in all three
 * directions (cone.h, CONE_HELD): the tissue is pulled as well as pushed,
 *
 *   d_c = from_c - x_c        x: the tool's point; from: where it would ask nothing of the tissue
 *
 * `from` is set in the tick that takes hold such that the forces of that tick are those that held without it, so closing the jaws
 * alone changes no force; what the tissue has moved since then is a linear spring with the bank's compliance. Beyond `slip_N` a
 * point slips: `from` follows until its force is that, so a pull can only lose energy. Points that touch later, and all of them
 * when the jaws are open, push without friction. Opening lets go at once; the force then falls as fast as the rate limit of
 * coupling.h allows. Validity: shared/effects/grasp.md. */
#ifndef TROCAR_GRASP_H
#define TROCAR_GRASP_H

#include "effects/cone.h"

struct grasp_point {
    bool held;
    uint32_t triangle; /* place, kept while it is held */
    float weights[3], normal[3];
    float from_m[3];
};

struct grasp_jaws {
    uint16_t grip;        /* raw count of the last sample, larger is more closed */
    bool closed, closing; /* closing: in this tick */
};

struct grasp {
    struct grasp_jaws jaws[CONTACT_TOOLS];
    struct grasp_point point[CONTACT_MAX];
    uint32_t taken, slips; /* counters: points taken hold of; ticks of a point that slipped */
};

int grasp_open(struct bank_view *view);

/* The stages of hooks.h. `s`: what the solver is asked, and what it found; `stiffening`: of visco-elastic tissue, else 1. */
void grasp_place(struct grasp *g, const struct bank_view *bank, struct contact_set *set, const struct collide *points);
void grasp_ask(const struct grasp *g, const struct contact_set *set, const struct collide *points,
               struct cone_system *s);
void grasp_follow(struct grasp *g, const struct bank_view *bank, const struct contact_set *set,
                  const struct cone_system *s, const struct collide *points, float stiffening);
void grasp_forget(struct grasp *g, const struct collide *points, uint32_t tool);

#endif
