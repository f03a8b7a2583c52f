#include "contact.h"

#include "real.h"

/* Solve A_PP s = d_P for the indices of a set by L D L^t, no roots. Returns false when a pivot is not positive: then A was
 * not positive definite to working precision, which epsilon excludes; the caller keeps its last feasible point. */
static bool solve_subset(const float (*A)[CONTACT_MAX], const float *d, const uint32_t *index, uint32_t n, float *s)
{
    float L[CONTACT_MAX][CONTACT_MAX], pivot[CONTACT_MAX];
    for (uint32_t j = 0; j < n; j++) { /* bound: CONTACT_MAX */
        float scaled[CONTACT_MAX], diagonal = A[index[j]][index[j]];
        for (uint32_t k = 0; k < j; k++) { /* bound: CONTACT_MAX */
            scaled[k] = L[j][k] * pivot[k];
            diagonal -= L[j][k] * scaled[k];
        }
        if (!(diagonal > 0.0f))
            return false;
        pivot[j] = diagonal;
        float inverse = 1.0f / diagonal;
        for (uint32_t i = j + 1; i < n; i++) { /* bound: CONTACT_MAX */
            float sum = A[index[i]][index[j]];
            for (uint32_t k = 0; k < j; k++) /* bound: CONTACT_MAX */
                sum -= L[i][k] * scaled[k];
            L[i][j] = sum * inverse;
        }
    }
    for (uint32_t i = 0; i < n; i++) { /* bound: CONTACT_MAX */
        s[i] = d[index[i]];
        for (uint32_t k = 0; k < i; k++) /* bound: CONTACT_MAX */
            s[i] -= L[i][k] * s[k];
    }
    for (uint32_t i = n; i-- > 0;) { /* bound: CONTACT_MAX */
        s[i] /= pivot[i];
        for (uint32_t k = i + 1; k < n; k++) /* bound: CONTACT_MAX */
            s[i] -= L[k][i] * s[k];
    }
    return true;
}

uint32_t contact_solve(const float (*A)[CONTACT_MAX], const float *d, uint32_t m, uint32_t steps, uint32_t *active,
                       float *p, bool *cut)
{
    uint32_t set = *active & ((1u << m) - 1u), barred = 0, factors = 0, added = m;
    float largest = 0.0f;
    for (uint32_t i = 0; i < m; i++) { /* bound: CONTACT_MAX */
        p[i] = 0.0f;
        largest = d[i] > largest ? d[i] : largest;
    }
    const float tolerance_m = 1e-6f * largest; /* ten times the rounding of A p for the depths at hand */
    *cut = true;
    while (factors < steps) { /* bound: CONTACT_MAX_FACTORS */
        uint32_t index[CONTACT_MAX], n = 0;
        for (uint32_t i = 0; i < m; i++) /* bound: CONTACT_MAX */
            if (set >> i & 1u)
                index[n++] = i;
        float s[CONTACT_MAX];
        factors++;
        if (!solve_subset(A, d, index, n, s))
            break;

        /* As far towards s as p stays feasible; what reaches zero on the way leaves the set. */
        float part = 1.0f, reach[CONTACT_MAX];
        for (uint32_t i = 0; i < n; i++) { /* bound: CONTACT_MAX */
            float q = p[index[i]];
            reach[i] = s[i] > 0.0f ? 2.0f : q > 0.0f ? q / (q - s[i]) : 0.0f;
            part = reach[i] < part ? reach[i] : part;
        }
        bool left = false;
        for (uint32_t i = 0; i < n; i++) { /* bound: CONTACT_MAX */
            float *q = &p[index[i]];
            *q = reach[i] <= part ? 0.0f : *q + part * (s[i] - *q);
            if (reach[i] <= part) {
                left = true;
                set &= ~(1u << index[i]);
                if (index[i] == added && part == 0.0f) /* rounding: it cannot push, do not try it again in vain */
                    barred |= 1u << added;
            }
        }
        if (part > 0.0f)
            barred = 0;
        if (left)
            continue;

        /* p solves its set; take in the contact that penetrates most. */
        uint32_t worst = m;
        float most = tolerance_m;
        for (uint32_t i = 0; i < m; i++) { /* bound: CONTACT_MAX */
            if ((set | barred) >> i & 1u)
                continue;
            float short_m = d[i];
            for (uint32_t k = 0; k < n; k++) /* bound: CONTACT_MAX */
                short_m -= A[i][index[k]] * p[index[k]];
            if (short_m > most) {
                most = short_m;
                worst = i;
            }
        }
        if (worst == m) {
            *cut = false;
            break;
        }
        added = worst;
        set |= 1u << worst;
    }
    *active = set;
    return factors;
}

