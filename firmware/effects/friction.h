/* Coulomb friction with sticking: |f_t| <= mu f_n at every point in contact, solved with its normal force (cone.h).
 *
 * A point that pushes has an anchor: the point of the surface that it took hold of. While it sticks the anchor stays, however
 * the tool moves, and the tissue is asked to follow the tool there:
 *
 *   d_c = depth n_c + stretch_c,   depth = n_c . (anchor - point),   stretch -= motion of the point across n_c, each tick
 *
 * Sticking is a spring fixed at two ends: no energy is made. When the force reaches the cone the point slides: the stretch is
 * shortened to what friction can hold, along the force, so sliding only takes energy; and the anchor follows to where the
 * frictionless contact is (collide.h), nearer by as much as the point slid. So with mu -> 0 this becomes the frictionless
 * contact, and taking hold, sliding and letting go change the force continuously. A point that does not push forgets its
 * anchor.
 *
 * Validity: small displacements; the anchor's normal is that of the rest surface; the stretch should stay below the surface's
 * radius of curvature (it is at most about mu times the depth). shared/effects/friction.md. */
#ifndef TROCAR_FRICTION_H
#define TROCAR_FRICTION_H

#include "effects/cone.h"

/* An anchor lags by at most this times mu times the depth: as much as friction can hold back a body whose tangential
 * compliance is twice the normal one. What is more comes of the body's moving as a whole under the push, which the frictionless
 * contact does not follow either. A lag e on a surface of curvature c changes the depth by c e per slide, so energy is taken, not
 * made, while e < mu / c: down to a depth of half the radius of curvature. */
#define FRICTION_TRAIL 2.0f

struct friction_point {
    bool holds, slides; /* it pushed in the last tick; its anchor goes along with it */
    uint32_t triangle;
    float weights[3];   /* anchor */
    float point_m[3];   /* where the tool's point was */
    float stretch_m[3]; /* across the normal */
    float trail_m[3];   /* across the normal: anchor minus that without friction */
};

struct friction {
    struct friction_point point[CONTACT_MAX]; /* per point of the tool */
};

int friction_open(struct bank_view *view);

/* The stages of hooks.h. `s`: what the solver is asked, and what it found; `stiffening`: of visco-elastic tissue, else 1. */
void friction_place(struct friction *f, const struct bank_view *bank, struct contact_set *set,
                    const struct collide *points);
void friction_ask(const struct friction *f, const struct bank_view *bank, const struct contact_set *set,
                  struct cone_system *s);
void friction_follow(struct friction *f, const struct contact_set *set, const struct cone_system *s, float stiffening);
void friction_forget(struct friction *f, const struct collide_range *points);

#endif
