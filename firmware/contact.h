/* The contact system: unilateral, frictionless, quasi-static, in compliance form.
 *
 * m contacts with outward normals n_c, anchors with weights w_ci over three vertices, depths d_c of the device's points:
 *
 *   B_cd = sum_ij w_ci w_dj G_ij                      displacement of anchor c under a unit force at anchor d
 *   A_cd = n_c . B_cd n_d + (n_c . n_d) / k + epsilon_c [c = d]
 *   A p - d >= 0,  p >= 0,  p . (A p - d) = 0         p_c: normal force, N; a tool pushes, it does not pull
 *
 * epsilon_c = epsilon max(1, n_c . B_cc n_c / G), with the bank's epsilon and its typical compliance G: far from where a body is held a
 * point gives way up to a hundred times as much as the typical one, and single precision tells its neighbours apart only by as
 * much more.
 *
 * k is the virtual coupling: a rigid tool (the proxy) hangs on the device by a spring, and its share of the depth is
 * solved together with the tissue's. So the hand never feels more than k, and a contact is never lost for stiffness.
 * A is the sum of three Gram matrices, hence positive definite for every set of contacts, coincident ones included, with
 * smallest eigenvalue >= epsilon: |p| <= |d| / epsilon.
 *
 * Two instruments in one body (effects/second.h) are one system: their contacts meet in the tissue's compliance, and each hangs
 * on its own device. `pull` says how: the force at the tip of an instrument that is equal in virtual work to a unit push
 * along a contact's normal; the normal itself, and nothing of the other instrument, unless an effect says otherwise. Then
 *
 *   A_cd = n_c . B_cd n_d + sum_t pull_ct . pull_dt / k + epsilon_c [c = d],    force on instrument t: sum_c p_c pull_ct
 *
 * Sizes: m <= CONTACT_MAX. Work: a block of the bank for each vertex of one contact and each corner of another, each pair once,
 * as B_dc is the transpose of B_cd; then at most the bank's solver_steps factorisations of m^3/6 products, stopping early with
 * a feasible p. */
#ifndef TROCAR_CONTACT_H
#define TROCAR_CONTACT_H

#include <stdbool.h>
#include <stdint.h>

#include "bank_view.h"
#include "collide.h"
#include "effects/image.h"
#include "row_cache.h"

#define CONTACT_FORESIGHT_S 0.05f

enum {
    CONTACT_MAX = BANK_MAX_TOOL_POINTS,
    CONTACT_MAX_FACTORS =
        BANK_MAX_SOLVER_STEPS, /* 3 CONTACT_MAX: steps that the active-set method may take in a tick */
    CONTACT_PAIRS = CONTACT_MAX * (CONTACT_MAX + 1) / 2,
    CONTACT_CORNERS = 3 * CONTACT_MAX,
    CONTACT_TOOLS = COLLIDE_TOOLS /* instruments that the image serves at once */
};

struct contact {
    uint32_t point;           /* of all tools (collide.h) */
    IF_SECOND(uint32_t tool;) /* whose it is */
    uint32_t triangle;
    float weights[3];
    uint8_t slot[3];  /* of the rows of its vertices; of no use with a plain bank */
    float normal[3];  /* outward */
    float depth_m;    /* of the device's point below the anchor */
    float pad_m_N;    /* epsilon_c */
    float pressure_N; /* p_c >= 0 */
    float force_N[3]; /* of the tissue on the tool: p n, or more with an effect */
    IF_PULL(float pull[CONTACT_TOOLS][3];)
    /* of the tissue at the anchor, epsilon p n included, so that G W p + epsilon p gives it back */
    float displacement_m[3];
};

/* The anchor with which a point was last part of the system. */
struct contact_hold {
    bool valid;
    uint32_t triangle;
    float weights[3];
};

