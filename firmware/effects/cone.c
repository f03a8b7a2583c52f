#include "effects/cone.h"

#include "real.h"

static uint32_t place(uint32_t high, uint32_t low)
{
    return high * (high + 1) / 2 + low;
}

/* out += w G or w G^t */
static inline void add_block(float out[9], float w, const float *G, bool turned)
{
    if (turned)
        for (int a = 0; a < 3; a++)     /* bound: 3 */
            for (int b = 0; b < 3; b++) /* bound: 3 */
                out[3 * a + b] += w * G[3 * b + a];
    else
        for (int e = 0; e < 9; e++) /* bound: 9 */
            out[e] += w * G[e];
}

/* Response of each corner of a contact's triangle to a force at another contact. */
static void corner_response(const struct row_cache *g, const struct bank_view *bank, const struct contact *at,
                            const struct contact *from, float corner[3][9])
{
    float share_at[3], share_from[3], room[9];
    contact_shares(bank, at, share_at);
    contact_shares(bank, from, share_from);
    const uint16_t *vertex = bank->triangles[at->triangle].vertex;
    for (int i = 0; i < 3; i++) {   /* bound: 3 */
        for (int e = 0; e < 9; e++) /* bound: 9 */
            corner[i][e] = 0.0f;
        if (bank->row_of[vertex[i]] == BANK_NONE)
            continue;
        for (int j = 0; j < 3; j++) { /* bound: 3 */
            if (share_from[j] == 0.0f)
                continue;
            bool turned;
            const float *G = contact_block(g, bank, at, i, from, j, room, &turned);
            add_block(corner[i], share_from[j], G, turned);
        }
    }
}

void cone_assemble(struct cone_system *s, const struct contact_set *set, const struct row_cache *g,
                   const struct bank_view *bank)
{
    const float softness = 1.0f / bank->contact->coupling_stiffness_N_m;
    s->count = set->count;
    for (uint32_t d = 0; d < set->count; d++) { /* bound: CONTACT_MAX */
        uint32_t triangle = bank->triangle_count;
        float corner[3][9];
        for (uint32_t c = d; c < set->count; c++) { /* bound: CONTACT_MAX */
            const struct contact *at = &set->contact[c];
            float share[3], *block = s->block[place(c, d)];
            if (at->triangle != triangle) /* points of one tool often share a triangle with the one before */
                corner_response(g, bank, at, &set->contact[d], corner);
            triangle = at->triangle;
            contact_shares(bank, at, share);
            for (int e = 0; e < 9; e++) /* bound: 9 */
                block[e] = share[0] * corner[0][e] + share[1] * corner[1][e] + share[2] * corner[2][e];
            float diagonal = softness + (c == d ? bank->contact->regularisation_m_N : 0.0f);
            block[0] += diagonal;
            block[4] += diagonal;
            block[8] += diagonal;
        }
    }
}

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

/* The local problem of a contact from its diagonal block. */
static void prepare(struct cone_contact *c, const float block[9])
{
    float *L = c->local, *V = c->inverse;
    int at = 0;
    for (int a = 0; a < 3; a++) { /* bound: 3 */
        float column[3];
        for (int i = 0; i < 3; i++) /* bound: 3 */
            column[i] = real_dot(&block[3 * i], c->frame[a]);
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

/* Sum over the other contacts' forces that are not zero. */
static void respond(const struct cone_system *s, uint32_t c, float out[3])
{
    float x = 0.0f, y = 0.0f, z = 0.0f;
    for (uint32_t d = 0; d < s->count; d++) { /* bound: CONTACT_MAX */
        const float *f = s->contact[d].force_N;
        if (d == c || s->contact[d].state == CONE_OPEN)
            continue;
        if (d < c) {
            const float *A = s->block[place(c, d)];
            x += real_dot(&A[0], f);
            y += real_dot(&A[3], f);
            z += real_dot(&A[6], f);
        } else {
            const float *A = s->block[place(d, c)];
            x += A[0] * f[0] + A[3] * f[1] + A[6] * f[2];
            y += A[1] * f[0] + A[4] * f[1] + A[7] * f[2];
            z += A[2] * f[0] + A[5] * f[1] + A[8] * f[2];
        }
    }
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

bool cone_solve(struct cone_system *s, uint32_t sweeps)
{
    bool rest = false;
    for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
        struct cone_contact *k = &s->contact[c];
        prepare(k, s->block[place(c, c)]);
        k->state = CONE_SLIDE; /* so that slip_m_N serves as the first guess, and the force counts */
    }
    for (s->sweeps = 0; s->sweeps < sweeps && !rest; s->sweeps++) { /* bound: BANK_MAX_SWEEPS */
        float moved = 0.0f, largest = 0.0f;
        for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
            struct cone_contact *k = &s->contact[c];
            float left[3], q[3], f[3];
            respond(s, c, left);
            real_subtract(k->wanted_m, left, left);
            for (int a = 0; a < 3; a++) /* bound: 3 */
                q[a] = real_dot(k->frame[a], left);
            solve_one(k, q, f);
            for (int a = 0; a < 3; a++) { /* bound: 3 */
                float force = f[0] * k->frame[0][a] + f[1] * k->frame[1][a] + f[2] * k->frame[2][a];
                float change = force - k->force_N[a];
                moved += change * change;
                largest += force * force;
                k->force_N[a] = force;
            }
        }
        rest = moved <= CONE_TOLERANCE * CONE_TOLERANCE * largest;
    }
    return rest;
}
