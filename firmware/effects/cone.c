#include "effects/cone.h"

#include "real.h"

void cone_frame(struct cone_contact *c, const float normal[3])
{
    /* Tangents by the axis that is least along the normal. */
    float x = normal[0] * normal[0], y = normal[1] * normal[1], z = normal[2] * normal[2];
    float axis[3] = {x <= y && x <= z ? 1.0f : 0.0f, 0.0f, 0.0f};
    axis[1] = axis[0] == 0.0f && y <= z ? 1.0f : 0.0f;
    axis[2] = axis[0] == 0.0f && axis[1] == 0.0f ? 1.0f : 0.0f;
    float *n = c->frame[0], *t = c->frame[1];
    for (int k = 0; k < 3; k++) /* bound: 3 */
        n[k] = normal[k];
    real_cross(n, axis, t);
    float inverse = 1.0f / real_sqrt(real_dot(t, t));
    for (int k = 0; k < 3; k++) /* bound: 3 */
        t[k] *= inverse;
    real_cross(n, t, c->frame[2]);
}

IF_RIGID(static void ask_rigid(struct cone *k, const struct contact_set *set) {
    k->system.rigid = contact_all(set) - set->count;
    for (uint32_t i = 0; i < k->system.rigid; i++) { /* bound: CONTACT_MAX */
        const struct contact *from = &set->contact[set->count + i];
        struct cone_rigid *to = &k->system.hard[i];
        to->pad_m_N = from->pad_m_N;
        to->depth_m = from->depth_m;
        to->force_N = k->hard_N[from->point - CONTACT_MAX];
        for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
            for (int a = 0; a < 3; a++)              /* bound: 3 */
                to->pull[t][a] = from->pull[t][a];
    }
})

void cone_ask(struct cone *k, const struct contact_set *set, const struct bank_contact *b)
{
    struct cone_system *s = &k->system;
    s->count = set->count;
    IF_SHAPE(s->levers = false;)
    s->softness_m_N = 1.0f / b->coupling_stiffness_N_m;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        const struct cone_point *last = &k->point[at->point];
        const float *own = set->block[contact_pair(c, c)];
        struct cone_contact *to = &s->contact[c];
        to->tool = contact_tool(at);
        to->pad_m_N = contact_pad(b, (own[0] + own[4] + own[8]) / 3.0f);
        to->mu = 0.0f;
        to->slip_m_N = last->slip_m_N;
        cone_frame(to, at->normal);
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            to->wanted_m[a] = at->depth_m * at->normal[a];
            to->force_N[a] = last->force_N[a];
        }
    }
    IF_RIGID(ask_rigid(k, set);)
}

/* The local problem of a contact from its diagonal block. */
static void prepare(const struct cone_system *s, struct cone_contact *c, const float block[9])
{
    float *L = c->local, *V = c->inverse, give = s->softness_m_N + c->pad_m_N;
    int at = 0;
    for (int a = 0; a < 3; a++) { /* bound: 3 */
        float column[3];
        for (int i = 0; i < 3; i++) /* bound: 3 */
            column[i] = real_dot(&block[3 * i], c->frame[a]) + give * c->frame[a][i];
        IF_SHAPE(if (s->levers) {
            float tip[3], moved[3];
            cone_at_tip(s, c, c->frame[a], tip);
            cone_at_contact(s, c, tip, moved);
            for (int i = 0; i < 3; i++) /* bound: 3 */
                column[i] += s->softness_m_N * (moved[i] - c->frame[a][i]);
        })
        for (int b = a; b < 3; b++) /* bound: 3 */
            L[at++] = real_dot(c->frame[b], column);
    }
    float c00 = L[3] * L[5] - L[4] * L[4], c01 = L[2] * L[4] - L[1] * L[5], c02 = L[1] * L[4] - L[2] * L[3];
    float inverse = 1.0f / (L[0] * c00 + L[1] * c01 + L[2] * c02);
    V[0] = c00 * inverse;
    V[1] = c01 * inverse;
    V[2] = c02 * inverse;
    V[3] = (L[0] * L[5] - L[2] * L[2]) * inverse;
    V[4] = (L[1] * L[2] - L[0] * L[4]) * inverse;
    V[5] = (L[0] * L[3] - L[1] * L[1]) * inverse;
    float own = 1.0f / L[0];
    c->schur[0] = L[3] - L[1] * L[1] * own;
    c->schur[1] = L[4] - L[1] * L[2] * own;
    c->schur[2] = L[5] - L[2] * L[2] * own;
}

