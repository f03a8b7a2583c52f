/* Contacts whose forces have three components, each kept in its cone: the solver that friction and grasping share.
 *
 *   A_cd = B_cd + I / k [same tool] + epsilon_c I [c = d],  B as in contact.h;  3x3, m/N; symmetric positive definite as a whole
 *   epsilon_c as in contact.h, of trace(B_cc) / 3
 *   r_c  = sum_d A_cd f_d - d_c                                      what is left between tool and tissue, m
 *
 * d_c: displacement that the tool asks of the tissue at contact c, m; f_c: force of the tissue on the tool, N; n_c its
 * outward normal, mu_c its coefficient of friction. With the normal and tangential parts of each:
 *
 *   f_n >= 0, r_n >= 0, f_n r_n = 0;  |f_t| <= mu f_n;  r_t = - slip f_t with slip >= 0, and slip = 0 inside the cone
 *
 * This is Coulomb's law (Signorini's in the normal direction), not its associated relaxation: sliding opens no gap. Where
 * mu_c = CONE_HELD the force is free and r_c = 0: a contact that is held from both sides.
 *
 * Method: block Gauss-Seidel; each contact in turn is solved exactly for the others' forces (one 3x3 product when it sticks; a
 * secular equation in `slip`, as of a trust region, when it slides), starting from the last tick's forces. Every contact's
 * force is in its cone after every step, so the solver may stop anywhere. With mu = 0 it is projected Gauss-Seidel on
 * the frictionless problem of contact.h. For mu <= 2 and compliances whose normal and tangential parts are coupled as
 * weakly as those of elastic bodies the local problem has one answer; where it has more, the open one is taken.
 *
 * Work on a Cortex-M7, m contacts with rows at hand: see shared/effects/friction.md. */
#ifndef TROCAR_CONE_H
#define TROCAR_CONE_H

#include "contact.h"

#define CONE_HELD (-1.0f)

enum { CONE_SLIDE_STEPS = 8 /* of the secular equation; three are typical, one when warm */ };

enum cone_state { CONE_OPEN, CONE_STICK, CONE_SLIDE };

struct cone_contact {
    uint32_t tool;     /* on whose coupling it hangs */
    float pad_m_N;     /* epsilon_c */
    float frame[3][3]; /* normal, two tangents; world */
    float mu;          /* or CONE_HELD */
    float wanted_m[3]; /* d, world */
    float force_N[3];  /* f, world; in: where to start; out: the answer */
    enum cone_state state;
    float slip_m_N; /* of a contact that slides */
    /* with `levers` of the system: the force at the tip that is equal in virtual work to a unit force along each axis */
    IF_SHAPE(float lever[3][3];)
    /* of the local problem; 0 normal, 1 and 2 tangential: A_cc, its inverse, and its Schur complement on 1, 2 */
    float local[6], inverse[6], schur[3]; /* 00 01 02 11 12 22; 11 12 22 */
};

/* A contact with what does not give way (rigid.h), frictionless: its force p along the pulls is another unknown,
 *   p >= 0, r = sum_t pull_t . (force on tool t) / k + pad p - depth >= 0, p r = 0,   solved for p in its turn. */
IF_RIGID(struct cone_rigid { float pull[CONTACT_TOOLS][3], pad_m_N, depth_m, force_N; };)

struct cone_system {
    uint32_t count;
    IF_RIGID(uint32_t rigid; struct cone_rigid hard[CONTACT_MAX];)
    IF_SHAPE(bool levers;)          /* else forces act at the tip */
    float softness_m_N;             /* 1 / k */
    float tool_N[CONTACT_TOOLS][3]; /* sum of f_c on each tool */
    struct cone_contact contact[CONTACT_MAX];
    uint32_t sweeps; /* of this tick */
};

/* What a controller keeps of it. */
struct cone {
    struct cone_system system; /* contacts in the order of the contact set */
    struct cone_point {
        float force_N[3]; /* of the last tick: where the solver starts */
        float slip_m_N;
    } point[CONTACT_MAX];
    IF_RIGID(float hard_N[CONTACT_MAX];) /* the same of the rigid contacts, by their places (contact.point) */
};

/* What a force on a contact is at the tip of its tool, and how far the contact gives way when the tip does. */
static inline void cone_at_tip(const struct cone_system *s, const struct cone_contact *c, const float force_N[3],
                               float tip_N[3])
{
    (void)s, (void)c;
    for (int a = 0; a < 3; a++) /* bound: 3 */
        tip_N[a] = force_N[a];
    IF_SHAPE(if (s->levers) for (int a = 0; a < 3; a++) /* bound: 3 */
             tip_N[a] = c->lever[0][a] * force_N[0] + c->lever[1][a] * force_N[1] + c->lever[2][a] * force_N[2];)
}

static inline void cone_at_contact(const struct cone_system *s, const struct cone_contact *c, const float tip_m[3],
                                   float out_m[3])
{
    (void)s, (void)c;
    for (int a = 0; a < 3; a++) /* bound: 3 */
        out_m[a] = tip_m[a];
    IF_SHAPE(if (s->levers) for (int a = 0; a < 3; a++) /* bound: 3 */
             out_m[a] = c->lever[a][0] * tip_m[0] + c->lever[a][1] * tip_m[1] + c->lever[a][2] * tip_m[2];)
}

/* The contacts of `set`, in its order, whose blocks are assembled, as they are without an effect: without friction, d = depth n. What
 * an effect asks else it then writes into mu and wanted_m. `b` as for contact_push. */
void cone_ask(struct cone *k, const struct contact_set *set, const struct bank_contact *b);

/* Solve, and what the forces are to the set: of each contact, force and proxy of each tool, which points push. */
void cone_push(struct cone *k, struct contact_set *set, const struct bank_contact *b, uint32_t sweeps);

void cone_forget(struct cone *k, const struct collide_range *points);

/* The frame of a contact with this outward unit normal. */
void cone_frame(struct cone_contact *c, const float normal[3]);

/* Sweep until no force moves by more than CONE_TOLERANCE of the largest, or `sweeps` times. `block`: B of contact.h. The members above
 * `state`, and slip_m_N, are set for every contact (forces need not be in their cones). Returns whether it came to rest. */
#define CONE_TOLERANCE 1e-4f
bool cone_solve(struct cone_system *s, const float (*block)[9], uint32_t sweeps);

#endif