struct contact_set {
    uint32_t count;
    IF_RIGID(uint32_t rigid;) /* further contacts behind these, of things that do not give way (effects/rigid.h) */
    struct contact contact[CONTACT_MAX];
    struct contact_hold hold[CONTACT_MAX]; /* per tool point */
    uint8_t in_use[ROW_CACHE_SLOTS];       /* slots of the rows in the system */
    uint32_t in_use_count;
    float block[CONTACT_PAIRS][9]; /* B_cd, c >= d, at contact_pair(c, d): W_c^t G W_d, row-major, world, m/N */
    float system[CONTACT_MAX][CONTACT_MAX]; /* A */
    uint32_t active;                        /* bit per tool point: the next tick starts from this tick's answer */
    uint32_t factors;                       /* factorisations of this tick */
    uint32_t cut;           /* counter: ticks in which the method stopped at its bound, with a feasible force */
    uint32_t held, waiting; /* counters: contacts on their last anchor, and contacts left out, for lack of rows */
    float force_N[CONTACT_TOOLS][3];        /* on each tool: sum p_c pull_c */
    float proxy_offset_m[CONTACT_TOOLS][3]; /* proxy's tip minus device's tip: force / k */
};

static inline uint32_t contact_pair(uint32_t high, uint32_t low)
{
    return high * (high + 1) / 2 + low;
}

static inline uint32_t contact_tool(const struct contact *c)
{
    uint32_t tool = 0;
    (void)c;
    IF_SECOND(tool = c->tool;)
    return tool;
}

/* The force at the tip of a tool for a unit push along this contact's normal. */
static inline const float *contact_pull(const struct contact *c, uint32_t tool)
{
    static const float none[3] = {0.0f, 0.0f, 0.0f};
    const float *pull = contact_tool(c) == tool ? c->normal : none;
    IF_PULL(pull = c->pull[tool];)
    return pull;
}

static inline void contact_turn(struct contact *c, const float normal[3])
{
    for (int k = 0; k < 3; k++) { /* bound: 3 */
        c->normal[k] = normal[k];
        IF_PULL(c->pull[contact_tool(c)][k] = normal[k];)
    }
}

/* Of tissue, and all that push: rigid ones have no block, and only contact_push sees them. */
static inline uint32_t contact_all(const struct contact_set *s)
{
    uint32_t all = s->count;
    IF_RIGID(all += s->rigid;)
    return all;
}

/* One tick, in four steps between which an effect may do its part: the touching points as contacts; */
void contact_gather(struct contact_set *s, const struct collide *points);

/* those whose rows are there. With a factor bank a contact needs its rows prepared within the tick's work (row_cache.h);
 * those that pushed last tick choose first. Where a contact has slid onto rows that are not ready, it is held on its last
 * anchor with its new depth and normal; one that has just begun is left out until they are. */
void contact_admit(struct contact_set *s, struct row_cache *g, const struct bank_view *bank);

/* their response to each other; */
void contact_assemble(struct contact_set *s, const struct row_cache *g, const struct bank_view *bank);

/* and their forces: solve, evaluate. `b`: the bank's, or what an effect makes of it. */
void contact_push(struct contact_set *s, const struct bank_contact *b);

/* How far the tissue goes at each contact under the forces of all: the tool pushes it against the outward normal. */
void contact_displace(struct contact_set *s, const struct bank_contact *b);

/* A new contact of this point: nothing but whose it is. */
static inline void contact_begin(struct contact *c, const struct collide *points, uint32_t point)
{
    *c = (struct contact){.point = point};
    (void)points;
    IF_SECOND(c->tool = collide_tool(points, point);)
}

/* Where it acts, for an effect that says so: place on the surface, normal, and the way from the tool's point to where it asks
 * nothing of the tissue. */
static inline void contact_put(struct contact *c, uint32_t triangle, const float weights[3], const float normal[3],
                               const float away_m[3])
{
    c->triangle = triangle;
    c->depth_m = normal[0] * away_m[0] + normal[1] * away_m[1] + normal[2] * away_m[2];
    contact_turn(c, normal);
    for (int k = 0; k < 3; k++) /* bound: 3 */
        c->weights[k] = weights[k];
}

/* The four without any effect. */
static inline void contact_update(struct contact_set *s, struct row_cache *g, const struct bank_view *bank,
                                  const struct collide *points)
{
    contact_gather(s, points);
    contact_admit(s, g, bank);
    contact_assemble(s, g, bank);
    contact_push(s, bank->contact);
}

