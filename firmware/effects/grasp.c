#include "effects/grasp.h"

#include "real.h"

int grasp_open(struct bank_view *view)
{
    const struct bank_section *section = bank_view_section(view, BANK_GRSP);
    const struct bank_grasp *b = (const void *)((const char *)view->header + section->offset);
    if (section->count != 1 || section->length != sizeof *b)
        return STATUS_BANK_LENGTH;
    bool good = b->open_count < b->close_count && b->close_count <= BANK_MAX_GRIP && b->slip_N > 0.0f &&
                b->slip_N <= 1e3f && b->sweeps >= 1 && b->sweeps <= BANK_MAX_SWEEPS;
    view->grasp = b;
    return good ? STATUS_OK : STATUS_BANK_NONFINITE;
}

/* The jaws have two thresholds, so that a grip near one of them does not chatter. */
static void jaws(struct grasp *g, const struct bank_grasp *b, uint16_t grip)
{
    g->closing = !g->closed && grip >= b->close_count;
    g->closed = g->closing || (g->closed && grip > b->open_count);
    for (uint32_t i = 0; i < CONTACT_MAX && !g->closed; i++) /* bound: CONTACT_MAX */
        g->point[i].held = false;
}

static void put(struct contact *c, const struct grasp_point *h, const float point_m[3])
{
    float asked[3];
    real_subtract(h->from_m, point_m, asked);
    c->triangle = h->triangle;
    c->depth_m = real_dot(h->normal, asked);
    for (int k = 0; k < 3; k++) { /* bound: 3 */
        c->weights[k] = h->weights[k];
        c->normal[k] = h->normal[k];
    }
}

void grasp_place(struct grasp *g, const struct bank_view *bank, struct contact_set *set, const struct collide *points,
                 uint16_t grip)
{
    uint32_t there = 0;
    jaws(g, bank->grasp, grip);
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &set->contact[c];
        there |= 1u << at->point;
        if (g->point[at->point].held)
            put(at, &g->point[at->point], points->point[at->point].position_m);
    }
    for (uint32_t i = 0; i < points->count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        if (!g->point[i].held || there >> i & 1u)
            continue;
        struct contact *more = &set->contact[set->count++]; /* one per point of the tool at most: there is room */
        *more = (struct contact){.point = i};
        put(more, &g->point[i], points->point[i].position_m);
    }
}

static void ask(struct grasp *g, const struct bank_view *bank, struct contact_set *set, const struct collide *points)
{
    (void)bank;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        const struct grasp_point *h = &g->point[at->point];
        struct cone_contact *k = &g->system.contact[c];
        cone_frame(k, at->normal);
        k->mu = h->held ? CONE_HELD : 0.0f;
        k->slip_m_N = 0.0f;
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            k->force_N[a] = h->force_N[a];
            k->wanted_m[a] =
                h->held ? h->from_m[a] - points->point[at->point].position_m[a] : at->depth_m * at->normal[a];
        }
    }
}

/* What the tick leaves with a point: its force, a hold that begins, a hold that slips. */
static void remember(struct grasp *g, const struct bank_grasp *b, const struct contact *at,
                     const struct cone_contact *k, const float response_m[3], const float point_m[3])
{
    struct grasp_point *h = &g->point[at->point];
    for (int a = 0; a < 3; a++) /* bound: 3 */
        h->force_N[a] = k->force_N[a];
    if (g->closing && k->state != CONE_OPEN) {
        h->held = true;
        h->triangle = at->triangle;
        g->taken++;
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            h->weights[a] = at->weights[a];
            h->normal[a] = at->normal[a];
            h->from_m[a] = point_m[a] + response_m[a];
        }
    }
    float force2 = real_dot(k->force_N, k->force_N);
    if (h->held && force2 > b->slip_N * b->slip_N) {
        float keep = b->slip_N / real_sqrt(force2);
        g->slips++;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            h->from_m[a] = point_m[a] + keep * (h->from_m[a] - point_m[a]);
    }
}

void grasp_push(struct grasp *g, const struct bank_view *bank, struct contact_set *set, const struct row_cache *rows,
                const struct collide *points)
{
    struct cone_system *s = &g->system;
    const float softness = 1.0f / bank->contact->coupling_stiffness_N_m;
    cone_assemble(s, set, rows, bank);
    ask(g, bank, set, points);
    g->cut += !cone_solve(s, bank->grasp->sweeps);
    for (int a = 0; a < 3; a++) { /* bound: 3 */
        float sum = 0.0f;
        for (uint32_t c = 0; c < s->count; c++) /* bound: CONTACT_MAX */
            sum += s->contact[c].force_N[a];
        set->force_N[a] = sum;
        set->proxy_offset_m[a] = softness * sum;
    }
    set->active = 0;
    uint32_t seen = 0;
    for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &set->contact[c];
        const struct cone_contact *k = &s->contact[c];
        float response_m[3];
        cone_response(s, c, response_m);
        at->pressure_N = k->state == CONE_OPEN ? 0.0f : real_sqrt(real_dot(k->force_N, k->force_N));
        set->active |= (uint32_t)(k->state != CONE_OPEN) << at->point;
        seen |= 1u << at->point;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            at->displacement_m[a] = set->proxy_offset_m[a] - response_m[a];
        remember(g, bank->grasp, at, k, response_m, points->point[at->point].position_m);
    }
    for (uint32_t i = 0; i < CONTACT_MAX; i++) /* bound: CONTACT_MAX */
        if (!(seen >> i & 1u))
            for (int a = 0; a < 3; a++) /* bound: 3 */
                g->point[i].force_N[a] = 0.0f;
}

void grasp_forget(struct grasp *g)
{
    g->closed = false;
    for (uint32_t i = 0; i < CONTACT_MAX; i++) { /* bound: CONTACT_MAX */
        g->point[i].held = false;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            g->point[i].force_N[a] = 0.0f;
    }
}
