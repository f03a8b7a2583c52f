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
    } at[CONTACT_CORNERS];
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
        while (at < k->count && k->at[at].vertex != vertex[i]) /* bound: CONTACT_CORNERS */
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
void contact_assemble(struct contact_set *s, const struct row_cache *g, const struct bank_view *bank)
{
    struct corners k = {.count = 0};
    struct block response[CONTACT_CORNERS];
    for (uint32_t d = s->count; d-- > 0;) { /* bound: CONTACT_MAX */
        struct contact *from = &s->contact[d];
        add_corners(&k, bank, from, d);
        for (uint32_t v = 0; v < k.count; v++) { /* bound: CONTACT_CORNERS */
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
        for (uint32_t c = d; c < s->count; c++) { /* bound: CONTACT_MAX */
            struct block sum = {{0.0f}};
            for (int i = 0; i < 3; i++) /* bound: 3 */
                if (k.share[c][i] != 0.0f)
                    sum = plus(sum, k.share[c][i], response[k.of[c][i]].e, false);
            for (int e = 0; e < 9; e++) /* bound: 9 */
                s->block[contact_pair(c, d)][e] = sum.e[e];
        }
        float own[3];
        contact_multiply(s, d, d, from->normal, own);
        from->pad_m_N = contact_pad(bank->contact, real_dot(from->normal, own));
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
        contact_begin(c, points, i);
        c->triangle = p->triangle;
        c->depth_m = p->depth_m;
        contact_turn(c, p->normal);
        for (int k = 0; k < 3; k++) /* bound: 3 */
            c->weights[k] = p->weights[k];
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

/* How far the tools give way at one contact, per newton along the other. */
static float coupled(const struct contact *c, const struct contact *d)
{
    float sum = 0.0f;
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
        sum += real_dot(contact_pull(c, t), contact_pull(d, t));
    return sum;
}

void contact_displace(struct contact_set *s, const struct bank_contact *b)
{
    for (uint32_t c = 0; c < s->count; c++) /* bound: CONTACT_MAX */
        for (int a = 0; a < 3; a++)         /* bound: 3 */
            s->contact[c].displacement_m[a] = -b->regularisation_m_N * s->contact[c].force_N[a];
    for (uint32_t d = 0; d < s->count; d++) { /* bound: CONTACT_MAX */
        if (s->contact[d].pressure_N == 0.0f)
            continue;
        for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
            float moved[3];
            contact_multiply(s, c, d, s->contact[d].force_N, moved);
            for (int a = 0; a < 3; a++) /* bound: 3 */
                s->contact[c].displacement_m[a] -= moved[a];
        }
    }
}

static void assemble_system(struct contact_set *s, float softness)
{
    for (uint32_t d = 0; d < contact_all(s); d++) { /* bound: CONTACT_MAX */
        const struct contact *from = &s->contact[d];
        for (uint32_t c = d; c < contact_all(s); c++) { /* bound: CONTACT_MAX */
            float moved[3] = {0.0f, 0.0f, 0.0f};
            if (c < s->count)
                contact_multiply(s, c, d, from->normal, moved);
            float a = real_dot(s->contact[c].normal, moved) + softness * coupled(&s->contact[c], from);
            s->system[c][d] = s->system[d][c] = a;
        }
        s->system[d][d] += from->pad_m_N;
    }
}

/* Forces on the tools, and where the tissue goes: the tool pushes it against the outward normal. */
static void evaluate(struct contact_set *s, const struct bank_contact *b, const float *p)
{
    float softness = 1.0f / b->coupling_stiffness_N_m;
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) { /* bound: CONTACT_TOOLS */
        for (int a = 0; a < 3; a++) {              /* bound: 3 */
            float sum = 0.0f;
            for (uint32_t c = 0; c < contact_all(s); c++) /* bound: CONTACT_MAX */
                sum += p[c] * contact_pull(&s->contact[c], t)[a];
            s->force_N[t][a] = sum;
            s->proxy_offset_m[t][a] = softness * sum;
        }
    }
    for (uint32_t c = 0; c < contact_all(s); c++) { /* bound: CONTACT_MAX */
        struct contact *at = &s->contact[c];
        at->pressure_N = p[c];
        for (int a = 0; a < 3; a++) /* bound: 3 */
            at->force_N[a] = p[c] * at->normal[a];
    }
    contact_displace(s, b);
}

void contact_push(struct contact_set *s, const struct bank_contact *b)
{
    uint32_t m = contact_all(s), guess = 0;
    float depth[CONTACT_MAX], p[CONTACT_MAX];
    for (uint32_t c = 0; c < m; c++) { /* bound: CONTACT_MAX */
        depth[c] = s->contact[c].depth_m;
        guess |= (s->active >> s->contact[c].point & 1u) << c;
    }
    assemble_system(s, 1.0f / b->coupling_stiffness_N_m);
    bool cut = false;
    uint32_t steps = b->solver_steps ? b->solver_steps : CONTACT_MAX_FACTORS;
    s->factors = m ? contact_solve((const float(*)[CONTACT_MAX])s->system, depth, m, steps, &guess, p, &cut) : 0;
    s->cut += cut;
    s->active = 0;
    for (uint32_t c = 0; c < m; c++) /* bound: CONTACT_MAX */
        s->active |= (guess >> c & 1u) << s->contact[c].point;
    evaluate(s, b, p);
}

/* The three corners of a triangle that is not in use yet. */
static void expect_triangle(struct row_cache *g, const struct bank_view *bank, uint32_t triangle)
{
    for (int k = 0; k < 3; k++) /* bound: 3; rows that are ready cost a look */
        row_cache_expect(g, bank, bank->row_of[bank->triangles[triangle].vertex[k]]);
}

void contact_expect(const struct contact_set *s, struct row_cache *g, const struct bank_view *bank,
                    const struct collide *points, const float (*velocity_m_s)[3])
{
    if (g->stride == 0 || points->count == 0)
        return;
    for (uint32_t c = 0; c < s->count; c++) /* bound: CONTACT_MAX */
        for (int k = 0; k < 3; k++)         /* bound: 3 */
            expect_triangle(g, bank, bank->triangles[s->contact[c].triangle].neighbour[k]);

    uint32_t i = g->tick % points->count;
    const struct collide_point *p = &points->point[i];
    const float *velocity = velocity_m_s[collide_tool(points, i)];
    float ahead[3];
    struct collide_hit hit;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        ahead[k] = p->position_m[k] + CONTACT_FORESIGHT_S * velocity[k];
    if (!p->touching && p->known && collide_sweep(bank, p->position_m, ahead, &hit))
        expect_triangle(g, bank, hit.triangle);
}

void contact_forget(struct contact_set *s, const struct collide *points, uint32_t tool)
{
    const struct collide_range *range = &points->tool[tool];
    uint32_t kept = 0;
    IF_RIGID(s->rigid = 0;)
    for (uint32_t c = 0; c < s->count; c++) /* bound: CONTACT_MAX */
        if (contact_tool(&s->contact[c]) != tool)
            s->contact[kept++] = s->contact[c];
    s->count = kept;
    for (uint32_t i = range->first; i < range->first + range->count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        s->hold[i].valid = false;
        s->active &= ~(1u << i);
    }
    for (int a = 0; a < 3; a++) /* bound: 3 */
        s->force_N[tool][a] = s->proxy_offset_m[tool][a] = 0.0f;
}
