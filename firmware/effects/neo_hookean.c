#include "effects/neo_hookean.h"

#include "real.h"

int neo_hookean_open(struct bank_view *view)
{
    const struct bank_section *section = bank_view_section(view, BANK_NEOH);
    const struct bank_neo_hookean *b = (const void *)((const char *)view->header + section->offset);
    if (view->header->effects &
        (EFFECT_FRICTION | EFFECT_SWING | EFFECT_VISCOELASTIC | EFFECT_GRASP | EFFECT_RIGID | EFFECT_QUASI_NONLINEAR))
        return STATUS_BANK_SECTION;
    if (section->count != view->vertex_count || section->length != sizeof *b + section->count * sizeof b->vertex[0])
        return STATUS_BANK_LENGTH;
    bool good = b->reserved[0] == 0 && b->reserved[1] == 0 && b->reserved[2] == 0 && b->radius_m > 0.0f &&
                b->radius_m <= BANK_MAX_POSITION_M;
    for (uint32_t v = 0; v < section->count; v++) { /* bound: BANK_MAX_VERTICES */
        const struct bank_cubic *at = &b->vertex[v];
        good = good && at->unit_m_N2 >= 0.0f && at->unit_m_N2 <= BANK_MAX_CUBIC && at->range_J > 0.0f &&
               at->range_J <= BANK_MAX_RANGE_J;
    }
    view->neo_hookean = b;
    return good ? STATUS_OK : STATUS_BANK_NONFINITE;
}

struct form {
    float cubic[BANK_CUBIC_TERMS], range_J;
};

/* form += w (that of a contact, between the corners of its triangle) */
static void add_form(const struct bank_view *bank, const struct contact *c, float w, struct form *form)
{
    const uint16_t *vertex = bank->triangles[c->triangle].vertex;
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        const struct bank_cubic *at = &bank->neo_hookean->vertex[vertex[i]];
        float unit = w * c->weights[i] * at->unit_m_N2;
        form->range_J += w * c->weights[i] * at->range_J;
        for (int k = 0; k < BANK_CUBIC_TERMS; k++) /* bound: BANK_CUBIC_TERMS */
            form->cubic[k] += unit * (float)at->cubic[k];
    }
}

/* T and its gradient; a cubic form is a third of its slope along F. */
static float energy(const float t[BANK_CUBIC_TERMS], const float F[3], float g[3])
{
    float x = F[0], y = F[1], z = F[2];
    g[0] = 3.0f * t[0] * x * x + 2.0f * x * (t[3] * y + t[4] * z) + t[5] * y * y + t[7] * z * z + t[9] * y * z;
    g[1] = 3.0f * t[1] * y * y + 2.0f * y * (t[5] * x + t[6] * z) + t[3] * x * x + t[8] * z * z + t[9] * x * z;
    g[2] = 3.0f * t[2] * z * z + 2.0f * z * (t[7] * x + t[8] * y) + t[4] * x * x + t[6] * y * y + t[9] * x * y;
    return real_dot(g, F) * (1.0f / 3.0f);
}

/* A tool's linear answer. */
struct answer {
    uint32_t tool;
    float sum_N, force_N[3];    /* P, F */
    float work_J, spring_J;     /* Q, Z */
    float depth_m[CONTACT_MAX]; /* C p: what of the depth the tissue gives way to this tool */
};

static bool own(const struct answer *r, const struct contact *c)
{
    return contact_tool(c) == r->tool;
}

static void answer_of(const struct contact_set *set, const struct bank_view *bank, uint32_t tool, struct answer *r)
{
    const float softness = 1.0f / bank->contact->coupling_stiffness_N_m;
    float pull_N[3] = {0.0f, 0.0f, 0.0f};
    *r = (struct answer){.tool = tool};
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        if (!own(r, at))
            continue;
        r->sum_N += at->pressure_N;
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            r->force_N[a] -= at->pressure_N * at->normal[a];
            pull_N[a] += at->pressure_N * contact_pull(at, tool)[a];
        }
    }
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        if (!own(r, at))
            continue;
        float sum = -softness * real_dot(contact_pull(at, tool), pull_N);
        for (uint32_t e = 0; e < set->count; e++) /* bound: CONTACT_MAX */
            sum += own(r, &set->contact[e]) ? set->system[c][e] * set->contact[e].pressure_N : 0.0f;
        r->depth_m[c] = sum;
        r->work_J += at->pressure_N * sum;
    }
    r->spring_J = softness * real_dot(pull_N, pull_N);
}

