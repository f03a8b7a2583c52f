#include "collide.h"

#include "real.h"

enum side { ENTERS = 1, LEAVES = -1 };

/* The sign says on which side of the edge a -> b the line runs; all three are relative to the line's start. */
static inline float edge_sign(const float direction[3], const float a[3], const float b[3])
{
    float area[3];
    real_cross(a, b, area);
    return real_dot(direction, area);
}

/* Does the segment cross this triangle, into the body or out of it? Its line must pass the three edges on the inner side,
 * its ends lie on both sides of the plane. An edge's sign is computed from the two vertices alone, and changes sign
 * exactly when they are swapped (products commute and differences are odd in IEEE arithmetic), so two triangles that
 * share an edge cannot both miss. */
static bool crosses(const struct bank_view *bank, uint32_t triangle, const float from[3], const float direction[3],
                    enum side side, struct collide_hit *hit)
{
    const float sign = side == ENTERS ? 1.0f : -1.0f;
    const uint16_t *v = bank->triangles[triangle].vertex;
    float corner[3][3], edge[3];
    real_subtract(&bank->positions[3 * v[1]], from, corner[1]);
    real_subtract(&bank->positions[3 * v[2]], from, corner[2]);
    edge[0] = edge_sign(direction, corner[1], corner[2]);
    if (sign * edge[0] > 0.0f) /* most triangles end here or at the next edge: written out for speed */
        return false;
    real_subtract(&bank->positions[3 * v[0]], from, corner[0]);
    edge[1] = edge_sign(direction, corner[2], corner[0]);
    if (sign * edge[1] > 0.0f)
        return false;
    edge[2] = edge_sign(direction, corner[0], corner[1]);
    if (sign * edge[2] > 0.0f)
        return false;
    float sum = edge[0] + edge[1] + edge[2];
    if (!(sign * sum < 0.0f))
        return false;

    float side1[3], side2[3], normal[3], end[3];
    real_subtract(&bank->positions[3 * v[1]], &bank->positions[3 * v[0]], side1);
    real_subtract(&bank->positions[3 * v[2]], &bank->positions[3 * v[0]], side2);
    real_cross(side1, side2, normal);
    for (int i = 0; i < 3; i++) /* bound: 3 */
        end[i] = corner[0][i] - direction[i];
    float above = -real_dot(normal, corner[0]), below = -real_dot(normal, end);
    if (sign * above < 0.0f || sign * below >= 0.0f)
        return false;
    hit->triangle = triangle;
    hit->fraction = above / (above - below);
    for (int k = 0; k < 3; k++) /* bound: 3 */
        hit->weights[k] = edge[k] / sum;
    return true;
}

static bool earlier(const struct collide_hit *a, const struct collide_hit *b)
{
    return a->fraction < b->fraction || (a->fraction == b->fraction && a->triangle < b->triangle);
}

bool collide_brute(const struct bank_view *bank, const float from_m[3], const float to_m[3], struct collide_hit *hit)
{
    float direction[3];
    real_subtract(to_m, from_m, direction);
    bool found = false;
    for (uint32_t t = 0; t < bank->triangle_count; t++) { /* bound: triangles of the bank */
        struct collide_hit candidate;
        if (crosses(bank, t, from_m, direction, ENTERS, &candidate) && (!found || earlier(&candidate, hit))) {
            *hit = candidate;
            found = true;
        }
    }
    return found;
}

/* Part of the segment inside the grid's box, as fractions. The box is taken a little larger: the surface may touch it. */
static bool clip_to_grid(const struct bank_grid *grid, const float from[3], const float direction[3], float span[2])
{
    span[0] = 0.0f;
    span[1] = 1.0f;
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        float margin = 0.01f * grid->cell_m;
        float low = grid->origin_m[i] - margin - from[i];
        float high = grid->origin_m[i] + (float)grid->cells[i] * grid->cell_m + margin - from[i];
        if (direction[i] == 0.0f) {
            if (low > 0.0f || high < 0.0f)
                return false;
            continue;
        }
        float t0 = low / direction[i], t1 = high / direction[i];
        if (t0 > t1) {
            float swap = t0;
            t0 = t1;
            t1 = swap;
        }
        span[0] = t0 > span[0] ? t0 : span[0];
        span[1] = t1 < span[1] ? t1 : span[1];
    }
    return span[0] <= span[1];
}

static bool sweep(const struct bank_view *bank, const float from_m[3], const float to_m[3], enum side side,
                  struct collide_hit *hit)
{
    const struct bank_grid *grid = bank->grid;
    float direction[3], span[2];
    real_subtract(to_m, from_m, direction);
    if (!clip_to_grid(grid, from_m, direction, span))
        return false;