/* Sliding: f_t = (S + slip I)^-1 s, f_n from the first row, and slip >= 0 such that |f_t| = mu f_n. mu f_n / |f_t| - 1 is
 * nearly linear in slip: Newton's method, kept between bounds. f comes out on the cone whenever this stops. */
static void slide(struct cone_contact *c, const float q[3], float f[3])
{
    const float *L = c->local, *S = c->schur, own = 1.0f / L[0];
    const float s1 = q[1] - L[1] * q[0] * own, s2 = q[2] - L[2] * q[0] * own;
    float low = 0.0f, high = 1e30f, slip = c->state == CONE_SLIDE ? c->slip_m_N : 0.0f, f1 = 0.0f, f2 = 0.0f;
    float length = 1.0f;
    for (int step = 0; step < CONE_SLIDE_STEPS && c->mu > 0.0f; step++) { /* bound: CONE_SLIDE_STEPS */
        float a = S[0] + slip, d = S[2] + slip, inverse = 1.0f / (a * d - S[1] * S[1]);
        f1 = (d * s1 - S[1] * s2) * inverse;
        f2 = (a * s2 - S[1] * s1) * inverse;
        length = real_sqrt(f1 * f1 + f2 * f2);
        if (!(length > 0.0f))
            break;
        float normal = (q[0] - L[1] * f1 - L[2] * f2) * own, excess = c->mu * normal - length;
        if (excess < 1e-5f * length && excess > -1e-5f * length)
            break;
        if (excess < 0.0f)
            low = slip;
        else
            high = slip;
        float d1 = -(d * f1 - S[1] * f2) * inverse, d2 = -(a * f2 - S[1] * f1) * inverse;
        float d_length = (f1 * d1 + f2 * d2) / length, d_normal = -(L[1] * d1 + L[2] * d2) * own;
        float slope = c->mu * (d_normal * length - normal * d_length), next = slip - excess * length / slope;
        if (!(next > low && next < high))
            next = high < 1e30f ? 0.5f * (low + high) : 2.0f * slip + S[0] + S[2];
        slip = next;
    }
    c->slip_m_N = slip;
    c->state = CONE_SLIDE;
    if (length > 0.0f) {
        f1 /= length;
        f2 /= length;
    }
    /* The normal row holds for this direction. A sum that nearly vanishes is a body that jams: then the force is bounded. */
    float stiff = L[0] + c->mu * (L[1] * f1 + L[2] * f2);
    f[0] = q[0] / (stiff > 0.25f * L[0] ? stiff : 0.25f * L[0]);
    f[1] = c->mu * f[0] * f1;
    f[2] = c->mu * f[0] * f2;
}

/* The force of one contact for what the others leave of its displacement, in its own frame. */
static void solve_one(struct cone_contact *c, const float q[3], float f[3])
{
    const float *V = c->inverse;
    bool held = c->mu < 0.0f;
    if (q[0] <= 0.0f && !held) {
        c->state = CONE_OPEN;
        f[0] = f[1] = f[2] = 0.0f;
        return;
    }
    f[0] = V[0] * q[0] + V[1] * q[1] + V[2] * q[2];
    f[1] = V[1] * q[0] + V[3] * q[1] + V[4] * q[2];
    f[2] = V[2] * q[0] + V[4] * q[1] + V[5] * q[2];
    float most = c->mu * f[0];
    if (held || (f[0] > 0.0f && f[1] * f[1] + f[2] * f[2] <= most * most)) {
        c->state = CONE_STICK;
        return;
    }
    slide(c, q, f);
}

