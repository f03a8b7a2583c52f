#include "effects/viscoelastic.h"

#include "real.h"
#include "safety.h"

/* Below this tissue is at rest, and a memory nothing. */
static const float REST_M = 1e-9f;

int viscoelastic_open(struct bank_view *view)
{
    const struct bank_section *section = bank_view_section(view, BANK_VISC);
    const struct bank_viscoelastic *b = (const void *)((const char *)view->header + section->offset);
    if (view->header->effects & EFFECT_SWING) /* its contacts know nothing of memory */
        return STATUS_BANK_SECTION;
    if (section->count < 1 || section->count > BANK_MAX_BRANCHES ||
        section->length != sizeof *b + section->count * sizeof b->branch[0])
        return STATUS_BANK_LENGTH;
    bool good = b->branches == section->count && b->reach_m > 0.0f && b->reach_m <= BANK_MAX_POSITION_M &&
                b->reserved[0] == 0 && b->reserved[1] == 0;
    float total = 0.0f;
    for (uint32_t k = 0; k < section->count; k++) { /* bound: BANK_MAX_BRANCHES */
        const struct bank_branch *branch = &b->branch[k];
        good = good && branch->decay >= 0.0f && branch->decay < 1.0f && branch->gain > 0.0f && branch->share >= 0.0f &&
               branch->time_s >= 0.0f && real_finite(branch->share) && real_finite(branch->time_s);
        total += branch->gain;
    }
    view->viscoelastic = b;
    return good && total <= BANK_MAX_GAIN ? STATUS_OK : STATUS_BANK_NONFINITE;
}

static struct viscoelastic_step step_of(const struct bank_viscoelastic *b, uint32_t ticks)
{
    struct viscoelastic_step s = {.branches = b->branches, .total = 1.0f};
    for (uint32_t k = 0; k < b->branches; k++) { /* bound: BANK_MAX_BRANCHES */
        float decay = b->branch[k].decay, sum = 1.0f, power = decay;
        for (uint32_t t = 1; t < ticks; t++) { /* bound: SAFETY_STALE_TICKS; sum = 1 + a + a^2 ... */
            sum += power;
            power *= decay;
        }
        s.decay[k] = power;
        s.gain[k] = b->branch[k].gain * sum / (float)ticks;
        s.total += s.gain[k];
    }
    return s;
}

/* m = sum a_b h_b - sum c_b u */
static void memory_of(const struct viscoelastic_point *p, const struct viscoelastic_step *s, float m[3])
{
    for (int a = 0; a < 3; a++) { /* bound: 3 */
        m[a] = (1.0f - s->total) * p->moved_m[a];
        for (uint32_t b = 0; b < s->branches; b++) /* bound: BANK_MAX_BRANCHES */
            m[a] += s->decay[b] * p->memory_m[b][a];
    }
}

static float settled(float x)
{
    return x < REST_M && x > -REST_M ? 0.0f : x;
}

/* The tissue is now at u. */
static void advance(struct viscoelastic_point *p, const struct viscoelastic_step *s, const float moved_m[3])
{
    bool rests = true;
    for (int a = 0; a < 3; a++) { /* bound: 3 */
        float by = moved_m[a] - p->moved_m[a];
        p->moved_m[a] = settled(moved_m[a]);
        rests &= p->moved_m[a] == 0.0f;
        for (uint32_t b = 0; b < s->branches; b++) { /* bound: BANK_MAX_BRANCHES */
            p->memory_m[b][a] = settled(s->decay[b] * p->memory_m[b][a] + s->gain[b] * by);
            rests &= p->memory_m[b][a] == 0.0f;
        }
    }
    p->remembers = !rests;
}

/* What it knows is of another place. */
static bool strayed(const struct viscoelastic_point *p, const float anchor_m[3], float reach_m)
{
    float way[3];
    real_subtract(anchor_m, p->anchor_m, way);
    return real_dot(way, way) > reach_m * reach_m;
}

/* Of all that pushes: u and h_b as shares of w, weighted by p w. */
struct shares {
    float moved, memory[BANK_MAX_BRANCHES];
};

static struct shares shares_of(const struct viscoelastic *v, const struct contact_set *set,
                               const struct viscoelastic_step *s)
{
    struct shares share = {.moved = 0.0f};
    float work = 0.0f;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        const struct viscoelastic_point *p = &v->point[at->point];
        float moved = -real_dot(at->force_N, p->moved_m), all = moved;
        share.moved += moved;
        for (uint32_t b = 0; b < s->branches; b++) { /* bound: BANK_MAX_BRANCHES */
            float memory = -real_dot(at->force_N, p->memory_m[b]);
            share.memory[b] += memory;
            all += memory;
        }
        work += all;
    }
    float scale = work > 0.0f ? 1.0f / work : 0.0f;
    share.moved = scale > 0.0f ? share.moved * scale : 1.0f; /* nothing pushes: as if at rest for long */
    for (uint32_t b = 0; b < s->branches; b++)               /* bound: BANK_MAX_BRANCHES */
        share.memory[b] *= scale;
    return share;
}