/* g of each of its contacts; returns h. */
static float raise(struct neo_hookean *n, const struct bank_view *bank, const struct contact_set *set,
                   const struct answer *r, float g[CONTACT_MAX])
{
    struct form form = {.range_J = 0.0f};
    const float whole = 1.0f / r->sum_N, Q = r->work_J;
    float slope[3], unused[3], s = 1.0f;
    for (uint32_t c = 0; c < set->count; c++) /* bound: CONTACT_MAX */
        if (own(r, &set->contact[c]))
            add_form(bank, &set->contact[c], whole * set->contact[c].pressure_N, &form);
    const float T = energy(form.cubic, r->force_N, slope);
    if (Q > form.range_J) {
        s = real_sqrt(form.range_J / Q);
        n->beyond++;
    }
    const float taken = s * (3.0f + s * (s - 3.0f)), turn = 3.0f * (1.0f - s) * (1.0f - s); /* and its d/ds */
    for (uint32_t e = 0; e < set->count; e++) {                                             /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[e];
        if (!own(r, at))
            continue;
        struct form here = {.range_J = 0.0f};
        add_form(bank, at, 1.0f, &here);
        float apart = whole * (energy(here.cubic, r->force_N, unused) - T);
        float shrink = 0.5f * whole * (here.range_J / form.range_J - 1.0f) - r->depth_m[e] / Q; /* d ln s / dp_e */
        g[e] = taken * (apart - real_dot(at->normal, slope)) + T * turn * s * shrink;
    }
    return T * (3.0f * taken - turn * s) / Q;
}

/* Depths of the next push, and where the tissue then is: where the linear answer of l says, not where more force would be. */
struct next {
    float raise_m[CONTACT_MAX], moved_m[CONTACT_MAX][3];
};

static void correct_tool(struct neo_hookean *n, const struct bank_view *bank, const struct contact_set *set,
                         uint32_t tool, struct next *next)
{
    struct answer r;
    float g[CONTACT_MAX];
    n->share[tool] = 0.0f;
    answer_of(set, bank, tool, &r);
    if (!(r.sum_N > 0.0f && r.work_J > 0.0f))
        return;
    n->share[tool] = raise(n, bank, set, &r, g);
    const float inside = 1.0f + 4.0f * n->share[tool] * r.spring_J / (r.work_J + r.spring_J);
    const float l = 2.0f / (1.0f + real_sqrt(inside > 0.0f ? inside : 0.0f));
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        if (!own(&r, &set->contact[c]))
            continue;
        next->raise_m[c] = l * l * g[c];
        for (int a = 0; a < 3; a++) /* bound: 3 */
            next->moved_m[c][a] *= l;
    }
}

/* Starts from the answer's own set, and takes what the first push left of the tick's steps. */
static void push_again(const struct bank_view *bank, struct contact_set *set)
{
    struct bank_contact left = *bank->contact;
    const uint32_t factors = set->factors, most = left.solver_steps ? left.solver_steps : CONTACT_MAX_FACTORS;
    left.solver_steps = (uint16_t)(most > factors ? most - factors : 1);
    contact_push(set, &left);
    set->factors += factors;
}

void neo_hookean_correct(struct neo_hookean *n, const struct bank_view *bank, struct contact_set *set)
{
    struct next next;
    float depth_m[CONTACT_MAX];
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        next.raise_m[c] = 0.0f;
        depth_m[c] = set->contact[c].depth_m;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            next.moved_m[c][a] = set->contact[c].displacement_m[a];
    }
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) { /* bound: CONTACT_TOOLS */
        for (int a = 0; a < 3; a++)                /* bound: 3 */
            n->linear_N[t][a] = set->force_N[t][a];
        correct_tool(n, bank, set, t, &next);
    }
    if (set->count == 0)
        return;
    for (uint32_t c = 0; c < set->count; c++) /* bound: CONTACT_MAX */
        set->contact[c].depth_m += next.raise_m[c];
    push_again(bank, set);
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        set->contact[c].depth_m = depth_m[c];
        for (int a = 0; a < 3; a++) /* bound: 3 */
            set->contact[c].displacement_m[a] = next.moved_m[c][a];
    }
}