/* out += w G n, and out += w G^t n. */
static inline void add_rows(const float G[9], const float n[3], float w, float out[3])
{
    out[0] += w * real_dot(&G[0], n);
    out[1] += w * real_dot(&G[3], n);
    out[2] += w * real_dot(&G[6], n);
}

static inline void add_columns(const float G[9], const float n[3], float w, float out[3])
{
    out[0] += w * (G[0] * n[0] + G[3] * n[1] + G[6] * n[2]);
    out[1] += w * (G[1] * n[0] + G[4] * n[1] + G[7] * n[2]);
    out[2] += w * (G[2] * n[0] + G[5] * n[1] + G[8] * n[2]);
}

/* Response of every contact to a unit normal force at every other: each block of the bank is read once and serves both
 * directions, as G_ji is the transpose of G_ij. */
void contact_respond(struct contact_set *s, const struct row_cache *g, const struct bank_view *bank)
{
    uint32_t m = s->count;
    for (uint32_t c = 0; c < m; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &s->contact[c];
        float share_c[3];
        contact_shares(bank, at, share_c);
        for (uint32_t d = 0; d <= c; d++) { /* bound: CONTACT_MAX */
            const struct contact *from = &s->contact[d];
            float share_d[3], forth[3] = {0.0f, 0.0f, 0.0f}, back[3] = {0.0f, 0.0f, 0.0f};
            contact_shares(bank, from, share_d);
            for (int i = 0; i < 3; i++)       /* bound: 3 */
                for (int j = 0; j < 3; j++) { /* bound: 3 */
                    float w = share_c[i] * share_d[j], room[9];
                    if (w == 0.0f)
                        continue;
                    bool turned;
                    const float *G = contact_block(g, bank, at, i, from, j, room, &turned);
                    if (turned) {
                        add_columns(G, from->normal, w, forth);
                        add_rows(G, at->normal, w, back);
                    } else {
                        add_rows(G, from->normal, w, forth);
                        add_columns(G, at->normal, w, back);
                    }
                }
            for (int a = 0; a < 3; a++) { /* bound: 3 */
                s->response[d][c][a] = back[a];
                s->response[c][d][a] = forth[a];
            }
        }
    }
    for (uint32_t c = 0; c < m; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &s->contact[c];
        at->pad_m_N = contact_pad(bank, real_dot(at->normal, s->response[c][c]));
    }
}

void contact_gather(struct contact_set *s, const struct collide *points)
{
    s->count = 0;
    for (uint32_t i = 0; i < points->count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        const struct collide_point *p = &points->point[i];
        if (!p->touching) {
            s->hold[i].valid = false;
            continue;
        }
        struct contact *c = &s->contact[s->count++];
        c->point = i;
        c->triangle = p->triangle;
        c->depth_m = p->depth_m;
        for (int k = 0; k < 3; k++) { /* bound: 3 */
            c->weights[k] = p->weights[k];
            c->normal[k] = p->normal[k];
        }
    }
}

/* Have the rows of the contact's triangle ready beside those in use. False, and nothing is taken into use, if they cannot
 * be in this tick. */
static bool take_rows(struct contact_set *s, struct row_cache *g, const struct bank_view *bank, struct contact *c)
{
    uint32_t count = s->in_use_count;
    for (int k = 0; k < 3; k++) { /* bound: 3 */
        uint16_t row = bank->row_of[bank->triangles[c->triangle].vertex[k]];
        c->slot[k] = ROW_CACHE_NO_SLOT;
        if (row == BANK_NONE)
            continue;
        c->slot[k] = row_cache_slot(g, bank, row);
        bool known = false;
        for (uint32_t u = 0; u < count; u++) /* bound: ROW_CACHE_SLOTS */
            known |= s->in_use[u] == c->slot[k];
        if (known)
            continue;
        if (c->slot[k] == ROW_CACHE_NO_SLOT || count == ROW_CACHE_SLOTS)
            return false;
        s->in_use[count++] = c->slot[k];
    }
    if (!row_cache_prepare(g, s->in_use, s->in_use_count, count))
        return false;
    s->in_use_count = count;
    return true;
}

/* On its new anchor, else on the last one. */
static bool admit(struct contact_set *s, struct row_cache *g, const struct bank_view *bank, struct contact *c)
{
    struct contact_hold *hold = &s->hold[c->point];
    bool ready = take_rows(s, g, bank, c);
    if (!ready && hold->valid && hold->triangle != c->triangle) {
        c->triangle = hold->triangle;
        for (int k = 0; k < 3; k++) /* bound: 3 */
            c->weights[k] = hold->weights[k];
        ready = take_rows(s, g, bank, c);
        s->held += ready;
    }
    hold->valid = ready;
    hold->triangle = c->triangle;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        hold->weights[k] = c->weights[k];
    s->waiting += !ready;
    return ready;
}

