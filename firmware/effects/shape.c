#include "effects/shape.h"

#include "real.h"

#define HALF_TURN_RAD 3.14159265f
/* A place counts as the anchor when it lies beside the centre's normal by at most this, in radii; beyond the lesser figure the walk
 * has stopped at an edge between faces that turn sharply, and goes on once more. */
#define BESIDE      0.25f
#define BESIDE_EDGE 0.02f

static const uint16_t *seeds(const struct bank_shape *b)
{
    return (const uint16_t *)(b + 1);
}

int shape_open(struct bank_view *view)
{
    const struct bank_section *section = bank_view_section(view, BANK_SHAP);
    const struct bank_shape *b = (const void *)((const char *)view->header + section->offset);
    if (section->length < sizeof *b)
        return STATUS_BANK_LENGTH;
    uint32_t cells = 1;
    for (int k = 0; k < 3; k++) { /* bound: 3 */
        if (b->cells[k] < 1 || b->cells[k] > BANK_MAX_GRID_AXIS)
            return STATUS_BANK_INDEX;
        cells *= b->cells[k];
        if (cells > BANK_MAX_GRID_CELLS)
            return STATUS_BANK_INDEX;
    }
    if (section->count != cells || section->length != sizeof *b + 4 * cells)
        return STATUS_BANK_LENGTH;
    for (uint32_t i = 0; i < 2 * cells; i++) { /* bound: 2 BANK_MAX_GRID_CELLS */
        uint16_t seed = seeds(b)[i];
        if (seed != BANK_NONE && seed >= view->triangle_count) {
            view->fault_record = i / 2;
            return STATUS_BANK_INDEX;
        }
    }
    bool good = b->band_m > 0.0f && b->band_m <= BANK_MAX_POSITION_M && b->cell_m > 0.0f &&
                b->cell_m <= BANK_MAX_POSITION_M && b->reserved == 0 && !b->zero[0] && !b->zero[1] && !b->zero[2];
    for (int k = 0; k < 3; k++) /* bound: 3 */
        good = good && b->origin_m[k] >= -BANK_MAX_POSITION_M && b->origin_m[k] <= BANK_MAX_POSITION_M;
    for (int t = 0; t < BANK_MAX_INSTRUMENTS; t++) /* bound: BANK_MAX_INSTRUMENTS */
        good = good && b->opening_rad[t] >= 0.0f && b->opening_rad[t] <= BANK_MAX_OPENING_RAD;
    for (int i = 0; i < BANK_MAX_TOOL_POINTS; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        const struct bank_sphere *p = &b->sphere[i];
        good = good && p->radius_m >= 0.0f && p->radius_m <= b->band_m && p->along_m >= 0.0f &&
               p->along_m <= BANK_MAX_POSITION_M && (p->side == -1.0f || p->side == 0.0f || p->side == 1.0f) &&
               p->reserved[0] == 0 && p->reserved[1] == 0;
        for (int k = 0; k < 3; k++) /* bound: 3 */
            good = good && p->centre_m[k] >= -BANK_MAX_POSITION_M && p->centre_m[k] <= BANK_MAX_POSITION_M;
    }
    view->shape = b;
    return good ? STATUS_OK : STATUS_BANK_NONFINITE;
}

void shape_sense(struct shape *s, uint32_t tool, uint16_t roll, uint16_t grip)
{
    struct shape_tool *t = &s->tool[tool];
    t->grip = t->started ? t->grip + SHAPE_BLEND * ((float)grip - t->grip) : (float)grip;
    t->roll = roll;
    t->started = true;
}

void shape_move(const struct shape *s, const struct bank_view *bank, uint32_t tool, uint32_t first, uint32_t count,
                const struct kinematics *k, float (*points_m)[3])
{
    const struct bank_shape *b = bank->shape;
    const struct shape_tool *t = &s->tool[tool];
    float theta = b->opening_rad[tool] * real_clamp(1.0f - t->grip / (float)BANK_MAX_GRIP, 0.0f, 1.0f);
    float half = HALF_TURN_RAD * ((float)t->roll - (float)BANK_MIDDLE_ROLL) / (float)(2 * BANK_MIDDLE_ROLL);
    float wide = real_sin(theta), ahead = real_cos(theta), sine = real_sin(half), cosine = real_cos(half);
    float turn[2] = {cosine * cosine - sine * sine, 2.0f * sine * cosine};
    for (uint32_t i = 0; i < count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        const struct bank_sphere *p = &b->sphere[first + i];
        float x = p->centre_m[0] + p->along_m * p->side * wide, y = p->centre_m[1];
        float at[3] = {turn[0] * x - turn[1] * y, turn[1] * x + turn[0] * y,
                       p->centre_m[2] + p->along_m * p->side * p->side * ahead};
        kinematics_point(k, at, points_m[first + i]);
    }
}

void shape_hide(const struct shape *s, struct collide *points)
{
    for (uint32_t i = 0; i < points->count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        struct collide_point *p = &points->point[i];
        if (s->outside >> i & 1u)
            p->touching = false;
        else if (p->touching)
            p->depth_m = s->centre_depth_m[i];
    }
}

