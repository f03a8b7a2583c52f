/* Visco-elastic tissue: every modulus of the body relaxes alike, g(t) = 1 + sum_b g_b exp(-t/tau_b), relative to its
 * equilibrium, which the bank's compliance G describes (Prony series; Ferry, Viscoelastic Properties of Polymers, ch. 3).
 *
 * Linear visco-elasticity with one g: a point of the surface whose displacement into the body was u(s) until now is
 * answered as an elastic body answers w = int g(t - s) du(s) (the correspondence principle). So with forces p on points
 * that stay the same
 *
 *   G p = w,    w = u + sum_b h_b,    h_b <- a_b h_b + c_b (u - u'),    a_b = exp(-T/tau_b), c_b = g_b tau_b (1 - a_b)/T
 *
 * where ' is the last tick: exact for a u that is piecewise linear between ticks, for any T/tau (Taylor, Pister,
 * Goudreau 1970). a = 0, c = C/T is a dashpot (Kelvin and Voigt). With C = 1 + sum c_b and the memory
 * m = sum a_b h'_b - sum c_b u', known before the tick, w = C u + m. A tool that pushes and does not pull:
 *
 *   u >= d - S p,  p >= 0,  p . (u - d + S p) = 0       d depth of the tool's point; S = coupling and regularisation
 *   <=>  (G + C S) p - (C d + m) >= 0, p >= 0, complementary
 *
 * which is contact.h's problem with another coupling and other depths, as positive definite as before: contact_push solves
 * it as it is. Where p = 0 the tissue is in front of the tool (u > d) and goes back by itself: a tool that is drawn back
 * faster than the tissue follows leaves it, and never pulls.
 *
 * Passive for every a in [0, 1), c >= 0 and every sequence of contact sets of given points: the work of a branch by the
 * trapezoidal rule, sum (f + f')/2 (u - u'), has the transfer function c (1 + z)/(2 (1 - a z)) with real part
 * c (1 - a)(1 + cos)/(2 |1 - a z|^2) >= 0, and the rest is elastic.
 *
 * Per point of the tool: u and h_b, as vectors. They travel with its anchor. The tissue of a point that has left goes
 * on under the others' forces, as these moved it when it left (w in proportion to the sum of their p); the point takes up
 * with it when it comes back to within reach_m of where it left, and knows nothing elsewhere. A point that comes upon tissue that others have
 * displaced takes over the ratio of u and h_b to w that they have on average (weighted by p w). Validity and limits:
 * shared/effects/viscoelastic.md. */
#ifndef TROCAR_VISCOELASTIC_H
#define TROCAR_VISCOELASTIC_H

#include "contact.h"

struct viscoelastic_point {
    bool remembers, in_set;               /* its tissue is not at rest; it was part of the system in the last tick */
    float anchor_m[3];                    /* on the surface at rest, when it was last touched */
    float moved_m[3];                     /* u of the tissue, world */
    float memory_m[BANK_MAX_BRANCHES][3]; /* h_b, world */
    float others_m_N[3];                  /* w by the other contacts, per newton of the sum of their p */
};

/* a_b, c_b for a step of some ticks, and C. */
struct viscoelastic_step {
    uint32_t branches;
    float decay[BANK_MAX_BRANCHES], gain[BANK_MAX_BRANCHES], total;
};

struct viscoelastic {
    bool started;
    uint32_t tick;                                /* of the last push */
    struct viscoelastic_point point[CONTACT_MAX]; /* per point of the tool */
    /* of this tick, between asking and following: */
    struct viscoelastic_step step;
    struct bank_contact contact; /* S scaled by C: what the push takes for the bank's */
    float memory_m[CONTACT_MAX][3], depth_m[CONTACT_MAX];
    uint32_t fresh; /* bit per contact that comes upon tissue of which nothing is known */
};

/* STATUS_BANK_SECTION in a bank that names swing too: they do not go together yet. */
int viscoelastic_open(struct bank_view *view);

/* The stages of hooks.h. `tick`: number of this tick; the ones since the last push had no sample. What the contacts know; */
void viscoelastic_ask(struct viscoelastic *v, const struct bank_view *bank, const struct contact_set *set,
                      const struct collide *points, uint32_t tick);
/* depths and epsilon of the problem above, for contact_push with v->contact; */
void viscoelastic_deepen(const struct viscoelastic *v, struct contact_set *set);
/* or what friction and jaws ask, likewise, of contact c; */
void viscoelastic_want(const struct viscoelastic *v, uint32_t c, float wanted_m[3]);
/* and after the push what the tissue remembers of it. */
void viscoelastic_follow(struct viscoelastic *v, const struct bank_view *bank, struct contact_set *set);
void viscoelastic_forget(struct viscoelastic *v, const struct collide_range *points);

#endif
