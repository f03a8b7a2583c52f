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

void grasp_ask(const struct grasp *g, const struct contact_set *set, const struct collide *points,
               struct cone_system *s)
{
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        uint32_t i = set->contact[c].point;
        if (!g->point[i].held)
            continue;
        s->contact[c].mu = CONE_HELD;
        real_subtract(g->point[i].from_m, points->point[i].position_m, s->contact[c].wanted_m);
    }
}

/* What the tick leaves with a point: a hold that begins, a hold that slips. `rest_m`: where its force would be none. */
static void remember(struct grasp *g, const struct bank_grasp *b, const struct contact *at, bool pushes,
                     const float rest_m[3], const float point_m[3])
{
    struct grasp_point *h = &g->point[at->point];
    if (g->jaws[contact_tool(at)].closing && pushes) {
        h->held = true;
        h->triangle = at->triangle;
        g->taken++;
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            h->weights[a] = at->weights[a];
            h->normal[a] = at->normal[a];
            h->from_m[a] = rest_m[a];
        }
    }
    float force2 = real_dot(at->force_N, at->force_N);
    if (h->held && force2 > b->slip_N * b->slip_N) {
        float keep = b->slip_N / real_sqrt(force2);
        g->slips++;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            h->from_m[a] = point_m[a] + keep * (h->from_m[a] - point_m[a]);
    }
}

void grasp_follow(struct grasp *g, const struct bank_view *bank, const struct contact_set *set,
                  const struct cone_system *s, const struct collide *points, float stiffening)
{
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        const float pad = s->contact[c].pad_m_N / stiffening - bank->contact->regularisation_m_N;
        const float *point_m = points->point[at->point].position_m;
        float rest_m[3], proxy_m[3];
        cone_at_contact(s, &s->contact[c], set->proxy_offset_m[contact_tool(at)], proxy_m);
        for (int a = 0; a < 3; a++) /* bound: 3 */
            rest_m[a] = point_m[a] + proxy_m[a] - at->displacement_m[a] + pad * at->force_N[a];
        remember(g, bank->grasp, at, s->contact[c].state != CONE_OPEN, rest_m, point_m);
    }
}

void grasp_forget(struct grasp *g, const struct collide *points, uint32_t tool)
{
    const struct collide_range *range = &points->tool[tool];
    g->jaws[tool].closed = false;
    for (uint32_t i = 0; i < range->count; i++) /* bound: BANK_MAX_TOOL_POINTS */
        g->point[range->first + i].held = false;
}