/* From a place on the surface to the anchor of a centre outside the body. False when there is none from here. */
static bool anchor(const struct bank_view *bank, struct collide_point *p, float band_m, float radius_m)
{
    float beside2 = 0.0f;
    for (int turn = 0; turn < 2; turn++) { /* bound: 2 */
        float away[3];
        collide_settle(bank, p); /* what it says of itself is judged by the outcome */
        real_subtract(p->anchor_m, p->position_m, away);
        beside2 = real_dot(away, away) - p->depth_m * p->depth_m;
        if (beside2 <= BESIDE_EDGE * BESIDE_EDGE * radius_m * radius_m)
            break;
    }
    float most = BESIDE * radius_m;
    return p->depth_m > -band_m && p->depth_m <= BESIDE_EDGE * radius_m && beside2 <= most * most;
}

/* The nearest place from the seeds of the cell that the centre is in. */
static bool seek(const struct bank_shape *b, const struct bank_view *bank, float radius_m, struct collide_point *p)
{
    uint32_t cell = 0, stride = 1;
    for (int k = 0; k < 3; k++) { /* bound: 3 */
        float x = (p->position_m[k] - b->origin_m[k]) / b->cell_m;
        if (!(x >= 0.0f && x < (float)b->cells[k]))
            return false;
        cell += stride * (uint32_t)x;
        stride *= b->cells[k];
    }
    struct collide_point best = *p;
    bool found = false;
    for (int e = 0; e < 2; e++) { /* bound: 2 */
        uint16_t seed = seeds(b)[2 * cell + (uint32_t)e];
        if (seed == BANK_NONE)
            break;
        struct collide_point q = *p;
        q.triangle = seed;
        q.weights[0] = q.weights[1] = q.weights[2] = 1.0f / 3.0f;
        q.depth_m = 0.0f;
        if (anchor(bank, &q, b->band_m, radius_m) && (!found || q.depth_m > best.depth_m)) {
            best = q;
            found = true;
        }
    }
    *p = best;
    return found;
}

/* The anchor of a centre outside: it follows the one before; a free one in its turn, or without one, asks its seeds. */
static bool reach(struct shape *s, const struct bank_view *bank, uint32_t i, float radius_m, struct collide_point *p)
{
    const struct bank_shape *b = bank->shape;
    bool touched = s->outside >> i & 1u;
    struct collide_point kept = *p;
    kept.depth_m = s->centre_depth_m[i];
    bool near = (s->near >> i & 1u) && anchor(bank, &kept, b->band_m, radius_m);
    if (near && (touched || i != s->turn)) {
        *p = kept;
        return true;
    }
    s->lost += touched;
    if (seek(b, bank, radius_m, p) && (!near || p->depth_m > kept.depth_m))
        return true;
    *p = kept;
    return near;
}

void shape_touch(struct shape *s, const struct bank_view *bank, struct collide *points)
{
    s->turn = s->turn + 1 < points->count ? s->turn + 1 : 0;
    for (uint32_t i = 0; i < points->count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        struct collide_point *p = &points->point[i];
        float radius_m = bank->shape->sphere[i].radius_m;
        uint32_t bit = 1u << i;
        bool inside = p->known && p->touching, near = inside;
        if (!inside && p->known && radius_m > 0.0f)
            near = reach(s, bank, i, radius_m, p);
        s->centre_depth_m[i] = p->depth_m;
        s->near = near ? s->near | bit : s->near & ~bit;
        if (near)
            p->depth_m += radius_m;
        p->touching = near && p->depth_m > 0.0f;
        s->outside = p->touching && !inside ? s->outside | bit : s->outside & ~bit;
        for (int k = 0; k < 3 && p->touching && !inside; k++) /* bound: 3 */
            p->shallow_normal[k] = p->normal[k];
    }
}

/* Where a contact's sphere touches. */
static void place_of(const struct bank_view *bank, const struct collide *points, const struct contact *at,
                     float place[3])
{
    float radius_m = bank->shape->sphere[at->point].radius_m;
    for (int a = 0; a < 3; a++) /* bound: 3 */
        place[a] = points->point[at->point].position_m[a] - radius_m * at->normal[a];
}

void shape_place(const struct bank_view *bank, struct contact_set *set, const struct collide *points, uint32_t tool,
                 const struct kinematics *k)
{
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &set->contact[c];
        float place[3];
        if (contact_tool(at) != tool)
            continue;
        place_of(bank, points, at, place);
        kinematics_pull(k, place, at->normal, at->pull[tool]);
    }
}

IF_CONE(void shape_levers(const struct bank_view *bank, const struct contact_set *set, const struct collide *points,
                          uint32_t tool, const struct kinematics *k, struct cone_system *cone) {
    cone->levers = true;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        float place[3];
        if (contact_tool(at) != tool)
            continue;
        place_of(bank, points, at, place);
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            const float axis[3] = {a == 0 ? 1.0f : 0.0f, a == 1 ? 1.0f : 0.0f, a == 2 ? 1.0f : 0.0f};
            kinematics_pull(k, place, axis, cone->contact[c].lever[a]);
        }
    }
})

void shape_expect(const struct shape *s, const struct bank_view *bank, struct row_cache *rows,
                  const struct collide *points)
{
    const struct collide_point *p = &points->point[s->turn];
    bool free = (s->near >> s->turn & 1u) && s->turn < points->count && !p->touching;
    for (int k = 0; k < 3 && free && rows->stride; k++) /* bound: 3 */
        row_cache_expect(rows, bank, bank->row_of[bank->triangles[p->triangle].vertex[k]]);
}

void shape_forget(struct shape *s, uint32_t tool, uint32_t first, uint32_t count)
{
    uint32_t points = ((1u << count) - 1u) << first;
    s->tool[tool].started = false;
    s->near &= ~points;
    s->outside &= ~points;
}