/* What the others leave of a contact's displacement; open ones have no force. */
static void remainder_of(const struct cone_system *s, const float (*block)[9], uint32_t c, float out[3])
{
    const struct cone_contact *k = &s->contact[c];
    const float *all = s->tool_N[k->tool];
    const float give = s->softness_m_N;
    float rest[3];
    real_subtract(all, k->force_N, rest);
    IF_SHAPE(if (s->levers) {
        float own[3], others[3];
        cone_at_tip(s, k, k->force_N, own);
        real_subtract(all, own, others);
        cone_at_contact(s, k, others, rest);
    })
    float x = k->wanted_m[0] - give * rest[0], y = k->wanted_m[1] - give * rest[1];
    float z = k->wanted_m[2] - give * rest[2];
    const float *B = block[contact_pair(c, 0)];
    for (uint32_t d = 0; d < c; d++, B += 9) { /* bound: CONTACT_MAX */
        if (s->contact[d].state == CONE_OPEN)
            continue;
        const float *f = s->contact[d].force_N;
        x -= B[0] * f[0] + B[1] * f[1] + B[2] * f[2];
        y -= B[3] * f[0] + B[4] * f[1] + B[5] * f[2];
        z -= B[6] * f[0] + B[7] * f[1] + B[8] * f[2];
    }
    for (uint32_t d = c + 1; d < s->count; d++) { /* bound: CONTACT_MAX */
        B += 9 * d;                               /* from (d - 1, c) to (d, c) */
        if (s->contact[d].state == CONE_OPEN)
            continue;
        const float *f = s->contact[d].force_N;
        x -= B[0] * f[0] + B[3] * f[1] + B[6] * f[2];
        y -= B[1] * f[0] + B[4] * f[1] + B[7] * f[2];
        z -= B[2] * f[0] + B[5] * f[1] + B[8] * f[2];
    }
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

IF_RIGID(static void push_rigid(struct cone *k, struct contact_set *set) {
    for (uint32_t i = 0; i < CONTACT_MAX; i++) /* bound: CONTACT_MAX */
        k->hard_N[i] = 0.0f;
    for (uint32_t i = 0; i < k->system.rigid; i++) { /* bound: CONTACT_MAX */
        struct contact *to = &set->contact[set->count + i];
        to->pressure_N = k->hard_N[to->point - CONTACT_MAX] = k->system.hard[i].force_N;
    }
})

/* One sweep over the rigid contacts. Squares of what moved, and of the forces. */
IF_RIGID(static void sweep_rigid(struct cone_system *s, float *moved, float *largest) {
    for (uint32_t i = 0; i < s->rigid; i++) { /* bound: CONTACT_MAX */
        struct cone_rigid *r = &s->hard[i];
        float own = r->pad_m_N, left = r->pad_m_N * r->force_N - r->depth_m;
        for (uint32_t t = 0; t < CONTACT_TOOLS; t++) { /* bound: CONTACT_TOOLS */
            own += s->softness_m_N * real_dot(r->pull[t], r->pull[t]);
            left += s->softness_m_N * real_dot(r->pull[t], s->tool_N[t]);
        }
        float force = r->force_N - left / own, change = (force > 0.0f ? force : 0.0f) - r->force_N;
        r->force_N += change;
        *moved += change * change;
        *largest += r->force_N * r->force_N;
        for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
            for (int a = 0; a < 3; a++)              /* bound: 3 */
                s->tool_N[t][a] += change * r->pull[t][a];
    }
})

/* Anew in every sweep, so that rounding does not add up. */
static void sum_on_tools(struct cone_system *s)
{
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
        s->tool_N[t][0] = s->tool_N[t][1] = s->tool_N[t][2] = 0.0f;
    for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
        float tip[3];
        cone_at_tip(s, &s->contact[c], s->contact[c].force_N, tip);
        for (int a = 0; a < 3; a++) /* bound: 3 */
            s->tool_N[s->contact[c].tool][a] += tip[a];
    }
    IF_RIGID(for (uint32_t i = 0; i < s->rigid; i++)      /* bound: CONTACT_MAX */
             for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
             for (int a = 0; a < 3; a++)                  /* bound: 3 */
             s->tool_N[t][a] += s->hard[i].force_N * s->hard[i].pull[t][a];)
}