    /* Traversal of Amanatides and Woo, with the crossings computed afresh at every step so that rounding does not add up.
     * Cell lists overlap by 1e-3 of a cell, more than a crossing can be off, so a cell missed at a corner loses nothing. */
    int32_t cell[3], step[3];
    float crossing[3];
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        float p = (from_m[i] + span[0] * direction[i] - grid->origin_m[i]) / grid->cell_m;
        cell[i] = (int32_t)real_clamp(p, 0.0f, (float)(grid->cells[i] - 1));
        step[i] = direction[i] > 0.0f ? 1 : direction[i] < 0.0f ? -1 : 0;
    }
    bool found = false;
    int32_t cells = grid->cells[0] + grid->cells[1] + grid->cells[2] + 1;
    for (int32_t visited = 0; visited < cells; visited++) { /* bound: nx + ny + nz + 1 */
        uint32_t c = (uint32_t)cell[0] + grid->cells[0] * ((uint32_t)cell[1] + grid->cells[1] * (uint32_t)cell[2]);
        for (uint32_t e = bank_view_cell_start(bank, c); e < bank_view_cell_start(bank, c + 1);
             e++) { /* bound: max_in_cell */
            struct collide_hit candidate;
            if (crosses(bank, bank->cell_triangle[e], from_m, direction, side, &candidate) &&
                (!found || earlier(&candidate, hit))) {
                *hit = candidate;
                found = true;
            }
        }
        int axis = -1;
        float leave = 2.0f, slack = 0.0f;
        for (int i = 0; i < 3; i++) { /* bound: 3 */
            if (step[i] == 0)
                continue;
            float wall = grid->origin_m[i] + (float)(cell[i] + (step[i] > 0 ? 1 : 0)) * grid->cell_m;
            crossing[i] = (wall - from_m[i]) / direction[i];
            if (crossing[i] < leave) {
                leave = crossing[i];
                axis = i;
                float speed = direction[i] < 0.0f ? -direction[i] : direction[i];
                slack = 0.01f * grid->cell_m / speed;
            }
        }
        /* A hit is final once the walk is past it by more than rounding. */
        if (axis < 0 || leave > span[1] || (found && hit->fraction < leave - slack))
            break;
        cell[axis] += step[axis];
        if (cell[axis] < 0 || cell[axis] >= grid->cells[axis])
            break;
    }
    return found;
}

bool collide_sweep(const struct bank_view *bank, const float from_m[3], const float to_m[3], struct collide_hit *hit)
{
    return sweep(bank, from_m, to_m, ENTERS, hit);
}

/* Interpolated normal (not normalised) and surface point at barycentric weights. */
static void surface_point(const struct bank_view *bank, uint32_t triangle, const float weights[3], float anchor[3],
                          float normal[3])
{
    const uint16_t *v = bank->triangles[triangle].vertex;
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        anchor[i] = weights[0] * bank->positions[3 * v[0] + i] + weights[1] * bank->positions[3 * v[1] + i] +
                    weights[2] * bank->positions[3 * v[2] + i];
        normal[i] = weights[0] * bank->normals[3 * v[0] + i] + weights[1] * bank->normals[3 * v[1] + i] +
                    weights[2] * bank->normals[3 * v[2] + i];
    }
}

/* One Newton step of a(w) - t m(w) = x in (w1, w2, t), inside the plane of one triangle. False at a focal point, where
 * neighbouring normals meet and the anchor is not defined. */
static bool newton(const struct bank_view *bank, uint32_t triangle, const float x[3], const float weights[3], float t,
                   float step[3])
{
    const uint16_t *v = bank->triangles[triangle].vertex;
    const float *p = bank->positions, *n = bank->normals;
    float a[3], m[3], column1[3], column2[3], side1[3], side2[3], residual[3];
    surface_point(bank, triangle, weights, a, m);
    for (int i = 0; i < 3; i++) { /* bound: 3 */
        side1[i] = p[3 * v[1] + i] - p[3 * v[0] + i];
        side2[i] = p[3 * v[2] + i] - p[3 * v[0] + i];
        column1[i] = side1[i] - t * (n[3 * v[1] + i] - n[3 * v[0] + i]);
        column2[i] = side2[i] - t * (n[3 * v[2] + i] - n[3 * v[0] + i]);
        residual[i] = x[i] - a[i] + t * m[i];
    }
    /* Columns are column1, column2, -m; Cramer's rule. At t = 0 the determinant is -(side1 x side2).m. */
    float area[3], rest[3], across[3];
    real_cross(side1, side2, rest);
    real_cross(column1, column2, area);
    float determinant = real_dot(area, m), at_rest = real_dot(rest, m);
    if (!(at_rest > 0.0f) || !(determinant > 0.25f * at_rest)) /* a step grows at most by the inverse */
        return false;
    real_cross(residual, column2, across);
    step[0] = real_dot(across, m) / determinant;
    real_cross(column1, residual, across);
    step[1] = real_dot(across, m) / determinant;
    step[2] = -real_dot(area, residual) / determinant;
    return true;
}

