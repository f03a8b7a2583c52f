#include "effects/friction.h"

#include "real.h"

int friction_open(struct bank_view *view)
{
    const struct bank_section *section = bank_view_section(view, BANK_FRIC);
    const struct bank_friction *b = (const void *)((const char *)view->header + section->offset);
    if (section->count != 1 || section->length != sizeof *b)
        return STATUS_BANK_LENGTH;
    bool good = b->mu > 0.0f && b->mu <= BANK_MAX_FRICTION && b->sweeps >= 1 && b->sweeps <= BANK_MAX_SWEEPS &&
                b->reserved[0] == 0 && b->reserved[1] == 0;
    view->friction = b;
    return good ? STATUS_OK : STATUS_BANK_NONFINITE;
}

/* Take out of v its part along the unit vector n. */
static void flatten(float v[3], const float n[3])
{
    float along = real_dot(v, n);
    for (int k = 0; k < 3; k++) /* bound: 3 */
        v[k] -= along * n[k];
}

static bool is_zero(const float v[3])
{
    return v[0] == 0.0f && v[1] == 0.0f && v[2] == 0.0f;
}

/* Put the contact on the anchor that its point holds, and measure depth and normal there. */
static void put(struct contact *c, const struct collide_point *at, const float point_m[3])
{
    float away[3];
    real_subtract(at->anchor_m, point_m, away);
    contact_put(c, at->triangle, at->weights, at->normal, away);
}

/* A point that slides, or whose anchor lags further than friction can hold it: where the contact without friction would be,
 * but for the trail. */
static void slide_on(struct friction_point *h, const struct bank_view *bank, struct contact *contact,
                     const struct collide_point *p)
{
    if (is_zero(h->trail_m))
        return;
    struct collide_point anchor = *p;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        anchor.position_m[k] += h->trail_m[k];
    /* Depth changes along the surface by less than the way, except where normals have crossed and it is not defined. */
    float trail = real_sqrt(real_dot(h->trail_m, h->trail_m));
    if (collide_settle(bank, &anchor) && anchor.depth_m < p->depth_m + trail && anchor.depth_m > p->depth_m - trail)
        put(contact, &anchor, p->position_m);
    else
        h->trail_m[0] = h->trail_m[1] = h->trail_m[2] = 0.0f;
}

/* A point that sticks: on its anchor. */
static void stay(struct friction_point *h, const struct bank_view *bank, struct contact *contact,
                 const struct collide_point *p)
{
    struct collide_point anchor = *p;
    anchor.triangle = h->triangle;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        anchor.weights[k] = h->weights[k];
    collide_measure(bank, &anchor);
    real_subtract(anchor.anchor_m, p->anchor_m, h->trail_m);
    flatten(h->trail_m, anchor.normal);
    float trail2 = real_dot(h->trail_m, h->trail_m), most = FRICTION_TRAIL * bank->friction->mu * p->depth_m;
    if (trail2 <= most * most) {
        put(contact, &anchor, p->position_m);
        return;
    }
    float keep = most / real_sqrt(trail2);
    for (int k = 0; k < 3; k++) /* bound: 3 */
        h->trail_m[k] *= keep;
    slide_on(h, bank, contact, p);
}

void friction_place(struct friction *f, const struct bank_view *bank, struct contact_set *set,
                    const struct collide *points)
{
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        struct contact *contact = &set->contact[c];
        const struct collide_point *p = &points->point[contact->point];
        struct friction_point *h = &f->point[contact->point];
        if (!h->holds) {
            *h = (struct friction_point){.holds = false};
        } else {
            for (int k = 0; k < 3; k++) /* bound: 3 */
                h->stretch_m[k] -= p->position_m[k] - h->point_m[k];
            if (h->slides)
                slide_on(h, bank, contact, p);
            else
                stay(h, bank, contact, p);
            flatten(h->stretch_m, contact->normal);
        }
        for (int k = 0; k < 3; k++) /* bound: 3 */
            h->point_m[k] = p->position_m[k];
    }
}

void friction_ask(const struct friction *f, const struct bank_view *bank, const struct contact_set *set,
                  struct cone_system *s)
{
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct friction_point *h = &f->point[set->contact[c].point];
        s->contact[c].mu = bank->friction->mu;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            s->contact[c].wanted_m[a] += h->stretch_m[a];
    }
}

/* What a slide of this tick changes: the stretch is shortened to what friction holds, and the anchor draws nearer to where
 * the contact would be without friction by as much as the point slid. */
static void slip(struct friction_point *h, const float force_N[3], const float normal[3], float slip_m_N)
{
    float across[3] = {force_N[0], force_N[1], force_N[2]};
    flatten(across, normal);
    for (int a = 0; a < 3; a++) /* bound: 3 */
        h->stretch_m[a] -= slip_m_N * across[a];
    float trail = real_sqrt(real_dot(h->trail_m, h->trail_m));
    float slid = slip_m_N * real_sqrt(real_dot(across, across)), keep = slid < trail ? 1.0f - slid / trail : 0.0f;
    for (int a = 0; a < 3; a++) /* bound: 3 */
        h->trail_m[a] *= keep;
}

void friction_follow(struct friction *f, const struct contact_set *set, const struct cone_system *s, float stiffening)
{
    uint32_t seen = 0;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *contact = &set->contact[c];
        const struct cone_contact *k = &s->contact[c];
        struct friction_point *h = &f->point[contact->point];
        seen |= 1u << contact->point;
        h->holds = k->state != CONE_OPEN && !(k->mu < 0.0f); /* what jaws hold is theirs */
        h->slides = k->state == CONE_SLIDE;
        h->triangle = contact->triangle;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            h->weights[a] = contact->weights[a];
        if (h->slides)
            slip(h, k->force_N, contact->normal, k->slip_m_N / stiffening);
    }
    for (uint32_t i = 0; i < CONTACT_MAX; i++) /* bound: CONTACT_MAX */
        if (!(seen >> i & 1u))
            f->point[i].holds = false;
}

void friction_forget(struct friction *f, const struct collide_range *points)
{
    for (uint32_t i = 0; i < points->count; i++) /* bound: BANK_MAX_TOOL_POINTS */
        f->point[points->first + i].holds = false;
}
