#include "effects/cone.h"

#include "real.h"

static uint32_t place(uint32_t high, uint32_t low)
{
    return high * (high + 1) / 2 + low;
}

/* Nine sums that stay in registers. */
struct block {
    float e[9];
};

static inline struct block plus(struct block s, float w, const float *G, bool turned)
{
    if (turned) {
        s.e[0] += w * G[0], s.e[1] += w * G[3], s.e[2] += w * G[6];
        s.e[3] += w * G[1], s.e[4] += w * G[4], s.e[5] += w * G[7];
        s.e[6] += w * G[2], s.e[7] += w * G[5], s.e[8] += w * G[8];
    } else {
        s.e[0] += w * G[0], s.e[1] += w * G[1], s.e[2] += w * G[2];
        s.e[3] += w * G[3], s.e[4] += w * G[4], s.e[5] += w * G[5];
        s.e[6] += w * G[6], s.e[7] += w * G[7], s.e[8] += w * G[8];
    }
    return s;
}

/* The vertices of the contacts, each once, and a contact's shares of them. Points of one tool lie on few triangles, so there are
 * far fewer vertices than corners. */
struct corners {
    uint32_t count;
    struct {
        const struct contact *contact; /* one that has the vertex, and which of its corners it is */
        int corner;
        uint16_t vertex;
    } at[CONE_CORNERS];
    uint8_t of[CONTACT_MAX][3]; /* per contact and corner: place in `at`; where its share is 0, any */
    float share[CONTACT_MAX][3];
};

static void add_corners(struct corners *k, const struct bank_view *bank, const struct contact *contact, uint32_t c)
{
    const uint16_t *vertex = bank->triangles[contact->triangle].vertex;
    contact_shares(bank, contact, k->share[c]);
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        k->of[c][i] = 0;
        if (k->share[c][i] == 0.0f)
            continue;
        uint32_t at = 0;
        while (at < k->count && k->at[at].vertex != vertex[i]) /* bound: CONE_CORNERS */
            at++;
        if (at == k->count) {
            k->at[at].contact = contact;
            k->at[at].corner = i;
            k->at[at].vertex = vertex[i];
            k->count++;
        }
        k->of[c][i] = (uint8_t)at;
    }
}

/* Each pair of a vertex and a contact is summed once, over the contact's corners; the vertices of contacts d .. m-1 are the first
 * of `corners` when contact d's turn comes. */
void cone_assemble(struct cone_system *s, const struct contact_set *set, const struct row_cache *g,
                   const struct bank_view *bank)
{
    const float softness = 1.0f / bank->contact->coupling_stiffness_N_m;
    struct corners k = {.count = 0};
    struct block response[CONE_CORNERS];
    s->count = set->count;
    for (uint32_t d = set->count; d-- > 0;) { /* bound: CONTACT_MAX */
        const struct contact *from = &set->contact[d];
        add_corners(&k, bank, from, d);
        for (uint32_t v = 0; v < k.count; v++) { /* bound: CONE_CORNERS */
            struct block sum = {{0.0f}};
            for (int j = 0; j < 3; j++) { /* bound: 3 */
                float room[9];
                bool turned;
                if (k.share[d][j] == 0.0f)
                    continue;
                const float *G = contact_block(g, bank, k.at[v].contact, k.at[v].corner, from, j, room, &turned);
                sum = plus(sum, k.share[d][j], G, turned);
            }
            response[v] = sum;
        }
        for (uint32_t c = d; c < set->count; c++) { /* bound: CONTACT_MAX */
            struct block sum = {{softness, 0.0f, 0.0f, 0.0f, softness, 0.0f, 0.0f, 0.0f, softness}};
            for (int i = 0; i < 3; i++) /* bound: 3 */
                if (k.share[c][i] != 0.0f)
                    sum = plus(sum, k.share[c][i], response[k.of[c][i]].e, false);
            if (c == d) {
                float pad = contact_pad(bank, (sum.e[0] + sum.e[4] + sum.e[8]) / 3.0f - softness);
                sum.e[0] += pad;
                sum.e[4] += pad;
                sum.e[8] += pad;
            }
            for (int e = 0; e < 9; e++) /* bound: 9 */
                s->block[place(c, d)][e] = sum.e[e];
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

/* What the others leave of a contact's displacement; open ones have no force. */
static void remainder_of(const struct cone_system *s, uint32_t c, float out[3])
{
    const struct cone_contact *k = &s->contact[c];
    float x = k->wanted_m[0], y = k->wanted_m[1], z = k->wanted_m[2];
    const float *A = s->block[place(c, 0)];
    for (uint32_t d = 0; d < c; d++, A += 9) { /* bound: CONTACT_MAX */
        if (s->contact[d].state == CONE_OPEN)
            continue;
        const float *f = s->contact[d].force_N;
        x -= A[0] * f[0] + A[1] * f[1] + A[2] * f[2];
        y -= A[3] * f[0] + A[4] * f[1] + A[5] * f[2];
        z -= A[6] * f[0] + A[7] * f[1] + A[8] * f[2];
    }
    for (uint32_t d = c + 1; d < s->count; d++) { /* bound: CONTACT_MAX */
        A += 9 * d;                               /* from (d - 1, c) to (d, c) */
        if (s->contact[d].state == CONE_OPEN)
            continue;
        const float *f = s->contact[d].force_N;
        x -= A[0] * f[0] + A[3] * f[1] + A[6] * f[2];
        y -= A[1] * f[0] + A[4] * f[1] + A[7] * f[2];
        z -= A[2] * f[0] + A[5] * f[1] + A[8] * f[2];
    }
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

void cone_response(const struct cone_system *s, uint32_t c, float out_m[3])
{
    const struct cone_contact *k = &s->contact[c];
    const float *A = s->block[place(c, c)];
    float left[3];
    remainder_of(s, c, left);
    for (int a = 0; a < 3; a++) /* bound: 3 */
        out_m[a] = k->wanted_m[a] - left[a] + real_dot(&A[3 * a], k->force_N);
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
            remainder_of(s, c, left);
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