/* collide_settle without the last step, collide_measure. */
static bool settle(const struct bank_view *bank, struct collide_point *p)
{
    uint32_t triangle = p->triangle, came_from = bank->triangle_count;
    float w[3] = {p->weights[0], p->weights[1], p->weights[2]}, t = p->depth_m;
    float target[3] = {p->position_m[0], p->position_m[1], p->position_m[2]};
    bool settled = false, raised = false;
    for (int k = 0; k < COLLIDE_MAX_WALK && !settled; k++) { /* bound: COLLIDE_MAX_WALK */
        float step[3];
        if (!newton(bank, triangle, target, w, t, step)) {
            float a[3], m[3];
            surface_point(bank, triangle, w, a, m);
            t *= 0.5f;
            for (int i = 0; i < 3; i++) /* bound: 3 */
                target[i] += t * m[i];
            raised = true;
            continue;
        }
        float move[3] = {-step[0] - step[1], step[0], step[1]};
        int side = -1;
        float part = 1.0f;
        for (int i = 0; i < 3; i++) /* bound: 3 */
            if (w[i] + move[i] < 0.0f && move[i] < 0.0f && -w[i] / move[i] < part) {
                part = -w[i] / move[i];
                side = i;
            }
        for (int i = 0; i < 3; i++) /* bound: 3 */
            w[i] = real_clamp(w[i] + part * move[i], 0.0f, 1.0f);
        t += part * step[2];
        if (side < 0) { /* inside this triangle; done when the step was a thousandth of it */
            settled = move[0] * move[0] + move[1] * move[1] + move[2] * move[2] < 1e-6f;
            continue;
        }
        uint32_t next = bank->triangles[triangle].neighbour[side];
        if (next == came_from && part < 1e-3f) { /* to and fro across one edge: the anchor is on it */
            settled = true;
            continue;
        }
        const uint16_t *here = bank->triangles[triangle].vertex, *there = bank->triangles[next].vertex;
        float carried[3] = {0.0f, 0.0f, 0.0f};
        for (int i = 0; i < 3; i++)     /* bound: 3 */
            for (int j = 0; j < 3; j++) /* bound: 3 */
                if (i != side && here[i] == there[j])
                    carried[j] = w[i];
        came_from = triangle;
        triangle = next;
        for (int i = 0; i < 3; i++) /* bound: 3 */
            w[i] = carried[i];
    }
    float sum = w[0] + w[1] + w[2];
    p->triangle = triangle;
    for (int i = 0; i < 3; i++) /* bound: 3 */
        p->weights[i] = w[i] / sum;
    return settled && !raised;
}

void collide_measure(const struct bank_view *bank, struct collide_point *p)
{
    float m[3], away[3];
    surface_point(bank, p->triangle, p->weights, p->anchor_m, m);
    float length = real_sqrt(real_dot(m, m));
    if (length < 0.1f) { /* opposite normals on one triangle: take the face's own */
        const uint16_t *v = bank->triangles[p->triangle].vertex;
        float side1[3], side2[3];
        real_subtract(&bank->positions[3 * v[1]], &bank->positions[3 * v[0]], side1);
        real_subtract(&bank->positions[3 * v[2]], &bank->positions[3 * v[0]], side2);
        real_cross(side1, side2, m);
        length = real_sqrt(real_dot(m, m));
    }
    for (int i = 0; i < 3; i++) /* bound: 3 */
        p->normal[i] = m[i] / length;
    real_subtract(p->anchor_m, p->position_m, away);
    p->depth_m = real_dot(p->normal, away);
}

bool collide_settle(const struct bank_view *bank, struct collide_point *p)
{
    bool settled = settle(bank, p);
    collide_measure(bank, p);
    return settled;
}

static void touch(const struct bank_view *bank, struct collide_point *p, const struct collide_hit *hit)
{
    p->touching = true;
    p->triangle = hit->triangle;
    for (int i = 0; i < 3; i++) /* bound: 3 */
        p->weights[i] = hit->weights[i];
    collide_measure(bank, p);
    for (int i = 0; i < 3; i++) /* bound: 3 */
        p->shallow_normal[i] = p->normal[i];
}