bool cone_solve(struct cone_system *s, const float (*block)[9], uint32_t sweeps)
{
    bool rest = false;
    for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
        struct cone_contact *k = &s->contact[c];
        prepare(s, k, block[contact_pair(c, c)]);
        k->state = CONE_SLIDE; /* so that slip_m_N serves as the first guess, and the force counts */
    }
    for (s->sweeps = 0; s->sweeps < sweeps && !rest; s->sweeps++) { /* bound: BANK_MAX_SWEEPS */
        float moved = 0.0f, largest = 0.0f;
        sum_on_tools(s);
        for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
            struct cone_contact *k = &s->contact[c];
            float left[3], q[3], f[3];
            IF_SHAPE(float before[3] = {k->force_N[0], k->force_N[1], k->force_N[2]};)
            remainder_of(s, block, c, left);
            for (int a = 0; a < 3; a++) /* bound: 3 */
                q[a] = real_dot(k->frame[a], left);
            solve_one(k, q, f);
            for (int a = 0; a < 3; a++) { /* bound: 3 */
                float force = f[0] * k->frame[0][a] + f[1] * k->frame[1][a] + f[2] * k->frame[2][a];
                float change = force - k->force_N[a];
                moved += change * change;
                largest += force * force;
                k->force_N[a] = force;
                s->tool_N[k->tool][a] += change;
            }
            IF_SHAPE(if (s->levers) {
                float changes[3], tip[3];
                real_subtract(k->force_N, before, changes);
                cone_at_tip(s, k, changes, tip);
                for (int a = 0; a < 3; a++) /* bound: 3 */
                    s->tool_N[k->tool][a] += tip[a] - changes[a];
            })
        }
        IF_RIGID(sweep_rigid(s, &moved, &largest);)
        rest = moved <= CONE_TOLERANCE * CONE_TOLERANCE * largest;
    }
    sum_on_tools(s);
    return rest;
}

void cone_push(struct cone *k, struct contact_set *set, const struct bank_contact *b, uint32_t sweeps)
{
    struct cone_system *s = &k->system;
    uint32_t seen = 0;
    set->cut += !cone_solve(s, (const float(*)[9])set->block, sweeps);
    set->active = 0;
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
        for (int a = 0; a < 3; a++) {            /* bound: 3 */
            set->force_N[t][a] = s->tool_N[t][a];
            set->proxy_offset_m[t][a] = s->softness_m_N * s->tool_N[t][a];
        }
    for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
        const struct cone_contact *from = &s->contact[c];
        struct contact *at = &set->contact[c];
        struct cone_point *point = &k->point[at->point];
        seen |= 1u << at->point;
        set->active |= (uint32_t)(from->state != CONE_OPEN) << at->point;
        point->slip_m_N = from->slip_m_N;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            at->force_N[a] = point->force_N[a] = from->force_N[a];
        float held = from->mu < 0.0f ? real_sqrt(real_dot(at->force_N, at->force_N)) : 0.0f;
        at->pressure_N = from->mu < 0.0f ? held : real_dot(at->force_N, at->normal);
    }
    for (uint32_t i = 0; i < CONTACT_MAX; i++) /* bound: CONTACT_MAX */
        if (!(seen >> i & 1u))
            k->point[i] = (struct cone_point){.slip_m_N = 0.0f};
    IF_RIGID(push_rigid(k, set);)
    contact_displace(set, b);
}

void cone_forget(struct cone *k, const struct collide_range *points)
{
    for (uint32_t i = 0; i < points->count; i++) /* bound: BANK_MAX_TOOL_POINTS */
        k->point[points->first + i] = (struct cone_point){.slip_m_N = 0.0f};
}