static float sum_of(const struct contact_set *set)
{
    float sum = 0.0f;
    for (uint32_t c = 0; c < set->count; c++) /* bound: CONTACT_MAX */
        sum += set->contact[c].pressure_N;
    return sum;
}

void viscoelastic_ask(struct viscoelastic *v, const struct bank_view *bank, const struct contact_set *set,
                      const struct collide *points, uint32_t tick)
{
    uint32_t ticks = v->started ? tick - v->tick : 1;
    if (ticks < 1 || ticks > SAFETY_STALE_TICKS)
        ticks = 1;
    v->step = step_of(bank->viscoelastic, ticks);
    v->fresh = 0;
    v->started = true;
    v->tick = tick;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        struct viscoelastic_point *p = &v->point[at->point];
        const float *anchor_m = points->point[at->point].anchor_m;
        if (!p->in_set && (!p->remembers || strayed(p, anchor_m, bank->viscoelastic->reach_m))) {
            *p = (struct viscoelastic_point){.remembers = false};
            v->fresh |= 1u << c;
        }
        for (int a = 0; a < 3; a++) /* bound: 3 */
            p->anchor_m[a] = anchor_m[a];
        memory_of(p, &v->step, v->memory_m[c]);
        v->depth_m[c] = at->depth_m;
    }
    v->contact = *bank->contact;
    v->contact.coupling_stiffness_N_m /= v->step.total;
    v->contact.regularisation_m_N *= v->step.total;
}

void viscoelastic_deepen(const struct viscoelastic *v, struct contact_set *set)
{
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &set->contact[c];
        at->depth_m = v->step.total * at->depth_m - real_dot(at->normal, v->memory_m[c]);
        at->pad_m_N *= v->step.total;
    }
}

void viscoelastic_want(const struct viscoelastic *v, uint32_t c, float wanted_m[3])
{
    for (int a = 0; a < 3; a++) /* bound: 3 */
        wanted_m[a] = v->step.total * wanted_m[a] - v->memory_m[c][a];
}

/* The displaced tissue of a point that pushes nothing goes back by itself, or where the others push it. */
static void relax(struct viscoelastic_point *p, const struct viscoelastic_step *s, float sum_N)
{
    float m[3];
    memory_of(p, s, m);
    for (int a = 0; a < 3; a++) /* bound: 3 */
        m[a] = (p->others_m_N[a] * sum_N - m[a]) / s->total;
    advance(p, s, m);
}

void viscoelastic_follow(struct viscoelastic *v, const struct bank_view *bank, struct contact_set *set)
{
    const struct viscoelastic_step *s = &v->step;
    const float whole = 1.0f / s->total, epsilon = bank->contact->regularisation_m_N;
    float elastic[CONTACT_MAX][3]; /* w */
    uint32_t fresh = v->fresh, seen = 0;
    for (uint32_t i = 0; i < CONTACT_TOOLS; i++) /* bound: CONTACT_TOOLS */
        for (int a = 0; a < 3; a++)              /* bound: 3 */
            set->proxy_offset_m[i][a] *= whole;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &set->contact[c];
        float moved[3];
        at->depth_m = v->depth_m[c];
        seen |= 1u << at->point;
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            float pad = epsilon * at->force_N[a];
            elastic[c][a] = at->displacement_m[a] + s->total * pad;
            at->displacement_m[a] = whole * (at->displacement_m[a] - v->memory_m[c][a]);
            moved[a] = at->displacement_m[a] + pad;
        }
        if (!(fresh >> c & 1u) || at->pressure_N > 0.0f) {
            advance(&v->point[at->point], s, moved);
            fresh &= ~(1u << c);
        }
    }
    const struct shares share = shares_of(v, set, s);
    const float sum_N = sum_of(set);
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &set->contact[c];
        struct viscoelastic_point *p = &v->point[at->point];
        for (int a = 0; a < 3 && (fresh >> c & 1u); a++) { /* bound: 3 */
            p->moved_m[a] = at->displacement_m[a] = share.moved * elastic[c][a];
            for (uint32_t b = 0; b < s->branches; b++) /* bound: BANK_MAX_BRANCHES */
                p->memory_m[b][a] = share.memory[b] * elastic[c][a];
        }
        float others_N = sum_N - at->pressure_N, own[3];
        contact_multiply(set, c, c, at->force_N, own);
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            float others_m = elastic[c][a] + own[a];
            p->others_m_N[a] = others_N > 0.0f ? others_m / others_N : 0.0f;
        }
        p->remembers = true;
    }
    for (uint32_t i = 0; i < CONTACT_MAX; i++) { /* bound: CONTACT_MAX */
        struct viscoelastic_point *p = &v->point[i];
        p->in_set = seen >> i & 1u;
        if (!p->in_set && p->remembers)
            relax(p, s, sum_N);
    }
}

void viscoelastic_forget(struct viscoelastic *v, const struct collide_range *points)
{
    for (uint32_t i = 0; i < points->count; i++) /* bound: BANK_MAX_TOOL_POINTS */
        v->point[points->first + i] = (struct viscoelastic_point){.remembers = false};
    v->started = false;
}