static bool deep(const struct bank_view *bank, const struct collide_point *p)
{
    return p->depth_m > bank->grid->cell_m;
}

enum place { OUTSIDE, PUSHED_THROUGH, INSIDE };

/* Where is the point, looking from it along the contact's normal: inside the body (the first surface is crossed outwards,
 * `hit` says where), pushed through it (inwards, and the shaft passes through the body too), or outside. */
static enum place look_out(const struct bank_view *bank, const struct collide_point *p, const float apex[3],
                           struct collide_hit *hit)
{
    const struct bank_grid *grid = bank->grid;
    struct collide_hit in;
    float far[3], reach = (float)(grid->cells[0] + grid->cells[1] + grid->cells[2]) * grid->cell_m;
    for (int i = 0; i < 3; i++) /* bound: 3 */
        far[i] = p->position_m[i] + reach * p->normal[i];
    bool leaves = sweep(bank, p->position_m, far, LEAVES, hit);
    bool enters = sweep(bank, p->position_m, far, ENTERS, &in);
    if (leaves && (!enters || hit->fraction <= in.fraction))
        return INSIDE;
    return enters && sweep(bank, apex, p->position_m, ENTERS, &in) ? PUSHED_THROUGH : OUTSIDE;
}

/* Slide the anchor under a point in contact, and see whether the contact holds. */
static void follow(struct collide *s, const struct bank_view *bank, struct collide_point *p, const float apex[3],
                   bool ask)
{
    const struct collide_point before = *p;
    struct collide_hit hit;
    bool settled = collide_settle(bank, p);
    if (deep(bank, p) && real_dot(p->normal, p->shallow_normal) < COLLIDE_TURN) {
        p->triangle = before.triangle;
        for (int i = 0; i < 3; i++) /* bound: 3 */
            p->weights[i] = before.weights[i];
        collide_measure(bank, p);
        settled = false;
    }
    s->walks_cut += !settled;

    if (p->depth_m <= 0.0f) {
        /* Out of the tangent plane; out of the body? The anchor may have lagged, or the wedge is thinner than the depth. */
        if (look_out(bank, p, apex, &hit) == INSIDE)
            touch(bank, p, &hit);
        else
            p->touching = false;
    } else if (deep(bank, p)) {
        p->touching = !ask || look_out(bank, p, apex, &hit) != OUTSIDE;
    } else {
        for (int i = 0; i < 3; i++) /* bound: 3 */
            p->shallow_normal[i] = p->normal[i];
    }
}

void collide_start(struct collide *s, const struct bank_view *bank)
{
    *s = (struct collide){.count = 0};
    for (uint32_t t = 0; t < COLLIDE_TOOLS && t < bank->tool_count; t++) { /* bound: COLLIDE_TOOLS */
        s->tool[t] = (struct collide_range){.first = s->count, .count = bank->tools[t].point_count};
        s->count += bank->tools[t].point_count;
    }
}

void collide_begin(struct collide *s)
{
    s->turn = s->turn + 1 < s->count ? s->turn + 1 : 0;
}

void collide_update(struct collide *s, const struct bank_view *bank, uint32_t tool, const float apex_m[3],
                    const float (*positions_m)[3])
{
    const struct collide_range *range = &s->tool[tool];
    for (uint32_t i = 0; i < range->count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        struct collide_point *p = &s->point[range->first + i];
        struct collide_hit hit;
        /* A point that was not known may already be in the body: then it came in along the shaft. */
        const float *from = p->known ? p->position_m : apex_m;
        bool hits = !p->touching && collide_sweep(bank, from, positions_m[i], &hit);
        for (int k = 0; k < 3; k++) /* bound: 3 */
            p->position_m[k] = positions_m[i][k];
        bool found = !p->known && hits;
        p->known = true;
        if (hits)
            touch(bank, p, &hit);
        if (found) { /* the way may have led in and out again */
            struct collide_hit out;
            p->touching = look_out(bank, p, apex_m, &out) == INSIDE;
        }
        if (p->touching)
            follow(s, bank, p, apex_m, range->first + i == s->turn);
    }
}

void collide_forget(struct collide *s, uint32_t tool)
{
    const struct collide_range *range = &s->tool[tool];
    for (uint32_t i = 0; i < range->count; i++) /* bound: BANK_MAX_TOOL_POINTS */
        s->point[range->first + i].known = s->point[range->first + i].touching = false;
}
