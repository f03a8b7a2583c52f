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
static void turn_jaws(struct grasp *g, const struct bank_grasp *b, uint32_t tool, const struct collide_range *points)
{
    struct grasp_jaws *j = &g->jaws[tool];
    j->closing = !j->closed && j->grip >= b->close_count;
    j->closed = j->closing || (j->closed && j->grip > b->open_count);
    for (uint32_t i = 0; i < points->count && !j->closed; i++) /* bound: BANK_MAX_TOOL_POINTS */
        g->point[points->first + i].held = false;
}

static void put(struct contact *c, const struct grasp_point *h, const float point_m[3])
{
    float asked[3];
    real_subtract(h->from_m, point_m, asked);
    contact_put(c, h->triangle, h->weights, h->normal, asked);
}

void grasp_place(struct grasp *g, const struct bank_view *bank, struct contact_set *set, const struct collide *points)
{
    uint32_t there = 0;
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
        turn_jaws(g, bank->grasp, t, &points->tool[t]);
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
        contact_begin(more, points, i);
        put(more, &g->point[i], points->point[i].position_m);
    }
}

static void ask(struct grasp *g, struct contact_set *set, const struct collide *points)
{
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        const struct grasp_point *h = &g->point[at->point];
        struct cone_contact *k = &g->system.contact[c];
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
    if (g->jaws[k->tool].closing && k->state != CONE_OPEN) {
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

void grasp_push(struct grasp *g, const struct bank_view *bank, struct contact_set *set, const struct collide *points)
{
    struct cone_system *s = &g->system;
    const float(*block)[9] = (const float(*)[9])set->block;
    cone_begin(s, set, bank);
    ask(g, set, points);
    g->cut += !cone_solve(s, block, bank->grasp->sweeps);
    cone_finish(s, set);
    uint32_t seen = 0;
    for (uint32_t c = 0; c < s->count; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &set->contact[c];
        const struct cone_contact *k = &s->contact[c];
        float response_m[3];
        cone_response(s, block, c, response_m);
        at->pressure_N = k->state == CONE_OPEN ? 0.0f : real_sqrt(real_dot(k->force_N, k->force_N));
        seen |= 1u << at->point;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            at->displacement_m[a] = set->proxy_offset_m[k->tool][a] - response_m[a];
        remember(g, bank->grasp, at, k, response_m, points->point[at->point].position_m);
    }
    for (uint32_t i = 0; i < CONTACT_MAX; i++) /* bound: CONTACT_MAX */
        if (!(seen >> i & 1u))
            for (int a = 0; a < 3; a++) /* bound: 3 */
                g->point[i].force_N[a] = 0.0f;
}

void grasp_forget(struct grasp *g, const struct collide *points, uint32_t tool)
{
    const struct collide_range *range = &points->tool[tool];
    g->jaws[tool].closed = false;
    for (uint32_t i = 0; i < range->count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        struct grasp_point *p = &g->point[range->first + i];
        p->held = false;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            p->force_N[a] = 0.0f;
    }
}
