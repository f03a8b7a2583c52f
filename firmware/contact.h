/* The contact system: unilateral, frictionless, quasi-static, in compliance form.
 *
 * m contacts with normals n_c (outward), anchors with weights over three vertices, depths d_c of the device's points:
 *   C_cd = n_c . (sum_ij w_ci w_dj G_ij) n_d          tissue compliance between contacts
 *   A    = C + (n_c . n_d) / k + epsilon I            plus the virtual coupling k (a rigid tool on a spring to the hand)
 *   A p - d >= 0,  p >= 0,  p.(A p - d) = 0           p: normal force on the tissue; it pushes, it does not pull
 * A is positive definite for every set of contacts, coincident ones included (Gram matrices plus epsilon). The proxy is
 * the device's tip displaced by sum p n / k; the tissue's displacement at contact c is (C p)_c along n_c and follows in
 * all three components from G. */
#ifndef TROCAR_CONTACT_H
#define TROCAR_CONTACT_H

#include <stdbool.h>
#include <stdint.h>

#include "bank_view.h"
#include "collide.h"

enum {
    CONTACT_MAX = BANK_MAX_TOOL_POINTS,
    CONTACT_MAX_FACTORS = 3 * CONTACT_MAX /* factorisations that the active-set method may take in one tick */
};

struct contact {
    uint32_t point;          /* of the tool */
    uint32_t triangle;
    float weights[3];
    float normal[3];
    float depth_m;           /* imposed by the device */
    float pressure_N;        /* p_c >= 0 */
    float displacement_m[3]; /* of the tissue at the anchor, all three components, epsilon p n included */
};

struct contact_set {
    uint32_t count;
    struct contact contact[CONTACT_MAX];
    float system[CONTACT_MAX][CONTACT_MAX]; /* A */
    uint32_t active;          /* bit per tool point: carried over, so that the next tick starts from this tick's answer */
    uint32_t factors;         /* factorisations of this tick */
    uint32_t cut;             /* counter: ticks in which the method stopped at its bound (with a feasible force) */
    float force_N[3];         /* on the tool: sum p n */
    float proxy_offset_m[3];  /* proxy tip minus device tip */
};

/* Gather touching points, assemble, solve, and evaluate. */
void contact_update(struct contact_set *s, const struct bank_view *bank, const struct collide *points);

/* The solver alone: minimise 1/2 p.A p - d.p over p >= 0 for an m x m positive definite A (m <= CONTACT_MAX) by an
 * active-set method that keeps p feasible at every step. `active` in: first guess; out: the set. Returns factorisations
 * used; *cut when it stopped at CONTACT_MAX_FACTORS. */
uint32_t contact_solve(const float (*A)[CONTACT_MAX], const float *d, uint32_t m, uint32_t *active, float *p, bool *cut);

#endif