/* epsilon_c of a contact whose own compliance is this, m/N. */
static inline float contact_pad(const struct bank_contact *b, float own_m_N)
{
    float typical = b->typical_compliance_m_N;
    return own_m_N > typical ? b->regularisation_m_N * (own_m_N / typical) : b->regularisation_m_N;
}

/* Compliance block between corner i of one admitted contact and corner j of another; its transpose when *turned. Neither
 * corner is fixed. */
static inline const float *contact_block(const struct row_cache *g, const struct bank_view *bank,
                                         const struct contact *at, int i, const struct contact *from, int j,
                                         float room[9], bool *turned)
{
    if (g->stride)
        return row_cache_pair(g, at->slot[i], from->slot[j], turned);
    *turned = false;
    bank_view_compliance(bank, bank->row_of[bank->triangles[at->triangle].vertex[i]],
                         bank->row_of[bank->triangles[from->triangle].vertex[j]], room);
    return room;
}

/* A contact's weights; none on vertices that cannot move. */
static inline void contact_shares(const struct bank_view *bank, const struct contact *c, float share[3])
{
    for (int k = 0; k < 3; k++) /* bound: 3 */
        share[k] = bank->row_of[bank->triangles[c->triangle].vertex[k]] == BANK_NONE ? 0.0f : c->weights[k];
}

/* Prepare rows that the tool may meet next, with the work that is left: the far corners of the triangles around each
 * contact, and for one free point a tick the triangle that it would hit within CONTACT_FORESIGHT_S. */
void contact_expect(const struct contact_set *s, struct row_cache *g, const struct bank_view *bank,
                    const struct collide *points, const float (*velocity_m_s)[3]);

/* out = B_cd v, whichever of the two is the later contact. */
static inline void contact_multiply(const struct contact_set *s, uint32_t c, uint32_t d, const float v[3], float out[3])
{
    const float *B = c >= d ? s->block[contact_pair(c, d)] : s->block[contact_pair(d, c)];
    if (c >= d) {
        out[0] = B[0] * v[0] + B[1] * v[1] + B[2] * v[2];
        out[1] = B[3] * v[0] + B[4] * v[1] + B[5] * v[2];
        out[2] = B[6] * v[0] + B[7] * v[1] + B[8] * v[2];
    } else {
        out[0] = B[0] * v[0] + B[3] * v[1] + B[6] * v[2];
        out[1] = B[1] * v[0] + B[4] * v[1] + B[7] * v[2];
        out[2] = B[2] * v[0] + B[5] * v[1] + B[8] * v[2];
    }
}

/* No contact of this tool, no force on it. */
void contact_forget(struct contact_set *s, const struct collide *points, uint32_t tool);

/* Whether anything of this tool touches. */
static inline bool contact_touches(const struct contact_set *s, uint32_t tool)
{
    bool touches = s->count > 0;
    (void)tool;
    IF_SECOND(touches = false; for (uint32_t c = 0; c < s->count; c++) /* bound: CONTACT_MAX */
                               touches = touches || s->contact[c].tool == tool;)
    IF_RIGID(for (uint32_t c = s->count; c < contact_all(s); c++) /* bound: CONTACT_MAX */
             for (int a = 0; a < 3; a++)                          /* bound: 3 */
             touches = touches || s->contact[c].pull[tool][a] != 0.0f;)
    return touches;
}

/* The solver alone: minimise 1/2 p.A p - d.p over p >= 0 for a positive definite m x m A, m <= CONTACT_MAX, by an
 * active-set method (Lawson and Hanson 1974, ch. 23, in Gram form) that keeps p feasible at every step, so it may stop at
 * any: it does after `steps` factorisations, 1 .. CONTACT_MAX_FACTORS. `active` in: bits of the first guess; out: of the answer. Returns factorisations; *cut: stopped at the bound. */
uint32_t contact_solve(const float (*A)[CONTACT_MAX], const float *d, uint32_t m, uint32_t steps, uint32_t *active,
                       float *p, bool *cut);

#endif