void contact_admit(struct contact_set *s, struct row_cache *g, const struct bank_view *bank)
{
    uint32_t ready = 0, kept = 0;
    row_cache_begin(g);
    s->in_use_count = 0;
    if (g->stride == 0)
        return;
    for (uint32_t turn = 0; turn < 2; turn++)     /* bound: 2 */
        for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
            bool pushed = s->active >> s->contact[c].point & 1u;
            if (pushed == (turn == 0) && admit(s, g, bank, &s->contact[c]))
                ready |= 1u << c;
        }
    for (uint32_t c = 0; c < s->count; c++) /* bound: CONTACT_MAX */
        if (ready >> c & 1u)
            s->contact[kept++] = s->contact[c];
    s->count = kept;
}

void contact_push(struct contact_set *s, const struct bank_view *bank)
{
    uint32_t m = s->count, guess = 0;
    float softness = 1.0f / bank->contact->coupling_stiffness_N_m, depth[CONTACT_MAX], p[CONTACT_MAX];
    for (uint32_t c = 0; c < m; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &s->contact[c];
        depth[c] = at->depth_m;
        guess |= (s->active >> at->point & 1u) << c;
        for (uint32_t d = 0; d <= c; d++) { /* bound: CONTACT_MAX */
            float a = real_dot(at->normal, s->response[c][d]) + softness * real_dot(at->normal, s->contact[d].normal);
            s->system[c][d] = s->system[d][c] = a;
        }
        s->system[c][c] += at->pad_m_N;
    }
    bool cut = false;
    uint32_t steps = bank->contact->solver_steps ? bank->contact->solver_steps : CONTACT_MAX_FACTORS;
    s->factors = m ? contact_solve((const float(*)[CONTACT_MAX])s->system, depth, m, steps, &guess, p, &cut) : 0;
    s->cut += cut;

    s->active = 0;
    for (int a = 0; a < 3; a++) /* bound: 3 */
        s->force_N[a] = 0.0f;
    for (uint32_t c = 0; c < m; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &s->contact[c];
        at->pressure_N = p[c];
        s->active |= (guess >> c & 1u) << at->point;
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            s->force_N[a] += p[c] * at->normal[a];
            float u = bank->contact->regularisation_m_N * p[c] * at->normal[a];
            for (uint32_t d = 0; d < m; d++) /* bound: CONTACT_MAX */
                u += s->response[c][d][a] * p[d];
            at->displacement_m[a] = -u; /* the tool pushes the tissue against the outward normal */
        }
    }
    for (int a = 0; a < 3; a++) /* bound: 3 */
        s->proxy_offset_m[a] = softness * s->force_N[a];
}

/* The three corners of a triangle that is not in use yet. */
static void expect_triangle(struct row_cache *g, const struct bank_view *bank, uint32_t triangle)
{
    for (int k = 0; k < 3; k++) /* bound: 3; rows that are ready cost a look */
        row_cache_expect(g, bank, bank->row_of[bank->triangles[triangle].vertex[k]]);
}

void contact_expect(const struct contact_set *s, struct row_cache *g, const struct bank_view *bank,
                    const struct collide *points, const float velocity_m_s[3])
{
    if (g->stride == 0 || points->count == 0)
        return;
    for (uint32_t c = 0; c < s->count; c++) /* bound: CONTACT_MAX */
        for (int k = 0; k < 3; k++)         /* bound: 3 */
            expect_triangle(g, bank, bank->triangles[s->contact[c].triangle].neighbour[k]);

    const struct collide_point *p = &points->point[g->tick % points->count];
    float ahead[3];
    struct collide_hit hit;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        ahead[k] = p->position_m[k] + CONTACT_FORESIGHT_S * velocity_m_s[k];
    if (!p->touching && p->known && collide_sweep(bank, p->position_m, ahead, &hit))
        expect_triangle(g, bank, hit.triangle);
}

void contact_clear(struct contact_set *s)
{
    s->count = 0;
    s->active = 0;
    for (uint32_t i = 0; i < CONTACT_MAX; i++) /* bound: CONTACT_MAX */
        s->hold[i].valid = false;
    for (int a = 0; a < 3; a++) /* bound: 3 */
        s->force_N[a] = s->proxy_offset_m[a] = 0.0f;
}
